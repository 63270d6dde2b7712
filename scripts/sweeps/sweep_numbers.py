"""Measure the overhead of sweeps: two workers against one, time between tasks, ten thousand tasks, and kills.

    python scripts/sweeps/sweep_numbers.py [--what workers overhead tiny kills] [--out FILE.md] [--short]

- workers: fits of named materials by one worker and by two, each of one thread, in folders of their own; the same tasks
  in every run, one worker first in the first round and last in the next. A run is from reading the sweep to its last
  result, so the start of the workers is in it.
- overhead: tasks that do nothing for `--seconds`, on two local workers and on two of a Dask scheduler's. Of the time
  from a worker's first task to the end of its last, what it was not at one of them: handing out, reading and writing
  the ledger, and with Dask packing and sending results.
- tiny: 1,000, 5,000 and `--tasks` tasks of no time at all, whose results are written, judged whole and summed up as
  those of fits are. Memory is the client's.
- kills: `sweep_kills.py`.

Fits of the last three are stand-ins (`sweep_stand_in.py`); processes, ledger and results are real.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from statistics import median
from typing import Any

from homofact.errors import BadInput
from homofact.evaluation.machine import machine
from homofact.sweeps.local import Local
from homofact.sweeps.run import sweep
from homofact.sweeps.sweep_file import read_sweep

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import figure, markdown, parser_of, print_measured, progress
from scripts.sweeps import sweep_stand_in as stand_in
from scripts.sweeps.sweep_kills import HEADER, Case, dask, killed

PARTS = ("workers", "overhead", "tiny", "kills")
FITS = """
sources = ["material:{pattern}"]
bytes = [3276]
[source]
count = {count}
[[method]]
method = "search"
effort = {effort}
[[method]]
method = "mccool"
"""
_MB = 2**20


def two_against_one(folder: Path, short: bool) -> str:
    """Wall times of one worker and of two, round by round, and their ratio."""
    file = folder / "sweep.toml"
    chosen = ("phong-1*", 400, 20) if short else ("*", 8000, '"quick"')
    file.write_text(FITS.format(**dict(zip(("pattern", "count", "effort"), chosen, strict=True))), encoding="utf-8")
    rows, ratios, fits = [], [], 0
    for number in range(1 if short else 2):
        seconds: dict[int, float] = {}
        for workers in (1, 2) if number % 2 == 0 else (2, 1):
            place = folder / f"workers-{number}-{workers}"
            begun = time.monotonic()
            state = sweep(read_sweep(file), place, Local(place, workers), lambda *_: None)
            seconds[workers] = time.monotonic() - begun
            fits = len(state.tasks)
            if state.done != fits:
                raise BadInput(f"{state.done} of {fits} fits were done", where="workers", expected="all")
        ratios.append(seconds[1] / seconds[2])
        rows.append((number + 1, figure(seconds[1]), figure(seconds[2]), figure(ratios[-1])))
    table = markdown(("round", "one worker, s", "two workers, s", "ratio"), rows)
    return f"{table}\n\nTwo workers are {figure(median(ratios))} times one: {fits} fits, median of the rounds."


def between_tasks() -> tuple[float, float]:
    """(share of their time that workers were not at a task, its longest stretch in seconds), by the log."""
    gaps, spans = [], 0.0
    for process in {each.process for each in stand_in.logged()}:
        times = [each.time for each in stand_in.logged() if each.process == process]
        spans += times[-1] - times[0]
        gaps += [later - earlier for earlier, later in zip(times[1::2], times[2::2], strict=False)]
    return (sum(gaps) / spans, max(gaps)) if gaps else (0.0, 0.0)


def overhead(folder: Path, seconds: float, tasks: int) -> str:
    """A row for local workers and one for Dask's."""
    rows = []
    for words in ("local", "Dask"):
        place = folder / f"overhead-{words}"
        place.mkdir()
        case = Case(place, [f"sleep {seconds}"] * tasks)
        if words == "local":
            found = _client(case, "2")
        else:
            with dask(place) as (where, _):
                found = _client(case, where)
        share, longest = between_tasks()
        start = found["first"] - seconds
        rows.append((words, tasks, f"{100 * share:.2g}%", f"{1000 * longest:.0f}", figure(start)))
    header = ("two workers", f"tasks of {seconds:g} s", "between tasks", "longest, ms", "until the first task, s")
    return markdown(header, rows)


def tiny(folder: Path, counts: Sequence[int]) -> str:
    """A row for each number of tasks."""
    rows = []
    for count in counts:
        place = folder / f"tiny-{count}"
        place.mkdir()
        case = Case(place, [""] * count)
        found = _client(case, "2")
        again = _client(case, "2")
        each = 1000 * (found["last"] - found["first"]) / (count - 1)
        rows.append(
            (
                f"{count:,}", figure(found["wall"]), figure(found["begin"]), figure(each), f"{1000 * found['gap']:.0f}",
                figure(found["reading"]), figure(again["wall"]),
                f"{found['before'] / _MB:.0f}", f"{found['peak'] / _MB:.0f}", f"{found['peak_reading'] / _MB:.0f}",
            )
        )  # fmt: skip
        if found["rows"] != count:
            raise BadInput(where="tiny", found=f"{found['rows']} results", expected=count)
    header = (
        "tasks", "wall, s", "until it begins, s", "each, ms", "longest without progress, ms", "summing up, s",
        "nothing left to do, s", "memory before, MB", "sweeping, MB", "summed up, MB",
    )  # fmt: skip
    return markdown(header, rows, 0)


def _client(case: Case, where: str) -> dict[str, Any]:
    """A client's figures (`stand_in.swept`). Raises BadInput where it ended in an error."""
    ran = subprocess.run(case.command(where), capture_output=True, text=True)
    if ran.returncode:
        raise BadInput(f"the client ended with {ran.returncode}: {ran.stderr.strip()}")
    return json.loads(ran.stdout)


def measured(chosen: Any) -> str:
    """The text, each part told when it is there. Raises BadInput where a sweep does not end as it should."""
    # One thread each, whatever the machine has: two workers are to be told from one.
    os.environ |= {"OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}
    parts: list[str] = ["# A sweep beside its fits", "", f"- {machine()}"]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        stand_in.prepare(folder / "stand-in")
        for what in chosen.what:
            if what == "workers":
                table = two_against_one(folder, chosen.short)
            elif what == "overhead":
                table = overhead(folder, *((0.2, 6) if chosen.short else (chosen.seconds, 12)))
            elif what == "tiny":
                counts = (20, 40) if chosen.short else sorted({1000, 5000, chosen.tasks})
                table = tiny(folder, counts)
            else:
                rows = killed(8 if chosen.short else 24, not chosen.short)
                table = markdown(HEADER, [row.cells() for row in rows])
            parts += ["", f"## {what.capitalize()}", "", table]
            # A part takes minutes, and a later one may go wrong.
            progress("\n".join(parts[-3:]))
    return "\n".join([*parts, ""])


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and print; 2 where a sweep does not end as it should."""
    parser = parser_of(__doc__)
    parser.add_argument("--what", nargs="+", choices=PARTS, default=PARTS, help="parts to measure (all)")
    parser.add_argument("--seconds", type=float, default=10.0, help="a task's, for the overhead (%(default)s)")
    parser.add_argument("--tasks", type=int, default=10_000, help="tiny tasks at most (%(default)s)")
    return print_measured(parser, arguments, measured)


if __name__ == "__main__":
    sys.exit(main())
