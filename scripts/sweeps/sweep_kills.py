"""Kill each process of a sweep with kill -9, and fill its disk: what was repeated, and what was lost.

    python scripts/sweeps/sweep_kills.py [--tasks 24] [--short]

Real clients, workers and schedulers as processes of this machine, whose fits are stand-ins (`sweep_stand_in.py`) of .3
seconds; two workers. A process is killed when three results are there, at a task that is not done yet. A killed client
or scheduler, and a full disk, end the sweep: the same command is given again. The disk is a memory file system of its
own (Linux, `unshare`), made larger for the second command.
"""

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from homofact.errors import BadInput
from homofact.sweeps.ledger import RESULTS, SweepLedger

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import ROOT, markdown, parser_of
from scripts.sweeps import sweep_stand_in as stand_in

HEADER = ("what is killed", "fits", "done before", "of these done again", "cut short, done again", "set aside", "lost")
WORK, FIRST, PATIENCE = "sleep 0.3", 3, 600.0
T = TypeVar("T")
_SCRIPT = str(Path(stand_in.__file__).resolve())


@dataclass(frozen=True)
class Row:
    """Tasks done when the process was dead, how many of these and of the others were begun again, and the end."""

    what: str
    tasks: int
    before: int
    redone: int
    cut_short: int
    aside: int
    lost: int

    def cells(self) -> tuple[str, ...]:
        """As HEADER names them."""
        return tuple(map(str, vars(self).values()))


