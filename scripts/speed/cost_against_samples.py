"""Measure the cost by number of samples, from 3k to 1.1M: seconds of the search, and memory beyond the samples.

    python scripts/speed/cost_against_samples.py [--counts 3000 10000 …] [--plot FILE.png] [--short]

Two reciprocal searched half-diff textures at a random start, all channels. An inner evaluation of the search is one
accumulation, one Cholesky factorization and one pass for the gradient; a whole search prepares the coordinates, makes
a fixed number of evaluations (L-BFGS of nlopt, which can be told how many), and ends with the masked solve. The
exponent is the slope of log seconds against log N by least squares over all counts; since the factorization costs the
same for any N, the slope over the upper half of the counts stands beside it.

Each count has a process of its own, for its peak memory. "Samples" is what is there before: directions, logarithms
and weights, in float64. "Prepared" is what the inner problem holds beside them, the coordinates that each projection
acts on; "evaluation" is the rise of the peak over that during evaluations, and "search" the rise of the peak over the
samples in a whole search. Resident memory is counted in pages, so small figures are rough.
"""

import argparse
import json
import math
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from homofact.evaluation.machine import machine
from homofact.files.atomic import replace_file

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import figure, finish, markdown, parser_of
from scripts.speed.cost_of_evaluation import EPSILON, MATERIAL, MIB, forget_peak, load, resident

COUNTS = (3_000, 10_000, 30_000, 100_000, 300_000, 1_100_000)
TARGET = 1.05
# Freed arrays go back to the system at once, or what is held would hide behind what was.
ENVIRONMENT = {"MALLOC_MMAP_THRESHOLD_": "65536", "MALLOC_TRIM_THRESHOLD_": "65536"}


def cost(job: argparse.Namespace) -> dict[str, Any]:
    """Seconds of evaluations and of a whole search, and bytes of memory, at one number of samples."""
    import numba
    import torch

    from homofact.factor.objective import Objective
    from homofact.factor.projection import Projection
    from homofact.factor.search.minimize import minimize
    from homofact.factor.search.nlopt import Nlopt
    from homofact.factor.textures import LogSamples, solve_terms
    from homofact.geometry.rotation import Rotation
    from homofact.methods.cole import Cole
    from homofact.methods.common import transform_of

    torch.set_num_threads(1)
    settings = Cole(epsilon=EPSILON)
    shapes = ((job.size, job.size),) * 2
    generator = torch.Generator().manual_seed(job.seed)
    pair = tuple(Projection.from_rotation("half-diff", Rotation.random(generator), True) for _ in range(2))
    search = Nlopt("LD_LBFGS", evaluations=job.evaluations, tolerance=0.0)

    def prepared(count: int) -> LogSamples:
        samples = load(3, count, job.seed)
        return LogSamples.of(samples, transform_of(samples, settings))

    def whole(data: LogSamples) -> int:
        objective = Objective(data, pair, shapes, settings.smoothing)
        vector, report = minimize(search, objective, objective.start(), seed=job.seed)
        solve_terms(data, objective.projections(vector), shapes, settings.smoothing, settings.solver)
        return report.evaluations

    whole(prepared(500))
    data = prepared(job.samples)
    held = sum(tensor.numel() * tensor.element_size() for tensor in (data.wi, data.wo, data.logs, data.weights))

    before = resident(peak=False)
    objective = Objective(data, pair, shapes, settings.smoothing)
    ready = resident(peak=False)
    forget_peak()
    vector = objective.start()
    evaluations = []
    for _ in range(job.repeats + 1):
        began = time.perf_counter()
        objective.evaluate(vector)
        evaluations.append(time.perf_counter() - began)
    evaluating = resident(peak=True) - ready
    del objective
    before_search = resident(peak=False)
    forget_peak()
    searches, made = [], 0
    for _ in range(job.runs):
        began = time.perf_counter()
        made = whole(data)
        searches.append(time.perf_counter() - began)
    return {
        "evaluation": evaluations[1:],
        "search": searches,
        "made": made,
        "samples_bytes": held,
        "prepared_bytes": ready - before,
        "evaluation_bytes": evaluating,
        "search_bytes": resident(peak=True) - before_search,
        "threads": numba.get_num_threads(),
    }


def fresh(chosen: argparse.Namespace, samples: int) -> dict[str, Any]:
    """`cost` in a process of its own."""
    command = [sys.executable, __file__, "--job", str(samples)]
    for name in ("size", "repeats", "runs", "evaluations", "seed"):
        command += [f"--{name}", str(getattr(chosen, name))]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=os.environ | ENVIRONMENT)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command[1:])} ended with {done.returncode}: {done.stderr.strip()[-500:]}")
    return json.loads(done.stdout)


def slope(x: Sequence[float], y: Sequence[float]) -> float:
    """The slope of y against x by least squares."""
    mean_x, mean_y = statistics.mean(x), statistics.mean(y)
    return sum((a - mean_x) * (b - mean_y) for a, b in zip(x, y, strict=True)) / sum((a - mean_x) ** 2 for a in x)


def exponent(counts: Sequence[int], seconds: Sequence[float]) -> float:
    """p of seconds ∝ N^p, by regression of the logarithms."""
    return slope([math.log(count) for count in counts], [math.log(value) for value in seconds])


