"""Tasks for the stub worker, and a sweep of them."""

import sys
from collections.abc import Sequence
from pathlib import Path

from homofact.sweeps.ledger import SweepLedger
from homofact.sweeps.local import Local, TaskEnding
from homofact.sweeps.run import State, sweep_tasks
from homofact.sweeps.task import Task

STUB = (sys.executable, str(Path(__file__).parent / "sweep_stub_worker.py"))


def stub_task(label: str, number: int) -> Task:
    """A task that the stub does as `label` says."""
    return Task("material:phong-30", "0" * 64, {}, label, "mccool", {"seed": 0, "number": number}, 0.2)


def stub_tasks(labels: Sequence[str]) -> list[Task]:
    """One a label."""
    return [stub_task(label, number) for number, label in enumerate(labels)]


def run(folder: Path, tasks: list[Task], workers: int = 2, retry: bool = False) -> tuple[State, list[TaskEnding]]:
    """Sweep them by stub workers: the state at the end, and every ending on the way.

    Fails where a task is tried more than twice, which would otherwise go on for ever.
    """
    endings: list[TaskEnding] = []

    def told(_: State, ending: TaskEnding | None) -> None:
        if ending is not None:
            endings.append(ending)
            tries = sum(earlier.task is ending.task for earlier in endings)
            assert tries <= 2, f"{ending.task.label}: tried {tries} times, expected at most two"

    state = sweep_tasks("stub", tasks, folder, Local(folder, workers, STUB), told, retry)
    return state, endings


def log(folder: Path) -> list[tuple[int, int]]:
    """(process, number of the task) of every beginning."""
    lines = (folder / "log").read_text().splitlines()
    return [(int(process), int(number)) for process, number in map(str.split, lines)]


def done(folder: Path, tasks: list[Task]) -> list[int]:
    """Numbers of the tasks whose results are there."""
    ledger = SweepLedger(folder)
    return [int(task.settings["number"]) for task in tasks if ledger.is_done(task)]
