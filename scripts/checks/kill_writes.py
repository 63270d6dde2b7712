"""Kill a write at every system call: the old or the new file must be whole, and the next run must work.

    python scripts/checks/kill_writes.py [--every 1] [--what file folder "two renames"]

Under strace a process writes over something older and is killed when it makes its first, second … system call that
touches a file, until one run ends by itself. After each kill, before anything else is done, the place is looked at: a
file or a folder there is the older one or the new one, every file in it whole, and a stranger's file in the folder is
not lost. Then the next run writes: its result stands, the stranger's file is in it, and no litter is left. "two
renames" is a folder on a system that cannot exchange two names; there alone the place may be empty until the next one
who opens it has put the older one back.
"""

import argparse
import re
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from homofact.files.archive import saved_file
from homofact.files.atomic import write_text
from homofact.files.folder import write_folder
from homofact.files.kinds import RESULT

CALLS = (
    "open,openat,mkdir,rename,renameat,renameat2,link,linkat,unlink,unlinkat,rmdir,write,fsync,flock,ftruncate,chmod,"
    "fchmod,fchmodat,close,getdents64"
)
MARK = "/homofact-kill-writes-begins"
OLD, NEW = "old " * 3000, "new " * 3000
STRANGER = "thesis.tex"
_CHILD = f"""
import sys
from pathlib import Path
sys.path.insert(0, {str(Path(__file__).resolve().parents[2])!r})
from scripts.checks import kill_writes
if sys.argv[2] == "two renames":
    from homofact.files import folder
    folder.exchange = lambda *_: False
# So that the first write has nothing to load.
kill_writes.write(sys.argv[2], Path(sys.argv[1]) / "warm", "x")
try:
    open({MARK!r})
except OSError:
    pass
kill_writes.write(sys.argv[2], Path(sys.argv[1]) / "here", kill_writes.NEW)
"""


@dataclass(frozen=True)
class Table:
    """What became of the kills of one kind of write."""

    what: str
    kills: int
    older: int
    newer: int
    empty: int
    wrong: tuple[str, ...]

    def line(self) -> str:
        """For people."""
        return (
            f"{self.what:12} {self.kills:4} kills: {self.older} left the older, {self.newer} the new one,"
            f" {self.empty} nothing until the next open; wrong {len(self.wrong)}"
        )


def write(what: str, place: Path, text: str) -> None:
    """What the killed process does, and the next one after it."""
    place.mkdir(exist_ok=True)
    if what == "file":
        write_text(place / "a.txt", text)
        return

    def fill(made: Path) -> None:
        for name in (RESULT.mark, "manifest.json", "texture_0.exr"):
            write_text(made / name, text)

    write_folder(place / "out", RESULT, fill, force=True)


def found(what: str, place: Path) -> str:
    """OLD, NEW or nothing: what is at the place, whole; raises AssertionError where it is none of these."""
    if what == "file":
        text = (place / "a.txt").read_text()
        assert text in (OLD, NEW), f"a file of {len(text)} letters"
        return text
    if not (place / "out").exists():
        return ""
    names = {each.name for each in (place / "out").iterdir()} - {STRANGER}
    assert names == {RESULT.mark, "manifest.json", "texture_0.exr"}, f"files {sorted(names)}"
    texts = {(place / "out" / name).read_text() for name in names}
    assert len(texts) == 1, "files of two results"
    assert texts <= {OLD, NEW}, "a file that is not whole"
    return texts.pop()


def strangers(place: Path) -> list[Path]:
    """Where a file that is not homofact's is now."""
    return list(place.rglob(STRANGER))


def check(what: str, place: Path) -> str:
    """What a kill left, after which the next run writes; "" where the place was empty. Raises AssertionError."""
    left = found(what, place)
    if what != "file":
        assert len(strangers(place)) == 1, "a stranger's file is lost"
    if what == "two renames" and not left:
        saved_file(place / "out")
        assert found(what, place), "the older one is not put back"
    else:
        assert left, "nothing is there"
    write(what, place, NEW)
    assert found(what, place) == NEW, "the next run's result does not stand"
    names = sorted(each.name for each in place.iterdir())
    assert names == (["a.txt"] if what == "file" else ["out"]), f"litter {names}"
    if what != "file":
        assert strangers(place) == [place / "out" / STRANGER], "a stranger's file is not in its folder"
    return left


def traced(folder: Path, what: str, *options: str) -> int:
    """Run the writing process under strace over an older result; its exit status."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    write(what, folder / "here", OLD)
    if what != "file":
        (folder / "here" / "out" / STRANGER).write_text("years of work")
    command = ["strace", "-f", "-qq", "-o", str(folder / "log"), "-e", f"trace={CALLS}", *options]
    ran = subprocess.run([*command, sys.executable, "-c", _CHILD, str(folder), what], capture_output=True)
    return ran.returncode


def calls_after_mark(log: Path) -> list[tuple[str, int]]:
    """The calls of the write in their order: each by its name and its number among those of that name."""
    names = re.findall(r"^\d+ +(\w+)\((.*)$", log.read_text(errors="replace"), re.MULTILINE)
    begin = next(k for k, (_, rest) in enumerate(names) if MARK in rest)
    before = Counter(name for name, _ in names[: begin + 1])
    found = []
    for name, _ in names[begin + 1 :]:
        before[name] += 1
        found.append((name, before[name]))
    return found


def kill_everywhere(what: str, every: int = 1, say: Callable[[str], object] = lambda line: None) -> Table:
    """Kill a write at every (or every n-th) call, from its first to its last."""
    counts, wrong = {OLD: 0, NEW: 0, "": 0}, []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "place"
        traced(folder, what)
        calls = calls_after_mark(folder / "log")
        for call, number in calls[::every]:
            traced(folder, what, "-e", f"inject={call}:signal=KILL:when={number}")
            try:
                counts[check(what, folder / "here")] += 1
            except (AssertionError, OSError) as error:
                wrong.append(f"{call} number {number}: {error}")
                say(wrong[-1])
    return Table(what, len(calls[::every]), counts[OLD], counts[NEW], counts[""], tuple(wrong))


def main(arguments: list[str] | None = None) -> int:
    """Run the kills and print a line a kind of write. Returns 1 where anything was wrong."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--every", type=int, default=1, help="only every n-th call")
    parser.add_argument("--what", nargs="*", default=["file", "folder", "two renames"])
    options = parser.parse_args(arguments)
    tables = []
    for what in options.what:
        tables.append(kill_everywhere(what, options.every, lambda line: print(f"  {line}", flush=True)))
        print(tables[-1].line(), flush=True)
    return 1 if any(table.wrong for table in tables) else 0


if __name__ == "__main__":
    sys.exit(main())