def draw(path: Path, counts: Sequence[int], found: Sequence[dict[str, Any]], evaluations: int) -> None:
    """Two panels over N: seconds, and MiB beyond the samples."""
    from matplotlib.figure import Figure

    picture = Figure(figsize=(10, 4.2), layout="constrained")
    left, right = picture.subplots(1, 2)
    for key, label, colour in (
        ("search", f"whole search, {evaluations} evaluations", "#1f4e79"),
        ("evaluation", "one evaluation with gradient", "#c0561f"),
    ):
        medians = [statistics.median(each[key]) for each in found]
        left.plot(counts, medians, "o-", color=colour, label=f"{label}: N^{exponent(counts, medians):.2f}")
        left.fill_between(
            counts, [min(each[key]) for each in found], [max(each[key]) for each in found], color=colour, alpha=0.2
        )
        straight = [medians[-1] * count / counts[-1] for count in counts]
        left.plot(counts, straight, ":", color="#808080", label="N^1" if key == "evaluation" else None)
    left.set_ylabel("seconds (median; band: range)")
    for key, label, colour in (
        ("samples_bytes", "the samples themselves", "#808080"),
        ("search_bytes", "peak of a whole search beyond them", "#1f4e79"),
        ("prepared_bytes", "held: prepared coordinates", "#2e7d32"),
        ("evaluation_bytes", "peak of evaluations beyond both", "#c0561f"),
    ):
        right.plot(counts, [max(each[key], 4096) / MIB for each in found], "o-", color=colour, label=label)
    right.set_ylabel("MiB")
    for axis in (left, right):
        axis.set_xscale("log")
        axis.set_yscale("log")
        axis.set_xlabel("samples N")
        axis.legend(frameon=False, fontsize=8)
        axis.spines[["top", "right"]].set_visible(False)
    replace_file(path, lambda made: picture.savefig(made, dpi=110))


def main(arguments: list[str] | None = None) -> int:
    """Print (and with --out write) the tables, draw the figure where asked; returns the exit code."""
    parser = parser_of(__doc__, "out")
    parser.add_argument("--counts", type=int, nargs="+", default=list(COUNTS))
    parser.add_argument("--size", type=int, default=16)
    parser.add_argument("--repeats", type=int, default=9, help="evaluations, of which the median counts")
    parser.add_argument("--runs", type=int, default=3, help="whole searches, of which the median counts")
    parser.add_argument("--evaluations", type=int, default=20, help="of a whole search")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--plot", type=Path, help="a PNG to draw")
    parser.add_argument("--job", type=int, dest="samples", help=argparse.SUPPRESS)  # what a fresh process is told
    chosen = parser.parse_args(arguments)
    if chosen.samples is not None:
        print(json.dumps(cost(chosen)))
        return 0
    if chosen.short:
        chosen.counts, chosen.size, chosen.repeats = [2_000, 100_000], 6, 3
        chosen.runs, chosen.evaluations = 1, 3
    begin_load = os.getloadavg()[0]
    found = []
    for count in chosen.counts:
        found.append(fresh(chosen, count))
        print(f"{count} samples: {figure(statistics.median(found[-1]['search']))} s a search", file=sys.stderr)
    seconds_rows, memory_rows = [], []
    for count, each in zip(chosen.counts, found, strict=True):
        evaluation, search = each["evaluation"], each["search"]
        seconds_rows.append(
            (
                count,
                figure(1000 * statistics.median(evaluation)),
                f"{figure(1000 * min(evaluation))} – {figure(1000 * max(evaluation))}",
                figure(statistics.median(search)),
                f"{figure(min(search))} – {figure(max(search))}",
                each["made"],
            )
        )
        names = ("samples_bytes", "prepared_bytes", "evaluation_bytes", "search_bytes")
        memory_rows.append((count, *(f"{each[name] / MIB:.1f}" for name in names)))
    half = len(chosen.counts) // 2
    verdicts = []
    for key, words in (("evaluation", "evaluation with gradient"), ("search", "whole search")):
        for statistic, which in ((statistics.median, "median"), (min, "least")):
            values = [statistic(each[key]) for each in found]
            upper = f"{exponent(chosen.counts[half:], values[half:]):.3f}" if len(values) - half > 1 else "—"
            verdicts.append((f"{words}, {which}", f"at most {TARGET}", f"{exponent(chosen.counts, values):.3f}", upper))
    growth = [
        (words, f"{slope(chosen.counts, [each[name] for each in found]):.1f}")
        for name, words in (
            ("samples_bytes", "the samples themselves"),
            ("prepared_bytes", "prepared coordinates, held by the search"),
            ("evaluation_bytes", "evaluations, peak beyond both"),
            ("search_bytes", "whole search, peak beyond the samples"),
        )
    ]
    text = "\n".join(
        [
            "# Cost against the number of samples",
            "",
            f"- {MATERIAL}, RGB, pairs uniform in the parabolic discs, seed {chosen.seed}; two reciprocal searched"
            f" half-diff textures of {chosen.size}², ε = {EPSILON:g}; float64",
            f"- {chosen.repeats} evaluations and {chosen.runs} searches a count, each count in a process of its own;"
            f" one torch thread, {found[0]['threads']} in the compiled passes; compilation not counted",
            f"- {machine()}; load average {begin_load:.1f} at the start, {os.getloadavg()[0]:.1f} at the end",
            "",
            markdown(("samples", "ms an evaluation", "range ms", "s a search", "range s", "evaluations"), seconds_rows),
            "",
            markdown(("exponent of N", "target", "all counts", f"from {chosen.counts[half]} up"), verdicts),
            "",
            markdown(("samples", "samples MiB", "prepared MiB", "evaluation MiB", "search MiB"), memory_rows),
            "",
            markdown(("memory", "bytes a sample"), growth),
            "",
        ]
    )
    finish(text, chosen)
    if chosen.plot is not None:
        chosen.plot.parent.mkdir(parents=True, exist_ok=True)
        draw(chosen.plot, chosen.counts, found, chosen.evaluations)
    return 0


if __name__ == "__main__":
    sys.exit(main())
