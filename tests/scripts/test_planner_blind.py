"""The short form of the blind test of plans: two plans on small pictures, meaningless figures, whole tables."""

import importlib

import pytest


@pytest.mark.slow
def test_it_prints_its_table(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    program = importlib.import_module("scripts.planning.planner_blind")
    for name, value in {"VIEWS": 2, "SIZE": 32, "MAP_SIZE": 16, "TEXELS": 32}.items():
        monkeypatch.setattr(program, name, value)
    assert program.main(["--short", "--half", "tuning"]) == 0
    shown = capsys.readouterr().out
    assert "| all | – | 2 |" in shown
    assert shown.count("Case(material=") == 2
    # The halves share neither materials nor lightings.
    assert not set(program.MODELS["tuning"]) & set(program.MODELS["test"])
    names = [
        {each.name for each in program.lightings(half) if each.name != "sky with a sun"} for half in program.MODELS
    ]
    assert not names[0] & names[1]
