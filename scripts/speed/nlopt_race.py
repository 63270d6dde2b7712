"""Race the optimizers of the search: which reaches a given error first on ten problems.

    python scripts/speed/nlopt_race.py [--seconds 6] [--within 0.05 0.25] [--short]

A problem is a material, a mix of searched kinds and a seed, which draws samples and start. Every search gets a fresh
objective at the same start and the same time, with its own tolerances set to zero, so that it goes on until it can
not or the time is up. The goal is the lowest objective R that any of them found, times 1 + `within`; the trace of
each report says when it first got there, in seconds and in evaluations (with gradient for gradient, LD_ and MLSL).
This is the time to reach, not the time to stop. "—" is a search that never did.
"""

import math
import os
import statistics
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numba
import torch

from homofact.brdf.materials import material
from homofact.brdf.sampling import sample_model
from homofact.errors import Report
from homofact.evaluation.machine import machine
from homofact.factor.objective import Objective
from homofact.factor.search.gradient import Gradient
from homofact.factor.search.minimize import Minimizer, minimize
from homofact.factor.search.nlopt import Nlopt
from homofact.factor.search.one_at_a_time import OneAtATime
from homofact.factor.search.powell import Powell
from homofact.factor.textures import LogSamples
from homofact.linear.threads import one_thread
from homofact.methods.cole import Cole
from homofact.methods.common import transform_of
from homofact.methods.kinds import make

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import figure, finish, markdown, parser_of

SETTINGS = Cole(epsilon=1e-5)
MANY = 1_000_000
SEARCHES: tuple[Minimizer, ...] = (
    Gradient(iterations=MANY, tolerance=0.0),
    OneAtATime(Powell(tolerance=0.0), rounds=MANY, tolerance=0.0),
    *(
        Nlopt(name, evaluations=MANY, tolerance=0.0)
        for name in ("PRAXIS", "SBPLX", "BOBYQA", "COBYLA", "LD_LBFGS", "LD_SLSQP", "MLSL")
    ),
)


@dataclass(frozen=True)
class Problem:
    """A material's green channel, the searched kind of every texture, and the seed of samples and start."""

    material: str
    kinds: tuple[str, ...]
    seed: int

    @property
    def name(self) -> str:
        """As it stands in the table."""
        return f"{self.material}: {' · '.join(self.kinds)}, seed {self.seed}"

    def objective(self, count: int, size: int) -> Objective:
        """The objective at the problem's start."""
        samples = sample_model(material(self.material).model, count, "discs", self.seed).channel("G")
        data = LogSamples.of(samples, transform_of(samples, SETTINGS))
        generator = torch.Generator().manual_seed(self.seed)
        projections = tuple(make(kind, True, None, generator, SETTINGS.bound) for kind in self.kinds)
        return Objective(data, projections, ((size, size),) * len(self.kinds), SETTINGS.smoothing)


PROBLEMS = (
    Problem("lafortune-blue-paint", ("half-diff", "half-diff"), 0),
    Problem("lafortune-blue-paint", ("in-out", "in-out"), 1),
    Problem("lafortune-blue-paint", ("isotropic-half-diff", "isotropic-half-diff"), 2),
    Problem("lafortune-clay", ("half-diff", "in-out"), 3),
    Problem("lafortune-skin", ("half-diff",), 4),
    Problem("cook-torrance-plastic", ("half-diff", "half-diff"), 5),
    Problem("cook-torrance-plastic", ("isotropic-half-diff", "isotropic-in-out"), 6),
    Problem("ward-brushed", ("half-diff", "isotropic-half-diff"), 7),
    Problem("ward-brushed", ("half-diff", "half-diff", "half-diff"), 8),
    Problem("ashikhmin-shirley-wang", ("half-diff", "in-out", "isotropic-in-out"), 9),
)


@one_thread
def race(problem: Problem, count: int, size: int, seconds: float) -> dict[str, Report]:
    """The report of every search on one problem."""
    objective = problem.objective(count, size)
    start = objective.start()
    objective.evaluate(start)
    return {
        search.name: minimize(search, objective, start, seconds=seconds, seed=problem.seed)[1] for search in SEARCHES
    }


