"""The scripts of edited pictures in their short forms: against Mitsuba, and the gallery's figure of increments."""

import importlib
import re
from pathlib import Path

import pytest
from mitsuba_cases import variant

from homofact.containers.png import read_png


@pytest.fixture(autouse=True)
def scripts_on_the_path(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("embreex", reason="embreex is not installed: pip install 'homofact[relight]'")


@pytest.mark.slow
def test_edited_pictures_are_held_against_mitsuba(tmp_path: Path) -> None:
    variant("llvm_ad_rgb", register=False)
    arguments = ["--short", "--out", str(tmp_path / "truth.md")]
    assert importlib.import_module("scripts.editing.editing_truth").main(arguments) == 0
    text = (tmp_path / "truth.md").read_text(encoding="utf-8")
    rows = [
        [cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if line.startswith("| ")
    ]
    # Five edited materials under two lights, below the head.
    assert len(rows) == 2 + 5 * 2
    for row in rows[2:]:
        few, more, points, noise = (float(cell.rstrip("%")) / 100 for cell in row[2:])
        # 27 pixels, 32 samples and 100 lights: what is wrong by more than that is a bug.
        assert 0.01 < noise < 0.15
        assert more < 1.1 * few
        # So few triangles and points are too coarse for the narrow lobes.
        if not any(narrow in row[0] for narrow in ("sigma 0.05", "3000")):
            assert more < max(0.18, 2 * noise)
            assert points < 0.15


def test_an_increment_is_nearer_than_as_many_wavelets(tmp_path: Path) -> None:
    text = importlib.import_module("scripts.editing.editing_figures").main(
        ["--short", "--only", "increments", "--out", str(tmp_path / "gallery.md")]
    )
    assert read_png(tmp_path / "pictures" / "editing-increments.png").shape[2] >= 3
    increment, wavelets = map(float, re.findall(r"the error (?:of the picture )?is ([\d.]+)%", text))
    assert increment < wavelets


@pytest.mark.slow
def test_light_between_surfaces_is_held_against_paths(tmp_path: Path) -> None:
    variant("llvm_ad_rgb", register=False)
    arguments = ["--short", "--out", str(tmp_path / "bounce.md")]
    assert importlib.import_module("scripts.editing.editing_bounce").main(arguments) == 0
    lines = [line for line in (tmp_path / "bounce.md").read_text(encoding="utf-8").splitlines() if line.startswith("|")]
    header, _, row = ([cell.strip() for cell in line.strip("|").split("|")] for line in lines)
    columns = dict(zip(header, row, strict=True))
    names = ("without bounce", "with bounce", "bounce of all light")
    without, found, share = (float(columns[name].rstrip("%")) for name in names)
    # Even a picture 16 pixels wide, noisy as it is, is nearer with the bounce.
    assert found < without
    assert 2 < share < 20
