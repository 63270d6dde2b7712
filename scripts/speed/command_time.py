"""Measure where the seconds of a command go: start, fit, reading, judging, drawing and writing.

Every line is a process of its own, run `--repeats` times; the fastest counts, since other work on a machine can only
add. The seconds of the fit are those that its report states; the peak is of the whole process.

    python scripts/speed/command_time.py [--repeats 3] [--data FOLDER] [--out FILE.md]
"""

import json
import os
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from homofact.evaluation.machine import machine

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import data_folder, finish, markdown, parser_of

PAINTS = (("lafortune-blue-paint", 2, 16), ("vch_golden_yellow", 3, 32), ("chm_light_blue", 3, 32))
HOMOFACT = [sys.executable, "-c", "import sys; from homofact.cli.entry import run; sys.exit(run())"]


@dataclass(frozen=True)
class Run:
    """One process: seconds by the wall and of all threads, and its peak memory in MB."""

    wall: float
    cpu: float
    peak: float


def timed(command: list[str], ends: tuple[int, ...] = (0,)) -> Run:
    """Run a command to its end. Raises RuntimeError where its exit code is none of `ends`."""
    began = time.perf_counter()
    null = os.open(os.devnull, os.O_RDWR)
    process = os.posix_spawn(
        command[0], command, os.environ, file_actions=[(os.POSIX_SPAWN_DUP2, null, one) for one in (0, 1, 2)]
    )
    _, status, used = os.wait4(process, 0)
    os.close(null)
    code = os.waitstatus_to_exitcode(status)
    if code not in ends:
        raise RuntimeError(f"{' '.join(command)}: ended with {code}")
    return Run(time.perf_counter() - began, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024)


def factorized(source: str, textures: int, size: int, repeats: int) -> tuple[str, ...]:
    """A line of the table: seconds of the fit, of the command, between them, of all threads, and the peak memory."""
    found = []
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out"
        settings = ["--textures", str(textures), "--size", str(size), "--out", str(out), "--force"]
        for _ in range(repeats):
            run = timed([*HOMOFACT, "factorize", source, *settings])
            found.append((run.wall, json.loads((out / "report.json").read_text())["seconds"]["fit"], run))
    wall, fit, run = min(found, key=lambda each: each[0])
    return f"{fit:.1f}", f"{wall:.1f}", f"{wall - fit:.1f}", f"{run.cpu:.1f}", f"{run.peak:.0f}"


def main(arguments: list[str] | None = None) -> int:
    """Time the start and the fits that are asked for; print the tables, and write them where it is asked for."""
    parser = parser_of(__doc__, "data", "out")
    parser.add_argument("--repeats", type=int, default=3, help="runs of every line (%(default)s)")
    options = parser.parse_args(arguments)
    repeats, paints, folder = options.repeats, PAINTS, data_folder(options.data)
    if options.short:
        repeats, paints = 1, (("lafortune-blue-paint", 1, 4),)
    starts = {
        "`import homofact`": [sys.executable, "-c", "import homofact"],
        "`homofact --help`": [*HOMOFACT, "--help"],
        "`import torch`": [sys.executable, "-c", "import torch"],
    }
    started = [(name, f"{min(timed(command).wall for _ in range(repeats)):.2f}") for name, command in starts.items()]
    lines = []
    for name, textures, size in paints:
        file = folder / "rgl" / f"{name}_rgb.bsdf"
        source = str(file) if file.is_file() else f"material:{name}"
        if name.startswith("lafortune") or file.is_file():
            lines.append((name, f"{textures} × {size}²", *factorized(source, textures, size, repeats)))
    header = ("source", "textures", "fit, s", "command, s", "command less fit, s", "all threads, s", "peak, MB")
    tables = (markdown(("start", "seconds"), started), markdown(header, lines, 2))
    return finish(f"The fastest of {repeats} runs. {machine()}\n\n{tables[0]}\n\n{tables[1]}\n", options)


if __name__ == "__main__":
    sys.exit(main())