def reached(report: Report, goal: float) -> tuple[float, float]:
    """(seconds, evaluations) to the first value of the trace at or under `goal`; infinite where there is none."""
    return next(((when, count) for when, count, value in report.trace if value <= goal), (math.inf, math.inf))


def shown(value: float) -> str:
    """A figure, or a dash for never."""
    return "—" if math.isinf(value) else figure(value)


def summary(found: Sequence[dict[str, Report]], within: float) -> str:
    """A row for each search: how often it arrived, how often first, medians over all problems, of the values too."""
    lowest = [min(report.residual for report in reports.values()) for reports in found]
    rows = []
    times = [
        {name: reached(report, low * (1 + within)) for name, report in reports.items()}
        for reports, low in zip(found, lowest, strict=True)
    ]
    for search in SEARCHES:
        own = [each[search.name] for each in times]
        wins = sum(each[search.name][0] == min(other[0] for other in each.values()) for each in times)
        ends = statistics.median(
            reports[search.name].residual / low for reports, low in zip(found, lowest, strict=True)
        )
        rate = statistics.median(reports[search.name].evaluations / reports[search.name].seconds for reports in found)
        rows.append(
            (
                search.name,
                wins,
                sum(math.isfinite(seconds) for seconds, _ in own),
                shown(statistics.median(seconds for seconds, _ in own)),
                shown(statistics.median(evaluations for _, evaluations in own)),
                figure(ends),
                figure(rate),
            )
        )
    heads = ("first", "reached", "median s", "median evaluations", "median end / lowest", "evaluations a second")
    return markdown(("search", *heads), rows)


def main(arguments: list[str] | None = None) -> int:
    """Print (and with --out write) the tables; returns the exit code."""
    parser = parser_of(__doc__, "out")
    parser.add_argument("--seconds", type=float, default=6.0, help="of every search on every problem")
    parser.add_argument("--within", type=float, nargs="+", default=[0.05, 0.25], help="goals above the lowest value")
    parser.add_argument("--samples", type=int, default=8000)
    parser.add_argument("--size", type=int, default=12)
    chosen = parser.parse_args(arguments)
    problems = PROBLEMS
    if chosen.short:
        chosen.samples, chosen.size, chosen.seconds, problems = 500, 5, 0.15, PROBLEMS[:2]
    load = os.getloadavg()[0]
    race(PROBLEMS[0], 300, 4, 0.1)  # compile
    found = []
    for problem in problems:
        found.append(race(problem, chosen.samples, chosen.size, chosen.seconds))
        print(problem.name, file=sys.stderr)
    names = [search.name for search in SEARCHES]
    lines = [
        "# Which search reaches a given error first",
        "",
        f"- {len(problems)} problems, channel G, {chosen.samples} pairs uniform in the parabolic discs, {chosen.size}²,"
        f" ε = {SETTINGS.epsilon:g}, λ = {SETTINGS.smoothing:g}, reciprocal; the same start and"
        f" {chosen.seconds:g} s for every search, one after another; no tolerance ends one before",
        f"- one torch thread, {numba.get_num_threads()} in the compiled passes; compilation not counted",
        f"- {machine()}; load average {load:.1f} at the start, {os.getloadavg()[0]:.1f} at the end",
        "",
    ]
    for within in chosen.within:
        rows = []
        for problem, reports in zip(problems, found, strict=True):
            low = min(report.residual for report in reports.values())
            goals = [reached(reports[name], low * (1 + within)) for name in names]
            cells = [
                shown(seconds) if math.isinf(seconds) else f"{figure(seconds)} ({count})" for seconds, count in goals
            ]
            rows.append((problem.name, figure(low), *cells))
        lines += [
            f"## Within {within:.0%} of the lowest value that any found: seconds (evaluations) to reach it",
            "",
            markdown(("problem", "lowest R", *names), rows),
            "",
            summary(found, within),
            "",
        ]
    return finish("\n".join(lines), chosen)


if __name__ == "__main__":
    sys.exit(main())
