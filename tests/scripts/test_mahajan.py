"""The in-out experiment in its short form: its tables hold what it draws."""

import importlib
from pathlib import Path
from types import ModuleType

import pytest


@pytest.fixture
def module(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    return importlib.import_module("scripts.accuracy.mahajan")


@pytest.mark.slow
def test_the_short_form_prints_and_draws(
    module: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(module, "SHARE", 0.95)
    assert module.main(["--short", "--out", str(tmp_path / "f"), "--data", str(tmp_path / "none")]) == 0
    out, err = capsys.readouterr()
    assert "a smoke test, not results" in out
    rows = {cells[1].strip(): cells[3].strip() for line in out.splitlines() if len(cells := line.split("|")) == 5}
    assert float(rows["s = 30: leading 25 singular values against (3.37)"].removeprefix("within ")) < 0.01
    # ln 20 = 3.0 terms for each unit of s.
    assert float(rows["slope of K against s, sphere, s to 30"].split()[0]) == pytest.approx(3.0, abs=0.2)
    assert "limit 3.00" in rows["slope of K against s, sphere, s to 30"]
    assert sorted(path.name for path in (tmp_path / "f").iterdir()) == [
        "figure_2.png", "figure_3a.png", "figure_4.png", "figure_5.png", "figure_7.png",
    ]  # fmt: skip
    assert err.count("skipped") == 5


def test_the_papers_grid_and_the_line(module: ModuleType) -> None:
    assert module.on_the_papers_grid(0.4) == 23
    assert module.line([0, 1, 2], [1, 3, 5]) == (pytest.approx(2), pytest.approx(1), pytest.approx(1))
