"""Two sweeps side by side: which fits got better, which worse, by each metric.

Two fits are compared if their source, label and seed are the same. A change counts if it is at least 1% of an error,
0.01 of a ratio that should be 1, or 0.1 dB of a PSNR.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from homofact.evaluation.metric_table import Metric
from homofact.sweeps.report.reading import ReadSweep, ReportedFit
from homofact.sweeps.summary import FIGURES, Limit, value_of

_COUNTS = {"low": 0.01, "one": 0.01, "high": 0.1}
# A ratio of 0 is as far from 1 as this one, and an unknown limit is as large.
_FARTHEST = 1e6


@dataclass(frozen=True)
class Pair:
    """One fit as it is `now`, and as it was `before`."""

    now: ReportedFit
    before: ReportedFit

    def change(self, metric: Metric | Limit) -> float | None:
        """Return how much worse the metric got, negative if better; None if either fit lacks the metric."""
        now, before = value_of(self.now.row, metric.name), value_of(self.before.row, metric.name)
        return None if now is None or before is None else change(metric, before, now)


@dataclass(frozen=True)
class SweepComparison:
    """The pairs of a sweep and an earlier one, and the fits that only one of them has."""

    before: ReadSweep
    pairs: tuple[Pair, ...]
    only_now: int
    only_before: int

    def counts(self, metric: Metric | Limit) -> dict[str, int]:
        """Return how many pairs got better, worse, or stayed the same."""
        said = [word(metric, step) for pair in self.pairs if (step := pair.change(metric)) is not None]
        return {kind: said.count(kind) for kind in ("better", "same", "worse")}

    def record(self) -> dict[str, Any]:
        """Return the number of pairs, and how many got better, worse or stayed the same, JSON-able."""
        return {
            "versions": list(self.before.versions),
            "pairs": len(self.pairs),
            "only_now": self.only_now,
            "only_before": self.only_before,
            "counts": {metric.name: self.counts(metric) for metric in FIGURES},
        }


def change(metric: Metric | Limit, before: float, now: float) -> float:
    """Return how much worse `now` is, negative if it is better.

    For an error it is the difference relative to the larger value, for a ratio the change of its distance from 1, for a
    PSNR the difference in dB.
    """
    if metric.good == "low":
        before, now = (value if math.isfinite(value) else _FARTHEST for value in (before, now))
        larger = max(abs(before), abs(now))
        return (now - before) / larger if larger else 0.0
    return min(metric.badness(now), _FARTHEST) - min(metric.badness(before), _FARTHEST)


def word(metric: Metric | Limit, step: float) -> str:
    """ "better", "same" or "worse"."""
    if abs(step) < _COUNTS[metric.good]:
        return "same"
    return "worse" if step > 0 else "better"


def compared(now: ReadSweep, before: ReadSweep) -> SweepComparison:
    """Compare two sweeps, fit by fit."""
    earlier = {fit.match: fit for fit in before.fits}
    pairs = tuple(Pair(fit, earlier[fit.match]) for fit in now.fits if fit.match in earlier)
    return SweepComparison(before, pairs, len(now.fits) - len(pairs), len(before.fits) - len(pairs))


def worst(fits: Sequence[ReportedFit], metric: Metric | Limit, count: int = 10) -> list[ReportedFit]:
    """Return the `count` worst fits by a metric, the worst first; fits without the metric are skipped."""
    order = [
        (metric.badness(value), k)
        for k, fit in enumerate(fits)
        if (value := value_of(fit.row, metric.name)) is not None
    ]
    return [fits[k] for _, k in sorted(order, key=lambda entry: (-entry[0], entry[1]))[:count]]


def comparison_rows(comparison: SweepComparison) -> list[dict[str, Any]]:
    """Return one row per pair and metric, for a table."""
    return [
        {
            "source": pair.now.row.source,
            "label": pair.now.row.label,
            "seed": pair.now.row.seed,
            "metric": metric.name,
            "before": value_of(pair.before.row, metric.name),
            "now": value_of(pair.now.row, metric.name),
            "change": step,
            "word": word(metric, step),
            "version_before": pair.before.task.version,
            "version_now": pair.now.task.version,
            "key_before": pair.before.row.key,
            "key_now": pair.now.row.key,
        }
        for pair in comparison.pairs
        for metric in FIGURES
        if (step := pair.change(metric)) is not None
    ]
