"""The figures of sweeps: stand-ins leave results as fits do, and the log tells idle workers and what was done again."""

import importlib
import json
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

import pytest

from homofact.sweeps.ledger import SweepLedger
from homofact.sweeps.local import TaskEnding
from homofact.sweeps.summary import rows_of
from homofact.sweeps.task import Task


@pytest.fixture
def script(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[[str], ModuleType]:
    monkeypatch.setenv("HOMOFACT_STAND_IN", str(tmp_path))
    return lambda name: importlib.import_module(f"scripts.{name}")


@pytest.fixture(scope="module")
def prepared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The folder with the result that stands for all."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HOMOFACT_STAND_IN", "")
        place = tmp_path_factory.mktemp("stand-in")
        importlib.import_module("scripts.sweeps.sweep_stand_in").prepare(place)
        yield place


def test_stand_ins_are_swept_and_summed_up_as_fits_are(
    script: Callable[[str], ModuleType], prepared: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = script("sweeps.sweep_stand_in")
    monkeypatch.setenv("HOMOFACT_STAND_IN", str(prepared))
    out = tmp_path / "sweep"

    class Here:
        def run(self, tasks: list[Task], ended: Callable[[TaskEnding], bool]) -> None:
            for task in tasks:
                ended(TaskEnding(task, module.stand_in(task, out)["seconds"]))

    @contextmanager
    def engine_of(*_: object) -> Iterator[Here]:
        yield Here()

    monkeypatch.setattr(module, "engine_of", engine_of)
    found = module.swept(out, ["", "sleep 0.01", ""], "2")
    assert (found["tasks"], found["rows"], found["aside"]) == (3, 3, 0)
    assert 0 <= found["begin"] <= found["first"] <= found["last"] <= found["wall"]
    assert 0.01 <= found["gap"] <= found["last"]
    assert 0 < found["before"] <= found["peak"] <= found["peak_reading"]
    assert [row.seed for row in rows_of(out)] == [0, 1, 2]
    log = module.logged()
    assert [(each.seed, each.ended) for each in log] == [(seed, end) for seed in range(3) for end in (False, True)]
    assert {each.process for each in log} == {os.getpid()}
    # What is done is neither begun nor waited for again.
    assert module.swept(out, ["", "sleep 0.01", ""], "2")["rows"] == 3
    assert len(module.logged()) == 6


def test_time_between_tasks_is_what_no_task_takes(script: Callable[[str], ModuleType], tmp_path: Path) -> None:
    numbers = script("sweeps.sweep_numbers")
    log = ["1 0 begin 100", "2 1 begin 101", "1 0 end 110", "1 2 begin 110.5", "2 1 end 111", "1 2 end 120.5"]
    (tmp_path / "log").write_text("\n".join([*log, "2 3 begin 111.25", "2 3 end 121"]) + "\n")
    share, longest = numbers.between_tasks()
    assert share == pytest.approx((0.5 + 0.25) / (20.5 + 20))
    assert longest == 0.5


def test_a_row_tells_what_was_done_again_from_what_was_cut_short(
    script: Callable[[str], ModuleType], tmp_path: Path
) -> None:
    kills, folder = script("sweeps.sweep_kills"), tmp_path / "case"
    folder.mkdir()
    case = kills.Case(folder, [""] * 5)
    ledger = SweepLedger(case.out)
    ledger.begin("stand-ins", case.tasks)
    for task in case.tasks[:3]:
        ledger.place(task).mkdir(parents=True)
        (ledger.place(task) / "factorization.npz").touch()
    ledger.set_aside(case.tasks[3], "its worker died", 2)
    begun = (0, 1, 1, 2, 3, 3)
    (tmp_path / "log").write_text("".join(f"7 {seed} begin {k}\n" for k, seed in enumerate(begun)))
    assert case.done() == {0, 1, 2}
    row = case.row("a worker", {0, 1})
    assert (row.tasks, row.before, row.redone, row.cut_short, row.aside, row.lost) == (5, 2, 1, 1, 1, 1)
    assert len(row.cells()) == len(kills.HEADER)
    assert json.loads((folder / "labels.json").read_text()) == [""] * 5


def test_a_client_that_ends_in_an_error_is_one_line(
    script: Callable[[str], ModuleType], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "labels.json").write_text("[]")
    (tmp_path / "file").touch()
    client = script("sweeps.sweep_stand_in").main
    assert client(["client", str(tmp_path / "file"), str(tmp_path / "labels.json"), "2"]) == 2
    assert capsys.readouterr().err.count("\n") == 1
