"""Compare a whole five-texture search on the blue paint with the procedure of Cole's thesis.

    python scripts/accuracy/search_against_cole.py [--efforts quick normal] [--short]

`cole` is configs/thesis.toml, green channel: full size, every sample, six restarts a term, QMR on the normal
equations. That takes long, so its time is put together from two runs in this process. A complete run with Cholesky in
place of QMR, all else the same, gives the number of evaluations of each term and the error, which no solver changes.
A part of the run with QMR (the first restart of the first term to its end, then some evaluations of the second) gives
the mean time of an evaluation with one texture and with two; later terms solve two as well (`joint_terms`). Their
product is the extrapolated time. The first restart is in both runs: it must end after as many evaluations at the same
error. The searched fits are whole runs, as chosen by the method and pinned to cole's own family of projections.
"""

import os
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

import numba

from homofact.brdf.materials import material
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model
from homofact.config import load_config
from homofact.evaluation.machine import machine
from homofact.evaluation.metrics import measure
from homofact.methods.cole import Cole
from homofact.methods.fitting import FitProgress, MethodFit
from homofact.methods.method import Method
from homofact.methods.search import Search

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import ROOT, effort_of, figure, finish, markdown, parser_of

MATERIAL, CHANNEL = "lafortune-blue-paint", "G"
SECOND = 1_000_000  # the second draw of seed s has seed s + SECOND
TARGET = 100


# Seconds by the wall, and of processor time of all threads, which other work on the machine touches less.
Clocks = tuple[float, float]


def clocks() -> Clocks:
    """Both clocks now."""
    return time.perf_counter(), time.process_time()


def since(began: Clocks, ended: Clocks | None = None) -> Clocks:
    """Seconds from `began` to `ended`, or to now."""
    ended = clocks() if ended is None else ended
    return ended[0] - began[0], ended[1] - began[1]


class Enough(Exception):
    """Raised from the progress of a fit, of which a part was wanted."""


@dataclass
class Tally:
    """When each evaluation of each term ended, by the wall and by the processor's clock, and how the first restart
    of the first term went: its evaluations and lowest error.

    Raises Enough after `most` evaluations of the second term, where `most` is set.
    """

    most: int | None = None
    ends: dict[int, list[Clocks]] = field(default_factory=dict)
    first: tuple[int, float] = (0, 0.0)

    def __call__(self, progress: FitProgress) -> None:
        """Note one evaluation."""
        self.ends.setdefault(progress.term, []).append(clocks())
        if progress.term == progress.restart == 1:
            self.first = (progress.evaluations, progress.best)
        if progress.term == 2 and self.most is not None and progress.evaluations >= self.most:
            raise Enough

    def seconds(self, term: int) -> Clocks:
        """Mean seconds of an evaluation of a term, from the end of its first."""
        ends = self.ends[term]
        wall, processor = since(ends[0], ends[-1])
        return wall / (len(ends) - 1), processor / (len(ends) - 1)

    def evaluations(self) -> list[int]:
        """Evaluations of every term."""
        return [len(self.ends[term]) for term in sorted(self.ends)]


def draw(count: int, seed: int) -> Samples:
    """`count` pairs of the paint's green channel."""
    return sample_model(material(MATERIAL).model, count, "discs", seed).channel(CHANNEL)


def fit(samples: Samples, settings: Method, tally: Tally | None = None) -> tuple[MethodFit, Clocks]:
    """A whole fit and its seconds."""
    began = clocks()
    fitted = settings.fit(samples, tally)
    return fitted, since(began)


def part_of(samples: Samples, settings: Cole, most: int) -> Tally:
    """The first restart of the first term and `most` evaluations of the second, with the settings' own solver."""
    tally = Tally(most)
    with suppress(Enough):
        fit(samples, replace(settings, restarts=1, textures=2), tally)
    return tally


def extrapolate(evaluations: Sequence[int], part: Tally) -> tuple[list[Clocks], Clocks]:
    """(seconds of an evaluation of each term, of them all): the first term as timed, all later ones as the second."""
    each = [part.seconds(min(term, 2)) for term in range(1, len(evaluations) + 1)]
    wall, processor = (sum(n * one[clock] for n, one in zip(evaluations, each, strict=True)) for clock in (0, 1))
    return each, (wall, processor)


