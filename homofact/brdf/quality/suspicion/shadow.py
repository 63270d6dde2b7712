"""Detect the shadow of an arm: values near the light that are darker than those around it.

If values were rounded or cut at zero, the true value is at most one step above the recorded one. Only a drop that the
step does not explain counts as a shadow. Zeros around the light are used too. Without them, if dark values were cut at
zero, the samples around the light would look brighter than those near it.
"""

import math

import numpy as np

from homofact.brdf.quality.suspicion.check import Figures
from homofact.brdf.quality.suspicion.evidence import Evidence, along_highlight, hats

_CONE, _AROUND = math.radians(6.0), math.radians(13.0)  # half of the angle between ωi and ωo is θd
_KNOTS = 25
_SAME = 1e-6
_ONE_LEVEL = 1e-9
_NEIGHBOURS = 2.0
_MOST_FALL = 3.0  # of a zero, in logs
_ROUNDS = 20
_LEAST_RESIDUAL = 1e-2
_RIDGE = 1e-4


def shadow(evidence: Evidence) -> Figures | None:
    """Return how much darker samples near the light are than those around it, in logs and in errors of the fit.

    Two predictions of the values near the light are compared, and the smaller drop is returned. The smooth fit to all
    samples outside a cone around the light must extrapolate into the cone; on coarse rings it can err by a factor of
    ten or more. A fit to the samples just around the cone depends only on θh and ignores θd.

    Parameters
    ----------
    evidence
        The samples.

    Returns
    -------
    (fall of the median sample near the light as a natural logarithm, the same over the scale of the smooth fit's
    residuals); None if too few samples lie near the light or around it.
    """
    theta_h, theta_d = evidence.half_angles
    logs, weight = evidence.logs
    near, ring = theta_d < _CONE, (theta_d > _CONE) & (theta_d < _AROUND)
    if min(near.sum(), ring.sum()) < 8 or near.sum() + ring.sum() < 30:
        return None
    along = along_highlight(theta_h)
    knots = np.unique(np.quantile(along[ring], np.linspace(0, 1, _KNOTS)))
    # At the middle of a highlight, as at θi = 0, those around know nothing of its height.
    known = near & (along >= knots[0] - _SAME) & (along <= knots[-1] + _SAME)
    if known.sum() < 4:
        return None
    smooth = evidence.fitted(weight=weight * (theta_d > _CONE))
    lit = evidence.brightness > 0
    # As far below the smallest value as the fall of a zero counts at most.
    floor = math.log(evidence.brightness[lit].min()) - _MOST_FALL
    cut = np.where(lit, logs, floor)
    around = censored_median(hats(along, knots), cut, ring.astype(np.float64), floor)
    most = np.log(np.maximum(evidence.brightness + resolution(evidence.values), 1e-300))
    inner = np.flatnonzero(known)[np.argsort(theta_d[known], kind="stable")[: known.sum() // 2]]
    falls = []
    for predicted in (logs - smooth.residual, around):
        # Where most of those around are zero, another zero is no fall.
        missed = np.where(~lit & (predicted <= floor + 2 * _LEAST_RESIDUAL), 0.0, most - predicted)
        falls.append(-float(np.median(np.where(lit, missed, np.maximum(missed, -_MOST_FALL))[inner])))
    fall = min(falls)
    return fall, fall / (smooth.scale + 0.02)


def resolution(values: np.ndarray) -> np.ndarray:
    """Return the step of the values (N,), from values (N, C), as the mean over the channels.

    The step at a value is the smallest distance between two levels of its channel within a factor of two. It is the
    step of rounded values, be it constant or a digit, and nearly zero for continuous ones. If there is no other level,
    it is the value itself. At zero it is the step at the smallest positive value.

    Examples
    --------
    >>> resolution(np.array([[0.0], [0.1], [0.2], [0.3]])).round(6).tolist()
    [0.1, 0.1, 0.1, 0.1]
    """
    steps = np.zeros(values.shape)
    for c in range(values.shape[1]):
        levels = np.unique(values[:, c][values[:, c] > 0])
        if not len(levels):
            continue
        levels = levels[np.append(True, np.diff(levels) > _ONE_LEVEL * levels[1:])]
        at = np.maximum(values[:, c], levels[0])
        first = np.searchsorted(levels, at / _NEIGHBOURS * (1 - _ONE_LEVEL))
        last = np.searchsorted(levels, at * _NEIGHBOURS * (1 + _ONE_LEVEL), side="right") - 1
        gaps = np.append(np.diff(levels), (np.inf, np.inf))
        ends = np.column_stack((first, np.maximum(last, first + 1))).reshape(-1)
        least = np.where(last > first, np.minimum.reduceat(gaps, ends)[::2], np.inf)
        steps[:, c] = np.minimum(least, at)
    return steps.mean(1)


def censored_median(columns: np.ndarray, target: np.ndarray, weight: np.ndarray, floor: float) -> np.ndarray:
    """Return the medians (N,) of a target (N,) that is cut at `floor`, linear in the columns (N, K) above it.

    It minimises Σ w |t − max(floor, columns · c)| by reweighted least squares. Samples that are predicted below the
    floor do not depend on c and get no weight after the first rounds.

    References
    ----------
    Powell 1984: least absolute deviations for the censored regression model.
    """
    size = np.sqrt((weight[:, None] * columns**2).sum(0) / weight.sum()) + 1e-12
    scaled, now = columns / size, weight
    predicted = np.full(len(target), floor)
    for number in range(_ROUNDS):
        if not now.sum() > 0:
            break
        normal = (scaled * now[:, None]).T @ scaled
        normal[np.diag_indices_from(normal)] += _RIDGE * now.sum()
        predicted = scaled @ np.linalg.solve(normal, scaled.T @ (now * target))
        now = weight / np.maximum(np.abs(target - np.maximum(predicted, floor)), _LEAST_RESIDUAL)
        if number > _ROUNDS // 5:
            now = np.where(predicted > floor, now, 0.0)
    return np.maximum(predicted, floor)
