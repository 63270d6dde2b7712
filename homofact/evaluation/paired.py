"""Compare two fits on the same samples, or two methods split by split, to tell a real difference from luck.

Errors on held-out samples vary from split to split, in the same way for all methods: a split that holds out the top of
a highlight is hard for all of them. So the error ranges of two methods may overlap although one method is better on
every split. Therefore homofact computes the ratio of the two errors on each split, and counts the splits on which each
method is better.

Two saved fits have only one split. Then a bootstrap over the held-out samples estimates how much the ratio of the
errors depends on the choice of these samples. It draws the errors of both fits at a sample together.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
import torch

from homofact.brdf.pair_density import disc_shares
from homofact.brdf.samples import Samples
from homofact.evaluation.repeats import RepeatedRows
from homofact.evaluation.spread import Spread
from homofact.factor.fitted import Fitted

# The errors on held-out samples that are compared: of logarithms, and of the values themselves.
PAIRED = ("log_mse", "mse")
_RESAMPLES, _SEED = 1000, 20261128


@dataclass(frozen=True)
class MethodPair:
    """The errors of one method over those of another, on the same splits.

    Attributes
    ----------
    method : label of the method whose errors are divided.
    other : label of the method that they are divided by.
    ratios : by name of the error, its ratio on each split, in the order of the splits.
    """

    method: str
    other: str
    ratios: dict[str, tuple[float, ...]]

    def lower(self, name: str) -> int:
        """Return on how many splits the error called `name` is lower by `method`."""
        return sum(ratio < 1 for ratio in self.ratios[name])

    def spread(self, name: str) -> Spread:
        """Return the spread of the ratios."""
        return Spread.of(self.ratios[name])

    @property
    def words(self) -> str:
        """Return the comparison as text: the number of splits with a lower error, and the range of the error ratios.

        Examples
        --------
        >>> MethodPair("search", "ggx", {"log_mse": (0.5, 0.25)}).words
        'search against ggx: log_mse lower on 2 of 2 splits, 0.25 to 0.5 times that of ggx'
        """
        parts = [
            f"{name} lower on {self.lower(name)} of {len(found)} splits, {min(found):.3g} to {max(found):.3g} times"
            f" that of {self.other}"
            for name, found in self.ratios.items()
        ]
        return f"{self.method} against {self.other}: {'; '.join(parts)}"

    def record(self) -> dict[str, Any]:
        """Return the JSON form."""
        ratios = {
            name: {"ratios": list(found), "lower_on": self.lower(name), "splits": len(found)}
            for name, found in self.ratios.items()
        }
        return {"method": self.method, "other": self.other, "errors": ratios}


@dataclass(frozen=True)
class ErrorRatio:
    """The error of one fit over that of another on `count` samples, with the bootstrap's 95% interval."""

    ratio: float
    low: float
    high: float
    count: int

    @property
    def clear(self) -> bool:
        """Whether the interval does not contain 1."""
        return not self.low <= 1 <= self.high

    def record(self) -> dict[str, Any]:
        """Return the JSON form."""
        return {"ratio": self.ratio, "interval": [self.low, self.high], "samples": self.count}


def error_ratios(first: Fitted, second: Fitted, samples: Samples) -> dict[str, ErrorRatio]:
    """Return the ratios of two fits' errors on the same samples, by the names of `PAIRED`; infinite if divided by 0.

    The bootstrap treats the samples as independent. Neighbours in a measurement are slightly dependent, so the interval
    is slightly too narrow.
    """
    weights = disc_shares(samples)
    weights = torch.ones_like(samples.wi[:, 0]) if weights is None else weights
    errors = []
    for fit in (first, second):
        found, log = fit.evaluate(samples.wi, samples.wo), fit.transform.forward
        off = (log(found) - log(samples.values), found - samples.values)
        errors.append([(each.square().mean(1) * weights).cpu().numpy() for each in off])
    count = len(samples)
    drawn = np.random.default_rng(_SEED).integers(0, count, (_RESAMPLES, count))
    ratios = {}
    for name, own, other in zip(PAIRED, *errors, strict=True):
        sums = [np.array([error[rows].sum() for rows in drawn]) for error in (own, other)]
        with np.errstate(divide="ignore", invalid="ignore"):
            low, high = np.nanquantile(sums[0] / sums[1], (0.025, 0.975))
            ratios[name] = ErrorRatio(float(own.sum() / other.sum()), float(low), float(high), count)
    return ratios


def split_by_split(rows: Mapping[str, RepeatedRows]) -> list[MethodPair]:
    """Return each pair of methods on their common splits; within a pair, the lower mean Cole error comes first.

    Several seeds on a split count once, by their mean error. Methods with different ε form no pair, since their Cole
    errors cannot be compared. Splits on which an error is 0 are left out. A pair with fewer than two remaining splits
    is left out, too.
    """
    labels = sorted(rows, key=lambda label: rows[label].held_out["log_mse"].mean)
    pairs = []
    for method, other in combinations(labels, 2):
        if _epsilon(rows[method]) != _epsilon(rows[other]):
            continue
        common = [seed for seed in rows[method].splits if seed in rows[other].splits]
        errors = [(rows[method].of_split(seed).held_out, rows[other].of_split(seed).held_out) for seed in common]
        whole = [(own, against) for own, against in errors if all(against[name].mean > 0 for name in PAIRED)]
        if len(whole) > 1:
            ratios = {name: tuple(own[name].mean / against[name].mean for own, against in whole) for name in PAIRED}
            pairs.append(MethodPair(method, other, ratios))
    return pairs


def _epsilon(rows: RepeatedRows) -> float:
    return rows.first.factorization.transform.epsilon
