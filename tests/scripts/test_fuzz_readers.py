"""The fuzz program: a short run over every reader, and that it sees what it is there to see."""

import importlib
import time
from collections.abc import Callable
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

from homofact.brdf.formats import READERS, read_by
from homofact.brdf.samples import Samples
from homofact.errors import BadInput


@pytest.fixture
def fuzzer(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    return importlib.import_module("scripts.checks.fuzz_readers")


@pytest.mark.slow
def test_a_short_run_finds_nothing(fuzzer: ModuleType, capsys: pytest.CaptureFixture[str]) -> None:
    assert fuzzer.main(["--count", "90", "--seed", "5"]) == 0
    lines = {line.split()[0]: line for line in capsys.readouterr().out.splitlines()}
    assert set(lines) == {reader.NAME for reader in READERS}
    for name, line in lines.items():
        assert "no whole file" in line or (line.endswith("wrong 0") and " refused" in line), name
        assert "no whole file" not in line or name == "rgl"


@pytest.mark.slow
def test_undamaged_files_are_read(fuzzer: ModuleType, tmp_path: Path) -> None:
    for name, raw in fuzzer.whole_files(tmp_path).items():
        reader = next(each for each in READERS if name == each.NAME)
        (tmp_path / "file").write_bytes(raw)
        assert len(read_by(reader, tmp_path / "file").samples) > 0, name


def outcome(fuzzer: ModuleType, tmp_path: Path, read: Callable[..., Samples]) -> list[str]:
    tally = fuzzer.fuzz(SimpleNamespace(NAME="fake", read=read), b"0123456789" * 20, 4, 0, tmp_path)
    return [what for what, _ in tally.wrong]


def test_it_sees_other_errors_long_messages_and_missing_names(fuzzer: ModuleType, tmp_path: Path) -> None:
    def other(path: Path, *_: str) -> Samples:
        raise ZeroDivisionError("by nought")

    def long(path: Path, *_: str) -> Samples:
        raise BadInput(f"{path}: two\nlines")

    def nameless(path: Path, *_: str) -> Samples:
        raise BadInput("a file is wrong")

    assert outcome(fuzzer, tmp_path, other)[0] == "ZeroDivisionError: by nought"
    assert "two\\nlines" in outcome(fuzzer, tmp_path, long)[0]
    assert "a file is wrong" in outcome(fuzzer, tmp_path, nameless)[0]


def test_it_sees_slow_and_greedy_readers(fuzzer: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fuzzer, "SECONDS", 0.01)
    monkeypatch.setattr(fuzzer, "SLACK", 10 * 2**20)

    def slow(path: Path, *_: str) -> Samples:
        begun = time.process_time()
        while time.process_time() - begun < 0.02:
            pass
        raise BadInput(f"{path}: slow")

    def greedy(path: Path, *_: str) -> Samples:
        np.zeros(4 * 2**20)
        raise BadInput(f"{path}: greedy")

    assert any(what.endswith(" s") for what in outcome(fuzzer, tmp_path, slow))
    assert any(" MB for " in what for what in outcome(fuzzer, tmp_path, greedy))
