"""Measure seconds and peak memory of `homofact factorize` by size, each in a process of its own.

    python scripts/speed/memory_of_sizes.py [--sources material:lafortune-blue-paint …] [--sizes 32 64 96 128]

A line a run: how it ended, seconds of the processor and of the wall, and the most memory that was resident (Linux's
ru_maxrss of the child). Real measurements are given by path.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

RUN = "import sys; from homofact.cli.entry import run; sys.exit(run())"


@dataclass(frozen=True)
class Run:
    """One command: its exit code, seconds of processor and wall, bytes of peak memory, and what it said at the end."""

    code: int
    processor: float
    wall: float
    peak: int
    said: str


def measured(arguments: list[str]) -> Run:
    """Run `homofact` with these arguments, waited for by hand: only so its own peak is known, not all children's."""
    with tempfile.TemporaryFile() as errors:
        begun = time.perf_counter()
        command = [sys.executable, "-c", RUN, *arguments]
        child = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=errors)
        _, status, used = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
        wall = time.perf_counter() - begun
        errors.seek(0)
        lines = errors.read().decode(errors="replace").split("\n")
    said = next((line.strip() for line in reversed(lines) if line.strip()), "")
    return Run(child.returncode, used.ru_utime + used.ru_stime, wall, 1024 * used.ru_maxrss, said)


def main(arguments: list[str] | None = None) -> int:
    """Print a line a source and size. Returns 1 where a run ended in a fault."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--sources", nargs="+", default=["material:lafortune-blue-paint"])
    parser.add_argument("--sizes", nargs="+", type=int, default=[32, 64, 96, 128])
    parser.add_argument("--textures", type=int, default=3)
    parser.add_argument("--more", nargs="*", default=[], help="further words of the command, such as effort=quick")
    options = parser.parse_args(arguments)
    failed = False
    for source in options.sources:
        for size in options.sizes:
            with tempfile.TemporaryDirectory() as folder:
                own = ["--textures", str(options.textures), "--size", str(size), "--out", f"{folder}/out", "--quiet"]
                more = [f"--{word.replace('=', ' ')}".split(" ", 1) for word in options.more]
                run = measured(["factorize", source, *own, *(part for parts in more for part in parts)])
            failed = failed or run.code not in (0, 2)
            print(
                f"{Path(source).name} {options.textures} x {size}²: exit {run.code}, {run.processor:.1f} s of CPU,"
                f" {run.wall:.1f} s of wall, peak {run.peak / 2**20:.0f} MB{'; ' + run.said if run.code else ''}",
                flush=True,
            )
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
