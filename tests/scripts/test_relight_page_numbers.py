"""The figures of the page of a relit scene: made from a scene, measured from a file, and troubles in a line."""

import importlib
import sys
from pathlib import Path
from types import ModuleType

import pytest
from browser import skip_without_browser

SCENE = """
[[object]]
mesh = "shape:sphere"
albedo = [0.6, 0.5, 0.4]
terms = 1
[ground]
albedo = [0.5]
steps = 4
terms = 1
[lighting]
named = "overcast"
[[camera]]
eye = [0.0, 0.6, 3.5]
[transport]
cube = 16
kept = 64
clusters = 6
components = 4
"""


@pytest.fixture
def numbers(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.delitem(sys.modules, "relight_page_numbers", raising=False)
    return importlib.import_module("scripts.relighting.relight_page_numbers")


@pytest.mark.slow
def test_a_scene_s_page_is_made_and_measured(
    numbers: ModuleType, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    skip_without_browser()
    scene, page, out = tmp_path / "ball.toml", tmp_path / "ball.html", tmp_path / "numbers.md"
    scene.write_text(SCENE)
    assert numbers.main(["--short", str(scene), "--page", str(page), "--out", str(out)]) == 0
    text = out.read_text(encoding="utf-8")
    assert text in capsys.readouterr().out
    assert f"| file, bytes | {page.stat().st_size:,} | ≤ 20,000,000 | held |" in text
    rows = {
        line.split("|")[1].strip(): line.split("|")[2].strip() for line in text.splitlines() if line.startswith("| ")
    }
    for name in ("first picture, s", "one frame at full resolution, ms", "light turned, from nothing, ms"):
        assert float(rows[name]) >= 0
    # The reference is the dense sum, which a matte ball is close to.
    assert 0 < float(rows["relative RMS against the reference"].rstrip("%")) < 20
    for words in ("900 × 700 pixels", "Chromium", "load of the machine", "torch"):
        assert words in text


def test_what_is_no_page_is_said(numbers: ModuleType, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert numbers.main(["--short", str(tmp_path / "none.toml")]) == 2
    assert "none.toml" in capsys.readouterr().err
