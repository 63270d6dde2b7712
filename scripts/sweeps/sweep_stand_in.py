"""Run a sweep with trivial fits, so that `sweep_numbers.py` and `sweep_kills.py` measure everything else.

    python scripts/sweeps/sweep_stand_in.py worker FOLDER                    a worker of a local sweep
    python scripts/sweeps/sweep_stand_in.py client FOLDER LABELS.json N      a client with N of them; figures as JSON
    python scripts/sweeps/sweep_stand_in.py client FOLDER LABELS.json FILE   the same on the workers of Dask's scheduler
    python -m distributed.cli.dask_worker --preload sweep_stand_in    a worker of Dask's

$HOMOFACT_STAND_IN is a folder with the result that stands for every fit (`prepare` makes it) and with the log of what
was begun and ended, and when. A label says what is done with its task: "" nothing, "sleep 10" nothing for so many
seconds, "die" kills every worker that is at it.
"""

import json
import os
import signal
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

from homofact.errors import BadInput
from homofact.exporting.manifest import write_json
from homofact.exporting.result import REPORT
from homofact.files.kinds import FACTORIZATION
from homofact.sections import SourceSettings
from homofact.sweeps import work
from homofact.sweeps.ledger import SweepLedger, sealed
from homofact.sweeps.local import Local, TaskEnding
from homofact.sweeps.progress import SweepProgress
from homofact.sweeps.run import State, WorkerEngine, sweep_tasks
from homofact.sweeps.summary import rows_of
from homofact.sweeps.sweep_file import settings_record
from homofact.sweeps.task import Task, source_digest

PLACE, SOURCE = "HOMOFACT_STAND_IN", "material:phong-10"
WORKER = (sys.executable, str(Path(__file__).resolve()), "worker")


def prepare(place: Path) -> None:
    """Put a real fit's result into `place`, which stands for all, and have workers started from here find it."""
    from homofact.brdf.source import open_source
    from homofact.evaluation.compare import fit_and_measure
    from homofact.files.plain import plain
    from homofact.methods.mccool import McCool

    place.mkdir(parents=True, exist_ok=True)
    row = fit_and_measure(open_source(SOURCE, count=400), McCool(size=4))
    row.factorization.save(place / FACTORIZATION)
    write_json(place / REPORT, plain(row.record()))
    os.environ[PLACE] = str(place)


def stand_in_tasks(labels: Sequence[str]) -> list[Task]:
    """A task for each label, which are told apart by their seeds."""
    opening, digest = settings_record(SourceSettings()), source_digest(SOURCE)
    return [Task(SOURCE, digest, opening, label, "mccool", {"seed": k}, 0.2) for k, label in enumerate(labels)]


@dataclass(frozen=True)
class Logged:
    """A task, by its seed, begun (or ended) by a process; `time` is the system's monotonic clock, in seconds."""

    process: int
    seed: int
    ended: bool
    time: float


def logged() -> list[Logged]:
    """What workers have begun and ended so far, in its order."""
    file = Path(os.environ[PLACE]) / "log"
    lines = file.read_text(encoding="utf-8").splitlines() if file.exists() else []
    return [Logged(int(p), int(seed), what == "end", float(t)) for p, seed, what, t in map(str.split, lines)]


def _log(task: Task, what: str) -> None:
    with (Path(os.environ[PLACE]) / "log").open("a", encoding="utf-8") as log:
        log.write(f"{os.getpid()} {task.settings['seed']} {what} {time.monotonic()}\n")


def stand_in(task: Task, folder: Path, words: str | None = None) -> dict[str, Any]:
    """In the place of `work.do`: what the task's label says, and a result written as a fit's is."""
    began = time.monotonic()
    ledger, place = SweepLedger(folder), Path(os.environ[PLACE])
    if ledger.is_done(task):
        return {"seconds": 0.0}
    _log(task, "begin")
    what, _, more = task.label.partition(" ")
    if what == "die":
        os.kill(os.getpid(), signal.SIGKILL)
    time.sleep(float(more or 0))

    def fill(made: Path) -> None:
        (made / FACTORIZATION).write_bytes((place / FACTORIZATION).read_bytes())
        report = json.loads((place / REPORT).read_text(encoding="utf-8"))
        write_json(made / REPORT, sealed(report | {"task": task.record()}, made / FACTORIZATION))

    work.put(ledger, task, fill)
    _log(task, "end")
    return {"seconds": time.monotonic() - began}


@contextmanager
def engine_of(folder: Path, where: str) -> Iterator[WorkerEngine]:
    """Who does the tasks: so many local workers, or those of the scheduler that wrote the file `where`."""
    if where.isdigit():
        yield Local(folder, int(where), WORKER)
        return
    from homofact.sweeps.cluster import DaskCluster

    yield DaskCluster(folder, where, 1, lambda _: None)


def swept(folder: Path, labels: Sequence[str], where: str) -> dict[str, Any]:
    """Sweep stand-ins, and read their results as `homofact sweep` does: its figures, in seconds and bytes.

    "first" is until the first task has ended, "last" until the last one has, "gap" the longest time between two calls
    of the progress from then on; "before" and "peak" are the process's memory when it begins and at most.
    """
    tasks = stand_in_tasks(labels)
    progress, times = SweepProgress(int(where) if where.isdigit() else 1), []
    before, start = resident("VmRSS"), time.monotonic()

    def told(state: State, ending: TaskEnding | None) -> None:
        if ending is None:
            progress.begin(state)
        else:
            progress.end(state, ending)
        progress.words()
        times.append(time.monotonic() - start)

    with engine_of(folder, where) as engine:
        state = sweep_tasks("stand-ins", tasks, folder, engine, told)
    swept_by = time.monotonic()
    at_sweep = resident("VmHWM")
    rows = len(rows_of(folder))
    ended = times[1:] or times
    return {
        "tasks": len(tasks),
        "rows": rows,
        "aside": sum(each.final for each in state.aside.values()),
        "begin": times[0],
        "first": ended[0],
        "last": ended[-1],
        "gap": max((b - a for a, b in pairwise(ended)), default=0.0),
        "wall": swept_by - start,
        "reading": time.monotonic() - swept_by,
        "before": before,
        "peak": at_sweep,
        "peak_reading": resident("VmHWM"),
    }


def resident(what: str) -> int:
    """Bytes of this process's memory: VmRSS now, VmHWM at most so far. Raises BadInput but on Linux."""
    try:
        lines = Path("/proc/self/status").read_text(encoding="utf-8").splitlines()
    except OSError as error:
        raise BadInput(where="memory", found="no /proc/self/status", expected="Linux") from error
    return next(1024 * int(line.split()[1]) for line in lines if line.startswith(f"{what}:"))


def main(arguments: Sequence[str]) -> int:
    """A worker, or a client; 2 where the sweep ends in an error, which is said."""
    what, folder, *more = arguments
    if what == "worker":
        from homofact.sweeps import worker

        work.do = stand_in
        sys.argv = [sys.argv[0], folder]
        return worker.main()
    try:
        labels = json.loads(Path(more[0]).read_text(encoding="utf-8"))
        print(json.dumps(swept(Path(folder), labels, more[1])))
    except BadInput as error:
        print(error, file=sys.stderr)
        return 2
    return 0


def dask_setup(worker: object) -> None:
    """What Dask calls in a worker that preloads this module."""
    work.do = stand_in


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
