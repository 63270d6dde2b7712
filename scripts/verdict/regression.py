"""Fit linear models for `calibrate.py`: ridge regression, logistic regression, and the quantile that turns a
prediction into a bound.

Columns are put in units of their standard deviation first, and clipped to the range that all but a hundredth of the
fits at either end have: nothing is extrapolated.
"""

import math
from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

_OUT = 0.01
_LEAST_SPREAD = 1e-6
_ROUNDS = 40

Columns = Sequence[dict[str, float]]


class Standard:
    """The standard form of columns by name."""

    def __init__(self, rows: Columns, names: Sequence[str]) -> None:
        """Take means, deviations and ranges of the rows."""
        self.names = tuple(names)
        table = self._table(rows)
        self.low, self.high = (np.quantile(table, q, axis=0) for q in (_OUT, 1 - _OUT))
        clipped = table.clip(self.low, self.high)
        self.mean, deviation = clipped.mean(0), clipped.std(0)
        self.scale = np.where(deviation > _LEAST_SPREAD, deviation, np.inf)

    def of(self, rows: Columns) -> np.ndarray:
        """Rows in standard form (N, K)."""
        return (self._table(rows).clip(self.low, self.high) - self.mean) / self.scale

    def record(self, offset: float, weights: np.ndarray) -> dict[str, Any]:
        """The linear model of standard `weights` as `bar.table` reads it; columns of no weight are left out."""
        columns = {
            name: [float(f"{each:.6g}") for each in (weight / scale, mean, low, high)]
            for name, weight, scale, mean, low, high in zip(
                self.names, weights, self.scale, self.mean, self.low, self.high, strict=True
            )
            if np.isfinite(scale) and weight != 0
        }
        return {"offset": float(f"{offset:.6g}"), "columns": columns}

    def _table(self, rows: Columns) -> np.ndarray:
        return np.array([[row[name] for name in self.names] for row in rows], dtype=np.float64)


def ridge(x: np.ndarray, y: np.ndarray, penalty: float, weight: np.ndarray | None = None) -> tuple[float, np.ndarray]:
    """(offset, weights (K,)) of least squares with `penalty` · N on the squared weights, rows by `weight` (N,)."""
    weight = np.ones(len(y)) if weight is None else weight
    total = weight.sum()
    middle, centre = (weight @ x) / total, float(weight @ y) / total
    own = x - middle
    normal = (own * weight[:, None]).T @ own + penalty * total * np.eye(x.shape[1])
    weights = np.linalg.solve(normal, (own * weight[:, None]).T @ (y - centre))
    return centre - float(middle @ weights), weights


def logistic(x: np.ndarray, bad: np.ndarray, penalty: float) -> tuple[float, np.ndarray]:
    """(offset, weights (K,)) of the log odds of `bad` (N,), by Newton's method; both classes weigh the same."""
    share = np.where(bad, 0.5 / max(bad.mean(), 1e-9), 0.5 / max(1 - bad.mean(), 1e-9))
    whole = np.column_stack([np.ones(len(x)), x])
    held = penalty * len(x) * np.diag([0.0] + [1.0] * x.shape[1])
    weights = np.zeros(whole.shape[1])
    for _ in range(_ROUNDS):
        odds = 1 / (1 + np.exp(-np.clip(whole @ weights, -30, 30)))
        slope = whole.T @ (share * (odds - bad)) + held @ weights
        curve = (whole * (share * odds * (1 - odds))[:, None]).T @ whole + held + 1e-9 * np.eye(len(held))
        step = np.linalg.solve(curve, slope)
        weights -= step
        if np.abs(step).max() < 1e-9:
            break
    return float(weights[0]), weights[1:]


def conformal_quantile(missed: Sequence[float], rate: float) -> float:
    """The ⌈(n + 1) rate⌉-th smallest of n misses: a new one, drawn alike, exceeds it with at most 1 − rate.

    The largest where n is too small for the rate; 1 where there is none.
    """
    ordered = sorted(missed)
    return ordered[min(math.ceil((len(ordered) + 1) * rate), len(ordered)) - 1] if ordered else 1.0


def wilson(hits: int, count: int, deviate: float = 1.96) -> tuple[float, float]:
    """The 95% interval of a rate, by Wilson's score."""
    if count == 0:
        return 0.0, 1.0
    share, spread = hits / count, deviate**2 / count
    middle = (share + spread / 2) / (1 + spread)
    half = deviate * math.sqrt(share * (1 - share) / count + spread / (4 * count)) / (1 + spread)
    return max(middle - half, 0.0), min(middle + half, 1.0)


def quantile_of_groups(missed: Sequence[float], groups: Sequence[str], rate: float) -> float:
    """The least miss that is not exceeded by `rate` of the misses where each group has the same weight; 1 of none."""
    if not missed:
        return 1.0
    share = {name: 1 / (count * len(set(groups))) for name, count in Counter(groups).items()}
    reached = 0.0
    for miss, group in sorted(zip(missed, groups, strict=True)):
        reached += share[group]
        if reached >= rate - 1e-12:
            return miss
    return max(missed)
