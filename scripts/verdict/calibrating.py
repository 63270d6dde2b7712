"""Make the constants of the error bars (`homofact.evaluation.bar.table`) from simulated fits: weights, quantiles
and a threshold.

Weights are those of ridge regressions on all fits of the first two parts. Quantiles, and the threshold of the warning,
are of what models miss that have not seen the kind of fault, of right data the material, that they are asked about:
the fits are left out fold by fold. The models for right data have seen right data alone; those for data that may be
wrong all that can be known. Their quantiles are of wrong data alone, each kind of fault with the same weight: the next
fault is of another kind. What is good or bad says `judge.is_good`, the albedo within the measured range.

The warning is a regression of how bad a fit is, the log of its worst error over the limit, cut to ±2, which knows more
than a mere yes or no; a logistic of one number makes a probability of it.
"""

import hashlib
import math
from collections.abc import Container, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from homofact.evaluation.bar.features import FEATURES, OF_QUANTITY, angles_in_range, features_of
from homofact.evaluation.bar.table import LEAST_SPREAD, QUANTITIES, RATE
from homofact.evaluation.energy import ALBEDO_DEGREES
from homofact.evaluation.verdict.figures import Figures
from homofact.evaluation.verdict.judge import OFF, OFF_LAMP, OFF_SKY, is_good
from homofact.stability.fault import CasePart
from scripts.verdict.regression import Columns, Standard, conformal_quantile, logistic, quantile_of_groups, ridge

PENALTY, PENALTY_OF_SPREAD, PENALTY_OF_WARNING = 0.1, 1.0, 0.03
FOLDS = 8
SILENT = 0.1  # of the bad fits that can be known: the threshold is the largest that leaves so few without a warning
LEAST_ERROR, MOST_ERROR = 2e-3, 2.0  # what is beyond is all alike
_MOST_BADNESS = 2.0
_NAMES = (*FEATURES, *OF_QUANTITY)


@dataclass(frozen=True)
class SimulatedFit:
    """A record of the store with its figures as they are judged."""

    record: dict[str, Any]

    @cached_property
    def figures(self) -> Figures:
        """The figures."""
        return Figures.of(self.record["figures"])

    @property
    def odds(self) -> dict[str, float]:
        """Of the suspicions."""
        return self.record["suspected"]

    def features(self, quantity: str, angle: int | None = None) -> dict[str, float]:
        """Those of `bar.features`."""
        return features_of(self.figures, self.odds, quantity, angle)

    def error(self, quantity: str, angle: int | None = None) -> float:
        """The true error: |log| of light, a picture's share."""
        truth = self.record["truth"]
        if quantity != "albedo":
            return float(truth[quantity])
        inside = angles_in_range(self.figures.coverage.lowest, self.figures.coverage.highest)
        return max(truth["albedo"][k] for k in (inside if angle is None else (angle,)))

    @property
    def good(self) -> bool:
        """Whether it is a good fit."""
        truth = self.record["truth"]
        return is_good(self.error("albedo"), truth["sky"], truth["light"])

    @property
    def badness(self) -> float:
        """The log of its worst error over what makes a fit a bad one, cut to ±2."""
        truth = self.record["truth"]
        errors = (self.error("albedo") / math.log1p(OFF), truth["sky"] / OFF_SKY, truth["light"] / OFF_LAMP)
        return min(max(math.log(max(*errors, LEAST_ERROR)), -_MOST_BADNESS), _MOST_BADNESS)

    @property
    def group(self) -> str:
        """What is left out with it: its kind of fault, of right data its material."""
        return self.record["material"] if self.right else f"fault {self.record['fault']}"

    @property
    def part(self) -> str:
        """Of the calibration."""
        return self.record["part"]

    @property
    def right(self) -> bool:
        """Whether its samples are of the material."""
        return self.record["right"]

    @property
    def knowable(self) -> bool:
        """Whether samples can show its fault."""
        return self.record["knowable"]

    @property
    def searched(self) -> bool:
        """Whether projections were searched for."""
        return self.record["method"] == "search"


def fits_of(records: Sequence[dict[str, Any]]) -> list[SimulatedFit]:
    """The records that are fits: refused ones say nothing."""
    return [SimulatedFit(record) for record in records if "refused" not in record]


def calibrated(fits: Sequence[SimulatedFit], made: dict[str, Any]) -> dict[str, Any]:
    """The table as a JSON-able dictionary; `made` says by what."""
    own = [fit for fit in fits if fit.part != CasePart.REPORT.value]
    known = [fit for fit in own if fit.knowable]
    warning, scores = warning_model(known)
    threshold = threshold_of(scores, [not fit.good for fit in known])
    right = [fit for fit in own if fit.right]
    doubted = {id(fit) for fit, score in zip(known, scores, strict=True) if fit.odds or score > threshold}
    chosen = {"right": (right, {id(fit) for fit in right}), "fault": (known, doubted - {id(fit) for fit in right})}
    bars, angles = {}, {}
    for kind, (some, counted) in chosen.items():
        bars[kind] = {name: bar_model(some, counted, name) for name in QUANTITIES}
        angles[kind] = [
            bar_model([fit for fit in some if _in_range(fit, k)], counted, "albedo", k)
            for k in range(len(ALBEDO_DEGREES))
        ]
    return {
        "made": made,
        "bars": bars,
        "angles": angles,
        "warning": warning,
        "threshold": float(f"{threshold:.4g}"),
    }