class Case:
    """One sweep in a folder of its own, with a log of its own."""

    def __init__(self, folder: Path, labels: Sequence[str]) -> None:
        """Nothing runs yet."""
        self.out, self.labels = folder / "sweep", list(labels)
        self.tasks = stand_in.stand_in_tasks(self.labels)
        self._labels = folder / "labels.json"
        self._labels.write_text(json.dumps(self.labels), encoding="utf-8")
        (Path(os.environ[stand_in.PLACE]) / "log").unlink(missing_ok=True)

    def command(self, where: str) -> list[str]:
        """The client's."""
        return [sys.executable, _SCRIPT, "client", str(self.out), str(self._labels), where]

    def start(self, where: str) -> "subprocess.Popen[str]":
        """A client at work."""
        return subprocess.Popen(self.command(where), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

    def done(self) -> set[int]:
        """Seeds of the tasks whose results are there."""
        ledger = SweepLedger(self.out)
        return {int(each.settings["seed"]) for each in self.tasks if ledger.is_done(each)}

    def working(self) -> int:
        """A process that is at a task, when FIRST results are there."""
        until(lambda: len(self.done()) >= FIRST)

        def at_work() -> int | None:
            last = {each.process: each for each in stand_in.logged()}
            return next((process for process, each in last.items() if not each.ended and alive(process)), None)

        return until(at_work)

    def row(self, what: str, before: set[int]) -> Row:
        """The case's figures, when it is at its end."""
        times = Counter(each.seed for each in stand_in.logged() if not each.ended)
        again = {seed for seed, count in times.items() if count > 1}
        aside = sum(each.final for each in SweepLedger(self.out).aside().values())
        lost = len(self.tasks) - len(self.done()) - aside
        return Row(what, len(self.tasks), len(before), len(again & before), len(again - before), aside, lost)


def until(found: Callable[[], T | None]) -> T:
    """What `found` returns as soon as it is true. Raises BadInput after PATIENCE seconds."""
    begun = time.monotonic()
    while not (value := found()):
        if time.monotonic() - begun > PATIENCE:
            raise BadInput(
                f"waited {PATIENCE:g} s for a process", where="kills", expected="it where it is to be killed"
            )
        time.sleep(0.01)
    return value


def alive(process: int) -> bool:
    """Whether it still runs."""
    try:
        return (Path("/proc") / str(process) / "stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


def kill(process: int) -> None:
    """-9, and wait until it is gone."""
    os.kill(process, signal.SIGKILL)
    until(lambda: not alive(process))


@contextmanager
def dask(folder: Path, nanny: bool = False) -> Iterator[tuple[str, "subprocess.Popen[bytes]"]]:
    """A scheduler (the file that it writes, its process) and two workers, of one thread each."""
    file = folder / f"scheduler-{len(list(folder.glob('scheduler-*')))}.json"
    environment = os.environ | {"PYTHONPATH": os.pathsep.join((str(ROOT), os.environ.get("PYTHONPATH", "")))}

    def start(what: str, *words: str) -> "subprocess.Popen[bytes]":
        command = [sys.executable, "-m", f"distributed.cli.dask_{what}", "--scheduler-file", str(file), *words]
        quiet = subprocess.DEVNULL
        return subprocess.Popen(command, stdout=quiet, stderr=quiet, env=environment, cwd=folder)

    scheduler = start("scheduler", "--port", "0", "--no-dashboard")
    kind = "--nanny" if nanny else "--no-nanny"
    words = ("--nthreads", "1", kind, "--preload", "sweep_stand_in")
    workers = [start("worker", *words) for _ in range(2)]
    try:
        until(file.is_file)
        yield str(file), scheduler
    finally:
        for each in (*workers, scheduler):
            each.terminate()
        for each in (*workers, scheduler):
            try:
                each.wait(10)
            except subprocess.TimeoutExpired:
                each.kill()
                each.wait()


def worker(folder: Path, labels: list[str], where: str, what: str) -> Row:
    """A worker killed at a task."""
    case = Case(folder, labels)
    client = case.start(where)
    process, before = case.working(), case.done()
    kill(process)
    ended(client)
    return case.row(what, before)


def source(folder: Path, labels: list[str], where: str, what: str) -> Row:
    """A source that kills every worker that is at it."""
    case = Case(folder, [*labels[:FIRST], "die", *labels[FIRST + 1 :]])
    ended(case.start(where))
    return case.row(what, set())


def client(folder: Path, labels: list[str], where: str, what: str) -> Row:
    """The client killed; local workers end by themselves when they have done what they are at."""
    case = Case(folder, labels)
    first = case.start(where)
    case.working()
    first.kill()
    first.communicate()
    if where.isdigit():
        workers = {each.process for each in stand_in.logged()}
        until(lambda: not any(map(alive, workers)))
    before = case.done()
    ended(case.start(where))
    return case.row(what, before)


def scheduler(folder: Path, labels: list[str], what: str) -> Row:
    """Dask's scheduler killed; then another one, with workers of its own."""
    case = Case(folder, labels)
    with dask(folder) as (where, process):
        first = case.start(where)
        case.working()
        kill(process.pid)
        ended(first, 2, "the scheduler is gone (the same command goes on)")
        before = case.done()
    with dask(folder) as (where, _):
        ended(case.start(where))
    return case.row(what, before)


def full_disk(folder: Path, labels: list[str], what: str) -> Row | None:
    """A disk that is full after some results, then larger; None where no private file system can be mounted."""
    case = Case(folder, labels)
    case.out.mkdir()
    words = " ".join(f"'{word}'" for word in case.command("2"))
    # Room for the sweep's file and for half of the results.
    result = sum(_pages(each.stat().st_size) for each in Path(os.environ[stand_in.PLACE]).glob("*.*"))
    size = _pages(2 * sum(len(json.dumps(each.record())) for each in case.tasks)) + len(labels) * result // 2
    lines = (
        f"mount -t tmpfs -o size={size} none '{case.out}' || exit 9",
        f"{words}; echo $? > '{folder}/code'; ls '{case.out}/{RESULTS}' > '{folder}/keys'",
        f"mount -o remount,size=64m '{case.out}'",
        f"{words} && cp -r '{case.out}' '{folder}/after'",
    )
    command = ["unshare", *([] if os.geteuid() == 0 else ["-r"]), "-m", "sh", "-c", "\n".join(lines)]
    try:
        ran = subprocess.run(command, capture_output=True, text=True)
    except FileNotFoundError:
        return None
    if not (folder / "code").exists():
        return None
    code, keys = ((folder / name).read_text(encoding="utf-8").split() for name in ("code", "keys"))
    if ran.returncode or code != ["2"] or "No space left on device" not in ran.stderr:
        raise BadInput(f"full disk: the client ended with {code}, then {ran.returncode}: {ran.stdout}{ran.stderr}")
    before = {int(each.settings["seed"]) for each in case.tasks if each.key in keys}
    case.out = folder / "after"
    return case.row(what, before)


def _pages(size: int) -> int:
    return -(-size // 4096) * 4096


def ended(process: "subprocess.Popen[str]", code: int = 0, said: str = "") -> None:
    """Wait for a client. Raises BadInput where it did not end with `code`, or did not say so."""
    _, error = process.communicate(timeout=600)
    if process.returncode != code or said not in error:
        raise BadInput(f"a client ended with {process.returncode}", expected=f"{code} {said}: {error}")


def killed(tasks: int, with_dask: bool = True) -> list[Row]:
    """All rows; `stand_in.prepare` was called before."""
    labels, rows = [WORK] * tasks, []
    with tempfile.TemporaryDirectory() as name:

        def place() -> Path:
            found = Path(name) / f"{len(list(Path(name).iterdir()))}"
            found.mkdir()
            return found

        rows.append(worker(place(), labels, "2", "a worker"))
        rows.append(source(place(), labels, "2", "the worker of one source, each time"))
        rows.append(client(place(), labels, "2", "the client"))
        if with_dask:
            for what, make, nanny in (
                ("a worker of Dask's", worker, False),
                ("Dask's worker of one source, each time", source, True),
                ("the client of Dask's workers", client, False),
            ):
                folder = place()
                with dask(folder, nanny) as (where, _):
                    rows.append(make(folder, labels, where, what))
            rows.append(scheduler(place(), labels, "Dask's scheduler"))
        full = full_disk(place(), labels, "nothing; the disk is full")
        rows += [full] if full is not None else []
    return rows


def main(arguments: Sequence[str] | None = None) -> int:
    """Kill and print; 1 where a result was lost, or one that was there was made again, 2 where a case went wrong."""
    parser = parser_of(__doc__)
    parser.add_argument("--tasks", type=int, default=24, help="fits of each sweep (%(default)s)")
    chosen = parser.parse_args(arguments)
    try:
        with tempfile.TemporaryDirectory() as folder:
            stand_in.prepare(Path(folder))
            rows = killed(10 if chosen.short else chosen.tasks, not chosen.short)
    except BadInput as error:
        print(error, file=sys.stderr)
        return 2
    print(markdown(HEADER, [row.cells() for row in rows]))
    return int(any(row.lost or row.redone for row in rows))


if __name__ == "__main__":
    sys.exit(main())
