"""Detect values that were quantised, clipped or cut at zero.

The checks count values that occur several times among samples at different directions. A continuous quantity, measured
at thousands of directions, hardly ever gives the same number twice. Pairs that are equivalent for an isotropic,
reciprocal material (the same θ's in either order and the same |Δφ|) count once.
"""

import math

import numpy as np

from homofact.brdf.quality.suspicion.check import Check, Figures
from homofact.brdf.quality.suspicion.evidence import Evidence

_SAME_PLACE = 1e-6
_MOST_ZEROS = 20.0  # per cent: more are no surer


def _distinct_places(evidence: Evidence) -> np.ndarray:
    """The first row of every place of the module's head."""
    high, low = np.maximum(evidence.wi[:, 2], evidence.wo[:, 2]), np.minimum(evidence.wi[:, 2], evidence.wo[:, 2])
    between = (evidence.wi * evidence.wo).sum(1)
    keys = np.round(np.stack([high, low, between], 1) / _SAME_PLACE).astype(np.int64)
    return np.unique(keys, axis=0, return_index=True)[1]


def _tied(values: np.ndarray) -> tuple[float, float] | None:
    """(share of values that occur at least twice, the median step to the next level over the value) of one channel.

    Zeros, the largest and the commonest value are left out: a black, a clipped or an even part is no sign of levels.
    """
    levels, counts = np.unique(values, return_counts=True)
    usable = (levels > 0) & (counts < counts.max()) if len(levels) > 2 else levels > 0
    if len(levels) > 20:
        usable &= levels < levels[-1]
    total = counts[usable].sum()
    if total < 20:
        return None
    steps = np.diff(levels, append=2 * levels[-1])
    relative = np.repeat((steps / np.maximum(levels, 1e-300))[usable], counts[usable])
    return float(counts[usable & (counts > 1)].sum() / total), float(np.median(relative))


def _quantised(evidence: Evidence) -> Figures | None:
    """Share of tied values and the log10 of their step, of the channel with most."""
    rows = _distinct_places(evidence)
    steps = [tied for c in range(evidence.values.shape[1]) if (tied := _tied(evidence.values[rows, c])) is not None]
    if not steps or len(rows) < 100:
        return None
    share, step = max(steps)
    return share, math.log10(max(step, 1e-9))


def _clipped(evidence: Evidence) -> Figures | None:
    """The log of how often the largest value occurs over how often the next ten do, of the channel with most."""
    rows = _distinct_places(evidence)
    best = -1.0
    for c in range(evidence.values.shape[1]):
        levels, counts = np.unique(evidence.values[rows, c], return_counts=True)
        # A constant channel is even, not clipped; an even base is its smallest values, not its largest.
        if len(levels) > 10 and counts[-1] > 1:
            best = max(best, math.log(counts[-1] / max(1.0, counts[-11:-1].mean())))
    return (best,)


def _zeros(evidence: Evidence) -> Figures | None:
    """The share of exact zeros, of the worst channel, in per cent and at most `_MOST_ZEROS`."""
    return (min(100 * float((evidence.values == 0).mean(0).max()), _MOST_ZEROS),)


CHECKS = (
    Check(
        "quantised", _quantised, lambda f: f"values in steps of {10 ** f[1]:.1%} of the typical value",
        remedy="export the measurement in floating point; until then fit with a larger epsilon",
    ),
    Check(
        "clipped", _clipped, lambda f: "the largest value occurs again and again: the highlight is clipped",
        remedy="leave the clipped samples out of the file, or measure with a shorter exposure",
    ),
    Check(
        "zeros", _zeros,
        lambda f: f"{'at least ' * (f[0] >= _MOST_ZEROS)}{f[0]:.2g}% of a channel's values are cut at zero: a dark"
        " frame over-subtracted, negative values cut, or a colour outside of the channels' gamut",
        remedy="export the values without the cut",
    ),
)  # fmt: skip