def bar_model(
    fits: Sequence[SimulatedFit], counted: Container[int], quantity: str, angle: int | None = None
) -> dict[str, Any]:
    """The models of a bar, and the quantile of what they miss on fits left out, as the table holds them.

    The quantile is of the fits whose ids are `counted`. If any of them has wrong data, kinds of faults weigh the same.
    """
    rows = [fit.features(quantity, angle) for fit in fits]
    y = np.array([math.log(min(max(fit.error(quantity, angle), LEAST_ERROR), MOST_ERROR)) for fit in fits])
    folds = folds_of(fits)
    middle, spreads = np.zeros(len(fits)), np.ones(len(fits))
    for fold in range(FOLDS):
        out = folds == fold
        if out.any() and not out.all():
            kept = [row for row, left in zip(rows, out, strict=True) if not left]
            standard, model, spread = _models(kept, y[~out], folds[~out])
            x = standard.of([row for row, left in zip(rows, out, strict=True) if left])
            middle[out] = model[0] + x @ model[1]
            spreads[out] = np.maximum(spread[0] + x @ spread[1], LEAST_SPREAD)
    standard, model, spread = _models(rows, y, folds)
    own = np.array([id(fit) in counted for fit in fits])
    missed = ((y - middle) / spreads)[own].tolist()
    groups = [fit.group for fit, is_own in zip(fits, own, strict=True) if is_own]
    right = all(fit.right for fit, is_own in zip(fits, own, strict=True) if is_own)
    quantile = conformal_quantile(missed, RATE) if right else quantile_of_groups(missed, groups, RATE)
    return {
        "model": standard.record(*model),
        "spread": standard.record(*spread),
        "quantile": float(f"{quantile:.6g}"),
    }


def warning_model(fits: Sequence[SimulatedFit]) -> tuple[dict[str, Any], list[float]]:
    """(the logistic as the table holds it, the score of each fit by a model that was not shown it)."""
    rows = [fit.features("albedo") for fit in fits]
    badness, folds = np.array([fit.badness for fit in fits]), folds_of(fits)
    left_out = _left_out(rows, badness, folds, PENALTY_OF_WARNING)
    offset, slope = logistic(left_out[:, None], np.array([not fit.good for fit in fits]), 1e-6)
    standard = Standard(rows, _NAMES)
    own, weights = ridge(standard.of(rows), badness, PENALTY_OF_WARNING)
    odds = (offset + slope[0] * left_out).clip(-30, 30)
    return standard.record(offset + slope[0] * own, slope[0] * weights), (1 / (1 + np.exp(-odds))).tolist()


def threshold_of(scores: Sequence[float], bad: Sequence[bool]) -> float:
    """The largest score that leaves at most `SILENT` of the bad fits at or below it."""
    own = sorted(score for score, is_bad in zip(scores, bad, strict=True) if is_bad)
    return own[math.floor(SILENT * len(own))] * (1 - 1e-6) if own else 0.5


def folds_of(fits: Sequence[SimulatedFit]) -> np.ndarray:
    """The fold of each fit (N,): groups by turns, in the order of their names' hashes."""
    groups = sorted({fit.group for fit in fits}, key=lambda name: hashlib.sha256(name.encode()).hexdigest())
    place = {name: number % FOLDS for number, name in enumerate(groups)}
    return np.array([place[fit.group] for fit in fits])


Model = tuple[float, np.ndarray]


def _models(rows: Columns, y: np.ndarray, folds: np.ndarray) -> tuple[Standard, Model, Model]:
    """(standard form, the model of y, that of how far a model misses which was not shown the row)."""
    standard = Standard(rows, _NAMES)
    x = standard.of(rows)
    missed = np.abs(y - _left_out(rows, y, folds, PENALTY))
    return standard, ridge(x, y, PENALTY), ridge(x, missed, PENALTY_OF_SPREAD)


def _left_out(rows: Columns, y: np.ndarray, folds: np.ndarray, penalty: float) -> np.ndarray:
    """What ridges say of each row that were not shown its fold (N,); the mean where there is only one."""
    found = np.full(len(y), y.mean())
    for fold in np.unique(folds):
        out = folds == fold
        if not out.all():
            kept = [row for row, left in zip(rows, out, strict=True) if not left]
            standard = Standard(kept, _NAMES)
            offset, weights = ridge(standard.of(kept), y[~out], penalty)
            found[out] = offset + standard.of([row for row, left in zip(rows, out, strict=True) if left]) @ weights
    return found


def _in_range(fit: SimulatedFit, angle: int) -> bool:
    return angle in angles_in_range(fit.figures.coverage.lowest, fit.figures.coverage.highest)
