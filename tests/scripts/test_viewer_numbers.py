"""The viewer's figures: the parts of the file are the file, and the page is shown."""

import importlib
import sys
from pathlib import Path

import pytest
from browser import skip_without_browser


@pytest.mark.slow
def test_the_file_s_size_and_its_first_picture_are_measured(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    skip_without_browser()
    monkeypatch.delitem(sys.modules, "viewer_numbers", raising=False)
    module = importlib.import_module("scripts.speed.viewer_numbers")
    page, out = tmp_path / "view.html", tmp_path / "numbers.md"
    assert module.main(["--short", "--page", str(page), "--out", str(out)]) == 0
    text = out.read_text(encoding="utf-8")
    assert text in capsys.readouterr().out
    size = len(page.read_bytes())
    assert f"| file, bytes | {size:,} | < 300,000 |" in text
    parts = module.parts_of(page.read_text(encoding="utf-8"))
    assert sum(parts.values()) == size
    assert all(f"{name} {count:,}" in text for name, count in parts.items())
    assert parts["script"] > 50_000 < parts["data"] + parts["style"]
    for words in ("5 textures (8 × 8, 8 × 8, 8 × 8, 8 × 8, 8 × 8)", "1 loads", "Chromium", "torch", "smoke test"):
        assert words in text
    row = next(line for line in text.splitlines() if line.startswith("| first picture, s, median"))
    assert float(row.split("|")[2]) > 0


def test_without_a_browser_there_is_nothing_to_measure(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    module = importlib.import_module("scripts.speed.viewer_numbers")
    monkeypatch.setenv("PATH", "/nowhere")
    assert module.main(["--short"]) == 2
    assert capsys.readouterr().err.startswith("no chromium on the PATH, expected Debian's chromium")
