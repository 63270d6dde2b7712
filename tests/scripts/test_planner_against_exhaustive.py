"""The short form of the planner's comparison: two materials, one lighting, meaningless figures, whole tables."""

import importlib
from pathlib import Path

import pytest


def test_it_prints_its_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    program = importlib.import_module("scripts.planning.planner_against_exhaustive")
    assert program.main(["--short", "--keep", str(tmp_path / "rows.jsonl")]) == 0
    first = capsys.readouterr().out
    assert "| all |  | 18 |" in first
    assert program.main(["--short", "--keep", str(tmp_path / "rows.jsonl")]) == 0
    again = capsys.readouterr().out
    assert again.split("\n\n")[1] == first.split("\n\n")[1]
