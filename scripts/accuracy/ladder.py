"""Fit 1 to n textures in one search, at the cost of one fit of n textures.

`fit_cole` is greedy and draws from one seeded stream, so the projections of its first j terms are those of
a fit with j textures; only the final solve at full size is made again for each j.
"""

import time
from dataclasses import dataclass, replace

from homofact.brdf.samples import Samples
from homofact.brdf.source import Source
from homofact.brdf.source_names import HELD_OUT
from homofact.errors import Report
from homofact.evaluation.compare import ComparisonRow
from homofact.evaluation.metrics import measure
from homofact.evaluation.split import Split
from homofact.evaluation.verdict.judge import judge
from homofact.factor.factorization import Factorization
from homofact.factor.textures import LogSamples, residual
from homofact.methods.cole import Cole
from homofact.methods.cole_fit import fit_cole, solve_greedily
from homofact.methods.common import at_azimuths, provenance_of
from homofact.methods.fitting import FitProgress
from homofact.methods.method import Method


@dataclass
class _Cost:
    """Evaluations and seconds up to the end of each term, gathered from the progress of a fit."""

    began: float
    terms: dict[int, tuple[int, float]]

    def __call__(self, progress: FitProgress) -> None:
        self.terms[progress.term] = (progress.evaluations, time.perf_counter() - self.began)


def split(source: Source, settings: Method) -> tuple[Samples, Samples]:
    """(training, held out), both turned at random, the split of `evaluation.compare.fit_and_measure`."""
    parts = Split.of(source, HELD_OUT, settings.seed)
    return parts.parts(source)[0].rotated_at_random(settings.seed), parts.test_samples(source)


def ladder(source: Source, settings: Cole) -> list[ComparisonRow]:
    """Rows of `cole` for 1, 2, … settings.textures textures, each as `fit_and_measure` would give it.

    Evaluations and seconds of row j are those of the search up to term j with its own final solve; the
    status is that of the whole search.
    """
    if settings.epsilon is None:
        settings = replace(settings, epsilon=source.default_epsilon)
    train, _ = Split.of(source, HELD_OUT, settings.seed).parts(source)
    turned, test = split(source, settings)
    cost = _Cost(time.perf_counter(), {})
    whole = fit_cole(train, settings, cost)
    transform = whole.factorization.transform
    projections = tuple(term.projection for term in whole.factorization.terms)
    data = LogSamples.of(at_azimuths(train, settings, knows_azimuth=True), transform)
    rows, evaluations = [], 0
    for count in range(1, len(projections) + 1):
        began = time.perf_counter()
        chosen = replace(settings, textures=count)
        terms = solve_greedily(data, projections[:count], chosen).terms
        fitted = Factorization(terms, transform, train.channels, provenance_of(train, chosen))
        evaluations += cost.terms[count][0]
        seconds = cost.terms[count][1] + time.perf_counter() - began
        error = float((residual(data, terms) ** 2).mean())
        report = Report(whole.report.status, 0, evaluations, seconds, error, settings.seed)
        errors = [measure(fitted, samples, transform) for samples in (turned, test)]
        verdict = judge(fitted, report, chosen, train, test, (errors[0], errors[1]))
        rows.append(
            ComparisonRow(
                source.name,
                Split.of(source, HELD_OUT, settings.seed),
                chosen,
                fitted,
                report,
                errors[0],
                errors[1],
                len(source.samples),
                source.seconds_read,
                seconds,
                source.seconds_read + seconds,
                verdict,
            )
        )
    return rows
