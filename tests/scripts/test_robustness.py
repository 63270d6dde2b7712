"""scripts/verdict/robustness.py in its short form: a table with a row a cell, and the page where it is asked for."""

import importlib
from pathlib import Path

import pytest


def test_the_table_and_the_document(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    script = importlib.import_module("scripts.verdict.robustness")
    place = tmp_path / "robustness.md"
    assert script.main(["--short", "--only", "lamp", "--methods", "mccool", "--out", str(place)]) == 0
    row = next(line for line in capsys.readouterr().out.splitlines() if line.startswith("| fall of the gain over θi |"))
    before, after = (float(row.split("|")[column]) for column in (5, 8))
    assert abs(before - 1) > 0.2
    assert abs(after - 1) < 0.15
    assert row in place.read_text(encoding="utf-8")
