"""Fit, save, open, export and show again and again in one process: memory must stay flat.

    python scripts/checks/soak.py [--rounds 200]

Prints the process's memory after a warm-up and at the end. Wrong is growth above 30 MB from the warm-up (a fifth of the
rounds, at least five) to the end.
"""

import argparse
import gc
import sys
import tempfile
from pathlib import Path

import homofact
from homofact.containers.formats import format_named
from homofact.exporting.exported import exported, write_exported
from homofact.exporting.result import open_result, write_result
from homofact.web.page import write_view

MOST_GROWTH = 30 * 2**20


def resident() -> int:
    """Bytes of the process that are in memory now (Linux)."""
    gc.collect()
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096


def once(folder: Path, seed: int) -> None:
    """One round of everything."""
    source = homofact.read("material:lafortune-blue-paint", count=1000, seed=seed)
    fit = homofact.fit(source, homofact.McCool(size=8, seed=seed))
    write_result(folder / "out", factorization=fit.factorization, report={}, force=True)
    fitted = open_result(folder / "out")
    write_exported(folder / "engine", exported(fitted, format_named("png8")), {}, force=True)
    write_view(fitted, folder / "page.html", source)


def soak(rounds: int) -> tuple[int, int]:
    """(bytes after the warm-up, bytes at the end) of that many rounds."""
    warm = max(5, rounds // 5)
    before = 0
    with tempfile.TemporaryDirectory() as name:
        for number in range(rounds):
            once(Path(name), number)
            if number + 1 == warm:
                before = resident()
    return before, resident()


def main(arguments: list[str] | None = None) -> int:
    """Run the rounds and print both figures. Returns 1 where memory grew."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--rounds", type=int, default=200)
    options = parser.parse_args(arguments)
    before, after = soak(options.rounds)
    print(f"{options.rounds} rounds: {before / 2**20:.0f} MB after the warm-up, {after / 2**20:.0f} MB at the end")
    return 1 if after - before > MOST_GROWTH else 0


if __name__ == "__main__":
    sys.exit(main())
