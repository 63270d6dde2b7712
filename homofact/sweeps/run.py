"""Run a sweep: skip finished tasks and tasks that were set aside, and let workers run the rest."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from homofact.brdf.source_names import MATERIAL_PREFIX
from homofact.errors import BadInput
from homofact.evaluation.grid import each_once
from homofact.files.lock import claimed
from homofact.files.reading import split_member
from homofact.sweeps.ledger import Aside, SweepLedger
from homofact.sweeps.local import TaskEnding
from homofact.sweeps.sweep_file import AskedSweep
from homofact.sweeps.task import Task, tasks_of

Notify = Callable[["State", TaskEnding | None], object]


class WorkerEngine(Protocol):
    """What runs the tasks: `local.Local`, or `cluster.DaskCluster` for other machines."""

    def run(self, tasks: list[Task], ended: Callable[[TaskEnding], bool]) -> None:
        """Run all tasks; `ended` is called for each and returns whether to retry it."""
        ...


@dataclass
class State:
    """The state of a sweep: its tasks, how many are `done` and were `before`, and by key the failed and open ones."""

    tasks: list[Task]
    before: int
    done: int
    aside: dict[str, Aside]
    todo: dict[str, Task]

    @property
    def left(self) -> int:
        """How many tasks are still to do."""
        return len(self.todo)


def sweep(asked: AskedSweep, folder: Path, engine: WorkerEngine, notify: Notify, retry: bool = False) -> State:
    """Run the unfinished tasks; `notify` is called at the beginning and after every task.

    Tasks that were set aside stay so unless `retry` is true. Raises BadInput if the folder contains something else, a
    source with unfinished tasks no longer exists, another process runs a sweep in the folder, or results cannot be
    written.
    """
    return sweep_tasks(asked.name, tasks_of(asked), folder, engine, notify, retry)


def sweep_tasks(
    name: str, tasks: list[Task], folder: Path, engine: WorkerEngine, notify: Notify, retry: bool = False
) -> State:
    """Run the given tasks as the sweep `name`, in the same way as `sweep`."""
    # Two files of the same bytes are one source.
    tasks = list(each_once(tasks, lambda task: task.key).values())
    ledger = SweepLedger(folder)
    with claimed(folder):
        _refuse_gone(ledger, tasks)
        ledger.begin(name, tasks)
        todo = [task for task in tasks if not ledger.is_done(task)]
        keys = {task.key for task in todo}
        aside = {key: entry for key, entry in ledger.aside().items() if key in keys}
        if retry:
            ledger.forgive(aside)
            aside = {}
        done = len(tasks) - len(todo)
        todo = [task for task in todo if task.key not in aside or not aside[task.key].final]
        state = State(tasks, done, done, aside, {task.key: task for task in todo})
        notify(state, None)

        def ended(ending: TaskEnding) -> bool:
            task = ending.task
            if ending.seconds is not None:
                state.done += 1
                state.aside.pop(task.key, None)
                ledger.forgive([task.key])
            elif ending.refused is not None:
                state.aside[task.key] = ledger.set_aside(task, ending.refused)
            else:
                deaths = ending.deaths + (state.aside[task.key].deaths if task.key in state.aside else 0)
                state.aside[task.key] = ledger.set_aside(task, str(ending.died), deaths)
            again = ending.died is not None and not state.aside[task.key].final
            if not again:
                state.todo.pop(task.key, None)
            notify(state, ending)
            return again

        if todo:
            engine.run(todo, ended)
    return state


def _refuse_gone(ledger: SweepLedger, tasks: list[Task]) -> None:
    """Raise BadInput for a source of the folder's sweep that is neither asked for any more nor there."""
    if not (ledger.folder / "sweep.json").is_file():
        return
    now = {task.source for task in tasks}
    for task in ledger.asked():
        gone = task.source not in now and not task.source.startswith(MATERIAL_PREFIX)
        if gone and not ledger.is_done(task) and not Path(split_member(task.source)[0]).exists():
            raise BadInput("is gone since the sweep began", where=task.source, expected="it there, or a new folder")
