"""The Python that the documents show runs as it stands there, each document from top to bottom."""

import os
import re
import shutil
from pathlib import Path

import pytest

from homofact.factor.fixed_projections import FIXED_AXES, KINDS
from homofact.geometry.coordinates import COORDINATES
from sitemaker.runnable import blocks_of, run

ROOT = Path(__file__).resolve().parents[1]
# What the lines do, not how their pictures look or how evenly light is drawn.
pytestmark = pytest.mark.usefixtures("small_pictures", "rough_sampling")
DOCUMENTS = ("README.md", "docs/python.md", "docs/start.md")


@pytest.mark.slow
@pytest.mark.parametrize("name", DOCUMENTS)
def test_the_lines_of_a_document_run(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shutil.copytree(ROOT / "data_synthetic", tmp_path / "data_synthetic")
    monkeypatch.chdir(tmp_path)
    blocks = blocks_of((ROOT / name).read_text(encoding="utf-8"), "python")
    assert blocks
    names, _ = run(Path(name), blocks)
    assert os.path.exists("paint.npz")
    assert names["same"].evaluate(names["source"].samples.wi, names["source"].samples.wo).equal(names["values"])
    if name == "docs/python.md":
        errors = names["several"].held_out["log_mse"]
        assert errors.low < errors.mean < errors.high
        assert (names["reopened"].known, names["page"].caution) == (True, "")
        assert os.path.getsize("held_out.html") == names["page"].size


@pytest.mark.slow
def test_the_relighting_that_its_document_shows_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("embreex", reason="embreex is not installed: pip install 'homofact[relight]'")
    for folder in ("data_synthetic", "configs"):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    scene = tmp_path / "configs" / "scenes" / "relight.toml"
    # The same lines on a coarser scene.
    text = scene.read_text(encoding="utf-8")
    for given, coarse in (("cube = 64", "cube = 8"), ("steps = 64", "steps = 12"), ("[560, 420]", "[70, 52]")):
        assert given in text
        text = text.replace(given, coarse)
    scene.write_text(text)
    monkeypatch.chdir(tmp_path)
    text = (ROOT / "docs/relighting.md").read_text(encoding="utf-8")
    blocks = blocks_of(text[: text.index("## The page")], "python")
    assert len(blocks) == 2
    names, _ = run(Path("docs/relighting.md"), blocks)
    assert names["colours"].shape == names["knot"].mesh.positions.shape
    assert names["colours"].max() > 0.1
    objects = names["scene"].objects
    assert [colours.shape for colours in names["shown"]] == [relit.mesh.positions.shape for relit in objects]
    assert (tmp_path / "out" / "relight_from_python" / "relight.npz").is_file()


def test_the_table_of_projections_is_that_of_the_code() -> None:
    rows = re.findall(r"^\| `([a-z-]+)` \|.*\| (`.*`) \|$", (ROOT / "docs/python.md").read_text(encoding="utf-8"), re.M)
    told = {coordinates: set(re.findall(r"`([^`]+)`", listed)) for coordinates, listed in rows}
    known: dict[str, set[str]] = {name: set() for name in COORDINATES}
    for name, (coordinates, _) in FIXED_AXES.items():
        known[coordinates].add(name)
    assert told == known
    assert set(KINDS) == {*FIXED_AXES, *(name for name, system in COORDINATES.items() if not system.periodic)}
