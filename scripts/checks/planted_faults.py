"""Plant small faults in a copy of the package, one at a time, and list those that the nearest tests do not notice.

    python scripts/checks/planted_faults.py [--only 3 17 ...] [--area search] [--list] [--done FILE.jsonl]

The faults are in planted_faults.toml, by area and file of the package. An entry whose old text does not stand in its
file exactly once is an error. All tests run once without a fault first, since a test that fails anyway notices nothing.
Exit code 1 if more than 3 faults survive, 2 if entries are stale or tests fail without a fault.
"""

import argparse
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import ROOT, Finished, markdown, progress

TABLE = Path(__file__).with_suffix(".toml")
MOST_SURVIVORS = 3
NEEDED = ("homofact", "tests", "scripts", "configs", "data_synthetic", "pyproject.toml", "docs", "README.md")
LEFT_OUT = shutil.ignore_patterns("node_modules", "pictures", ".pytest_cache", "*.so")


@dataclass(frozen=True)
class Fault:
    """One fault: what of a file is replaced by what, and the tests that should notice."""

    number: int
    area: str
    file: str
    tests: str
    old: str
    new: str

    @property
    def key(self) -> str:
        """What identifies the fault in the file of finished ones."""
        return f"{self.file}: {self.old} -> {self.new} ({self.tests})"

    def stale(self, root: Path) -> str | None:
        """Why the entry does not fit the sources at `root`, if it does not."""
        place, tests = root / "homofact" / self.file, root / "tests" / self.tests
        if not place.is_file() or not tests.is_file():
            return f"{self.number}: no {place if not place.is_file() else tests}"
        count = place.read_text(encoding="utf-8").count(self.old)
        return None if count == 1 else f"{self.number}: {self.file}: {count} times, expected once: {self.old}"


def faults(table: Path = TABLE) -> list[Fault]:
    """The faults of a table, numbered from 1."""
    areas = tomllib.loads(table.read_text(encoding="utf-8"))
    entries = [
        (area, file, entry) for area, files in areas.items() for file, entries in files.items() for entry in entries
    ]
    return [Fault(number, area, file, **entry) for number, (area, file, entry) in enumerate(entries, 1)]


def copy(folder: Path) -> Path:
    """A copy of what the tests need; times of files are kept, so that what is compiled stays valid."""
    tree = folder / "tree"
    tree.mkdir(parents=True)
    for name in NEEDED:
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, tree / name, ignore=LEFT_OUT)
        else:
            shutil.copy2(ROOT / name, tree / name)
    return tree


def run_tests(tree: Path, tests: Iterable[str], seconds: float, *words: str) -> tuple[str, str]:
    """(passed, failed or timeout; the output's end) of test files of a tree, run by a process of its own."""
    out = tree / "pytest.out"
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *words]
    command += [f"tests/{each}" for each in tests]
    with out.open("w") as file:
        process = subprocess.Popen(
            command,
            cwd=tree,
            env={**os.environ, "PYTHONPATH": str(tree)},
            stdin=subprocess.DEVNULL,
            stdout=file,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        try:
            ended = "failed" if process.wait(seconds) else "passed"
        except subprocess.TimeoutExpired:
            ended = "timeout"
        finally:
            # Programs that the tests started end with them.
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()
    return ended, out.read_text(encoding="utf-8")[-2000:]


def planted(tree: Path, fault: Fault, seconds: float) -> str:
    """How the tests end with a fault in the tree, which is taken out again."""
    place = tree / "homofact" / fault.file
    text, times = place.read_text(encoding="utf-8"), place.stat()
    place.write_text(text.replace(fault.old, fault.new), encoding="utf-8")
    try:
        return run_tests(tree, [fault.tests], seconds, "-x")[0]
    finally:
        place.write_text(text, encoding="utf-8")
        os.utime(place, ns=(times.st_atime_ns, times.st_mtime_ns))


def survivors(every: Sequence[Fault], tree: Path, finished: Finished, seconds: float) -> list[Fault]:
    """The faults after which the nearest tests pass; raises ValueError where tests fail without a fault."""
    todo = [fault for fault in every if fault.key not in finished]
    tests = sorted({fault.tests for fault in todo if f"without a fault: {fault.tests}" not in finished})
    if tests:
        ended, output = run_tests(tree, tests, len(tests) * seconds)
        if ended != "passed":
            raise ValueError(f"the tests without a fault: {ended}\n{output}")
        for each in tests:
            finished.keep(f"without a fault: {each}", ended)
    for fault in todo:
        ended = planted(tree, fault, seconds)
        progress(fault.number, fault.area, fault.file, "SURVIVED" if ended == "passed" else ended)
        finished.keep(fault.key, ended)
    return [fault for fault in every if finished[fault.key] == "passed"]


def main(arguments: Sequence[str] | None = None) -> int:
    """Plant the faults and print the survivors; returns the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--only", type=int, nargs="+", metavar="N", help="the faults of these numbers")
    parser.add_argument("--area", help="the faults of one area, search for example")
    parser.add_argument("--list", action="store_true", help="print the faults and plant none")
    parser.add_argument("--seconds", type=float, default=300, help="that the tests of a fault may take (%(default)s)")
    parser.add_argument("--done", type=Path, help="keep what is done in this file, and leave it out the next time")
    parser.add_argument("--table", type=Path, default=TABLE, help="of the faults (%(default)s)")
    chosen = parser.parse_args(arguments)
    every = [
        fault
        for fault in faults(chosen.table)
        if chosen.only is None or fault.number in chosen.only
        if chosen.area in (None, fault.area)
    ]
    header = ("fault", "area", "file", "old text", "new text", "tests")
    rows = {f: (f.number, f.area, f.file, f"`{f.old}`", f"`{f.new}`", f.tests) for f in every}
    if chosen.list:
        print(markdown(header, rows.values(), 6))
        return 0
    if stale := [words for fault in every if (words := fault.stale(ROOT))]:
        print("\n".join(stale), file=sys.stderr)
        return 2
    os.environ |= {"OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}
    os.environ.setdefault("HOMOFACT_DATA", str(ROOT.parent / "shared" / "data"))
    with tempfile.TemporaryDirectory() as folder:
        try:
            left = survivors(every, copy(Path(folder)), Finished(chosen.done), chosen.seconds)
        except ValueError as error:
            print(error, file=sys.stderr)
            return 2
    print(f"{len(left)} of {len(every)} faults survive\n")
    if left:
        print(markdown(header, [rows[fault] for fault in left], 6))
    return 1 if len(left) > MOST_SURVIVORS else 0


if __name__ == "__main__":
    sys.exit(main())
