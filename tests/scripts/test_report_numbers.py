"""The report's figures: the bytes are the files', and every page is loaded, sorted and drawn anew."""

import importlib
import sys
from pathlib import Path
from types import ModuleType

import pytest
from browser import skip_without_browser
from swept import make_sweep

from homofact.sweeps.report.reading import read_results


@pytest.fixture
def numbers(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.delitem(sys.modules, "report_numbers", raising=False)
    return importlib.import_module("scripts.sweeps.report_numbers")


@pytest.mark.slow
def test_size_and_load_are_measured(numbers: ModuleType, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    skip_without_browser()
    sweep, out = make_sweep(tmp_path / "s"), tmp_path / "numbers.md"
    assert numbers.main([str(sweep), "--short", "--out", str(out)]) == 0
    text = out.read_text(encoding="utf-8")
    assert text in capsys.readouterr().out
    assert "6 fits of 3 materials" in text
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in text.splitlines() if line.startswith("| ")]
    assert [row[0] for row in rows[2:]] == ["6", "40"]
    assert all(float(cell) > 0 for row in rows[2:] for cell in row[2:])
    assert "Chromium" in text
    assert "smoke test" in text


def test_a_larger_sweep_is_the_same_fits_as_other_materials(numbers: ModuleType, tmp_path: Path) -> None:
    sweep = read_results(make_sweep(tmp_path / "s"))
    many = numbers.larger(sweep, 20)
    assert len(many.fits) == 20
    assert len({fit.row.key for fit in many.fits}) == 20
    assert len(many.names()) == 10
    for k, fit in enumerate(many.fits):
        was = sweep.fits[k % 6].row
        assert fit.row.label == was.label
        assert fit.row.metrics["log_mse"] == pytest.approx(was.metrics["log_mse"], rel=0.1)


def test_what_is_no_sweep_is_refused(numbers: ModuleType, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert numbers.main([str(tmp_path), "--short"]) == 2
    assert "found no sweep.json in it" in capsys.readouterr().err
