"""Fit the published networks of the MERL materials by three methods at three sizes, in one sweep.

Never MERL itself: the networks (Sztrajman et al. 2021) are fits. Each is drawn at COUNT pairs; errors are of the fifth
that is held out. The sweep is an ordinary one of `homofact sweep`, in FOLDER, and goes on where it was left; wall time
is that of the last run, said with the number of fits that it made.

    python scripts/sweeps/sweep_surrogates.py FOLDER [--count 20000] [--workers 2] [--materials *] [--restarts 6]
        [--methods ours,cole,mccool] [--bytes 3276,12288,49152]
"""

import json
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from statistics import median
from typing import Any

from homofact.errors import BadInput
from homofact.evaluation.machine import machine
from homofact.evaluation.metric_table import METRICS
from homofact.sweeps.summary import FitRow, by_label, rows_of

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import data_folder, figure, listed, markdown, parser_of, print_measured, write

SIZES = (3276, 12288, 49152)
SWEEP = """name = "surrogates"
sources = [{sources}]
bytes = {sizes}

[source]
count = {count}
"""
METHODS = {
    "ours": 'method = "search"\nlabel = "ours"\neffort = "quick"',
    "cole": 'method = "cole"\nrestarts = {restarts}\nsearch_size = {search_size}',
    "mccool": 'method = "mccool"',
}
COLUMNS = ("log_mse", "mae", "albedo_worst", "energy_overall", "highlight", "psnr_sky")


def sweep_of(
    source: str, sizes: Sequence[int], count: int, restarts: int, search_size: int, methods: Sequence[str]
) -> str:
    """The sweep's file."""
    head = SWEEP.format(sources=json.dumps(source), sizes=list(sizes), count=count)
    tables = [METHODS[name].format(restarts=restarts, search_size=search_size) for name in methods]
    return head + "".join(f"\n[[method]]\n{table}\n" for table in tables)


def worse_tenth(rows: Sequence[FitRow], name: str) -> tuple[float, float]:
    """(median, what a tenth of the rows is worse than) of a metric; of ratios by their distance from 1."""
    metric = METRICS[name]
    values = sorted((value for row in rows if (value := row.metrics[name]) is not None), key=metric.badness)
    return median(values), values[min(int(0.9 * len(values)), len(values) - 1)]


def table(rows: Sequence[FitRow]) -> str:
    """A line a method and size, median and in brackets the worst tenth's best."""
    lines = []
    for label, some in by_label(rows).items():
        both = [worse_tenth(some, name) for name in COLUMNS]
        cells = [f"{figure(middle)} ({figure(worse)})" for middle, worse in both]
        seconds = figure(median(row.seconds for row in some))
        trusted = f"{sum(row.trusted for row in some)}"
        lines.append((label, len(some), figure(median(row.bytes for row in some)), trusted, seconds, *cells))
    words = [METRICS[name].words for name in COLUMNS]
    return markdown(("", "fits", "bytes", "trusted", "fit, s", *words), lines)


def main(arguments: Sequence[str] | None = None) -> int:
    """Sweep and print; 2 where something is missing."""
    parser = parser_of(__doc__, "data")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--count", type=int, default=20_000, help="pairs of a material (%(default)s)")
    parser.add_argument("--restarts", type=int, default=6, help="random starts of a search of Cole's (%(default)s)")
    parser.add_argument("--workers", type=int, default=2, help="processes (%(default)s)")
    parser.add_argument("--materials", default="*", help="pattern of names (%(default)s)")
    parser.add_argument("--methods", help=f"some of {', '.join(METHODS)} (all)")
    parser.add_argument("--bytes", default=",".join(map(str, SIZES)), help="of each fit (%(default)s)")
    return print_measured(parser, arguments, measured)


def measured(chosen: Any) -> str:
    """The text. Raises BadInput where the sweep is refused."""
    file = data_folder(chosen.data).resolve() / "nbrdf" / "merl_nbrdf_weights.npz"
    source = "material:lafortune-clay" if chosen.short else f"{file}#{chosen.materials}"
    sizes = [int(each) for each in chosen.bytes.split(",")]
    sizes, count = (sizes[:1], 600) if chosen.short else (sizes, chosen.count)
    methods = listed(chosen.methods, tuple(METHODS), "--methods")
    asked = chosen.folder / "surrogates.toml"
    write(asked, sweep_of(source, sizes, count, chosen.restarts, 6 if chosen.short else 12, methods))
    command = [sys.executable, "-m", "homofact.cli.main", "sweep", str(asked), "--out", str(chosen.folder / "sweep")]
    begun = time.perf_counter()
    ended = subprocess.run(
        [*command, "--workers", str(chosen.workers), "--json"], stdout=subprocess.PIPE, text=True, check=False
    )
    wall = time.perf_counter() - begun
    if ended.returncode:
        raise BadInput(f"ended with {ended.returncode}", where=" ".join(command), expected="0")
    said = json.loads(ended.stdout)
    rows = rows_of(chosen.folder / "sweep")
    fitting = sum(row.seconds for row in rows)
    lines = [
        f"{len(rows)} fits of {len({row.source for row in rows})} materials, {count} pairs each,"
        f" {chosen.restarts} starts of Cole's searches; {chosen.workers} workers made"
        f" {said['done']} of them in {figure(wall)} s,"
        f" {len(said['set_aside'])} set aside. Fits alone are {figure(fitting)} s of all; the rest is metrics, pictures"
        f" and the verdict. {machine()}",
        "",
        *(["A smoke test: the figures mean nothing.", ""] if chosen.short else []),
        table(rows),
        "",
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