def main(arguments: list[str] | None = None) -> int:
    """Print (and with --out write) the tables; returns the exit code."""
    parser = parser_of(__doc__, "out")
    parser.add_argument("--efforts", type=effort_of, nargs="+", default=["quick", "normal"], help="of the search")
    parser.add_argument("--measure", type=int, default=150, help="evaluations of the second term that are timed")
    parser.add_argument("--seed", type=int, default=0)
    chosen = parser.parse_args(arguments)
    config = load_config(ROOT / "configs" / "thesis.toml", {"seed": chosen.seed})
    thesis, count = config.fit.method_alone(), config.source.count
    assert isinstance(thesis, Cole)
    if chosen.short:
        thesis, count = replace(thesis, size=4, restarts=2, textures=3), 600
        chosen.efforts, chosen.measure = chosen.efforts[:1], 20
    load = os.getloadavg()[0]
    train, second = draw(count, chosen.seed), draw(count, chosen.seed + SECOND)
    small = draw(300, chosen.seed)
    for each in (Cole, Search):  # compile
        fit(small, each(size=4, restarts=1, epsilon=1e-5))

    runs = []
    by_cholesky = Tally()
    cholesky = replace(thesis, solver="cholesky")
    fitted, cole_seconds = fit(train, cholesky, by_cholesky)
    runs.append(("cole, Cholesky", fitted, cole_seconds))
    print(f"cole with Cholesky: {cole_seconds[0]:.0f} s", file=sys.stderr)
    part = part_of(train, thesis, chosen.measure)
    evaluations = by_cholesky.evaluations()
    each, extrapolated = extrapolate(evaluations, part)
    print(f"cole with QMR: {extrapolated[0]:.0f} s, extrapolated", file=sys.stderr)
    for projections in (None, (thesis.coordinates,)):
        for effort in chosen.efforts:
            settings = Search(
                effort=effort,
                projections=projections,
                textures=thesis.textures,
                size=thesis.size,
                restarts=thesis.restarts,
                epsilon=thesis.epsilon,
                seed=chosen.seed,
            )
            name = f"search, {'+'.join(projections or ('any kinds',))}, {effort}"
            runs.append((name, *fit(train, settings)))
            print(f"{name}: {runs[-1][2][0]:.1f} s", file=sys.stderr)

    rows = []
    for name, fitted, seconds in runs:
        result = fitted.factorization
        errors = [figure(measure(result, samples, result.transform).log_mse) for samples in (train, second)]
        ratios = [figure(cole / own) for cole, own in zip(extrapolated, seconds, strict=True)]
        ratios.append(figure(cole_seconds[0] / seconds[0]))
        sizes = (len(result.terms), result.fetches)
        rows.append((name, *map(figure, seconds), fitted.report.evaluations, *errors, *ratios, *sizes))
    first = (f"cole, {thesis.solver.upper()} (extrapolated)", *map(figure, extrapolated), sum(evaluations))
    rows.insert(0, (*first, *rows[0][4:6], "1", "1", figure(cole_seconds[0] / extrapolated[0]), *rows[0][9:]))
    cole = [float(error) for error in rows[1][4:6]]
    better = [row for row in rows[2:] if float(row[4]) < cole[0] and float(row[5]) < cole[1]]
    best = max(better, key=lambda row: float(row[6]), default=None)
    verdict = "none" if best is None else f"{best[0]}, {best[6]} times faster ({best[7]} in processor time)"
    counts = [
        (
            term,
            number,
            1 if term == 1 else min(term, thesis.joint_terms),
            len(part.ends[term]) - 1 if term < 3 else "as term 2",
            *(figure(1000 * clock) for clock in seconds),
            *(figure(1000 * clock) for clock in by_cholesky.seconds(term)),
        )
        for term, (number, seconds) in enumerate(zip(evaluations, each, strict=True), 1)
    ]
    (n_qmr, e_qmr), (n_own, e_own) = part.first, by_cholesky.first
    text = "\n".join(
        [
            f"# {thesis.textures} textures of blue paint: the searched fit and the thesis's",
            "",
            f"- {MATERIAL}, channel {CHANNEL}, {count} pairs uniform in the parabolic discs, seed {chosen.seed}, second"
            f" draw the same; {thesis.size}², ε = {thesis.epsilon:g}; Cole error (log_mse)",
            f"- cole: configs/thesis.toml ({thesis.coordinates}, every sample at full size, {thesis.restarts}"
            f" restarts a term, last {thesis.joint_terms} terms jointly, {thesis.solver}); its time is extrapolated,"
            " its error is that of the complete run with Cholesky",
            "- times faster: than cole with QMR by the wall, and by processor time (all threads), which other work on"
            " the machine touches less; than the complete run of cole with Cholesky by the wall",
            f"- one torch thread, {numba.get_num_threads()} in the compiled passes; compilation not counted",
            f"- {machine()}; load average {load:.1f} at the start, {os.getloadavg()[0]:.1f} at the end",
            "",
            markdown(
                ("fit", "seconds", "processor s", "evaluations", "training", "second draw", "times faster",
                 "processor", "than Cholesky", "textures", "fetches"),
                rows,
            ),
            "",
            f"Target: at least {TARGET} times faster at a lower error. The fastest searched fit with both errors"
            f" lower: {verdict}.",
            "",
            markdown(
                ("term", "evaluations", "textures solved", "timed with QMR", "ms, QMR", "processor ms", "ms, Cholesky",
                 "processor ms"),
                counts,
            ),
            "",
            f"First restart of the first term: {n_qmr} evaluations to {e_qmr:.6g} with QMR, {n_own} to {e_own:.6g} with"
            " Cholesky.",
            "",
        ]
    )  # fmt: skip
    return finish(text, chosen)


if __name__ == "__main__":
    sys.exit(main())
