"""The fuzz program of results: a short run over every kind, and that it sees what it is there to see."""

import importlib
import random
from pathlib import Path
from types import ModuleType

import pytest

from homofact.errors import BadInput

KINDS = ("npz", "manifest", "toml", "scene", "ledger")


@pytest.fixture
def fuzzer(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    return importlib.import_module("scripts.checks.fuzz_results")


@pytest.mark.slow
def test_a_short_run_finds_nothing(fuzzer: ModuleType, capsys: pytest.CaptureFixture[str]) -> None:
    assert fuzzer.main(["--count", "60", "--seed", "5"]) == 0
    lines = {line.split()[0]: line for line in capsys.readouterr().out.splitlines()}
    assert tuple(lines) == KINDS
    for name, line in lines.items():
        assert line.endswith("wrong 0"), line
        assert " refused" in line, name
        assert " used" in line, name


def test_it_sees_other_errors_long_messages_and_missing_names(fuzzer: ModuleType, tmp_path: Path) -> None:
    def failing(error: Exception):
        def use(path: Path, number: int) -> None:
            raise error

        kind = fuzzer.Kind("fake", lambda _, path: path.write_bytes(b"x"), use)
        return [what for what, _ in fuzzer.fuzz(kind, 2, 0, tmp_path).wrong]

    assert failing(ZeroDivisionError("by nought")) == ["ZeroDivisionError: by nought"] * 2
    assert failing(BadInput(f"{tmp_path}/damaged/fake: two\nlines"))[0].startswith("message")
    assert failing(BadInput("a file is wrong"))[0].startswith("message")
    assert failing(BadInput(f"{tmp_path}/damaged/fake: wrong")) == []


def test_damage_is_reproducible_and_damages(fuzzer: ModuleType) -> None:
    value = {"a": [1, {"b": "c"}], "d": None}
    first = [fuzzer.json_damaged(value, random.Random(k)) for k in range(50)]
    again = [fuzzer.json_damaged(value, random.Random(k)) for k in range(50)]
    assert list(map(repr, first)) == list(map(repr, again))
    assert sum(each != value for each in first) > 40
