"""Detect faults of the instrument: a drifting lamp, a bad ring, the shadow of an arm, swapped channels.

All of these are gains, so each adds columns to the smooth reciprocal fit of log f. If a gain over θi has a part that is
equal over θo, this part cannot be distinguished from the material. The rest breaks reciprocity and can be detected.
"""

import math

import numpy as np
import torch

from homofact.brdf.quality.gains import lacking_reciprocity
from homofact.brdf.quality.suspicion.check import Check, Figures
from homofact.brdf.quality.suspicion.evidence import Evidence, hats, robust_fit
from homofact.brdf.quality.suspicion.geometry import odd_columns
from homofact.brdf.quality.suspicion.ring_steps import BINS, largest_step
from homofact.brdf.quality.suspicion.shadow import shadow
from homofact.brdf.symmetry import ring_numbers
from homofact.errors import Advice

_FEWEST_FOR_GAINS = 1500
_TOLD = 0.5  # of the variance of a row's place, left when an angle is known


def _thetas(evidence: Evidence) -> tuple[np.ndarray, np.ndarray]:
    return tuple(np.arccos(np.clip(w[:, 2], 0, 1)) for w in (evidence.wi, evidence.wo))  # type: ignore[return-value]


def _spread(gains: np.ndarray, weight: np.ndarray) -> float:
    mean = np.average(gains, weights=weight)
    return float(np.sqrt(np.average((gains - mean) ** 2, weights=weight)))


def _sorted_by_angle(evidence: Evidence) -> bool:
    """Return whether the rows of the file are sorted by θi, θo or the azimuth between them."""
    theta_i, theta_o = _thetas(evidence)
    turn = np.arctan2(evidence.wi[:, 1], evidence.wi[:, 0]) - np.arctan2(evidence.wo[:, 1], evidence.wo[:, 0])
    around = np.arccos(np.clip(np.cos(turn), -1, 1))
    for angle in (theta_i, theta_o, around):
        knots = np.unique(np.quantile(angle, np.linspace(0, 1, BINS + 1)))
        residual = robust_fit(hats(angle, knots), evidence.place, np.ones(len(angle)))[1]
        if residual.var() < _TOLD * evidence.place.var():
            return True
    return False


def _time(evidence: Evidence) -> Figures | None:
    """The log of the RMS of a slow gain over the rows, and by how much the fit's error falls with it.

    None where rows are sorted by an angle: a gain over the rows is one over the angle then, or the material itself.
    """
    if len(np.unique(evidence.place)) < 100 or _sorted_by_angle(evidence):
        return None
    odd = odd_columns(evidence)
    slow = np.polynomial.legendre.legvander(evidence.place, 5)[:, 1:]
    plain, fit = evidence.fitted(odd), evidence.fitted(np.column_stack([odd, slow]))
    _, weight = evidence.logs
    spread = _spread(slow @ fit.further[odd.shape[1] :], weight + 1e-12)
    return math.log(spread + 1e-4), math.log((plain.scale + 1e-3) / (fit.scale + 1e-3))


def _angle(evidence: Evidence) -> Figures | None:
    """The log of the RMS of the gain that breaks reciprocity, and by how much the fit's error falls with it."""
    odd = odd_columns(evidence)
    fit, (_, weight) = evidence.fitted(odd), evidence.logs
    spread = _spread(odd @ fit.further, weight + 1e-12)
    return math.log(spread + 1e-4), math.log((evidence.fitted().scale + 1e-3) / (fit.scale + 1e-3))


def _gains(evidence: Evidence) -> Figures | None:
    """The log of the RMS of the gain over θi by reciprocity alone, its least and its greatest log.

    None on rings, and for few samples.
    """
    directions = [torch.from_numpy(w) for w in (evidence.wi, evidence.wo)]
    if len(evidence.wi) < _FEWEST_FOR_GAINS or any(ring_numbers(w) is not None for w in directions):
        return None
    _, gains, rms = lacking_reciprocity(evidence)
    return (math.log(rms + 1e-4), float(gains.min()), float(gains.max()))


def _ring(evidence: Evidence) -> Figures | None:
    """The figures of the largest step (`RingStep.figures`)."""
    step = largest_step(evidence)
    return None if step is None else step.figures


def _colours(evidence: Evidence) -> np.ndarray | None:
    """Logs of the channels over their geometric mean (N, C); None for one channel."""
    if evidence.values.shape[1] < 2:
        return None
    logs = np.log(np.maximum(evidence.values, 1e-6 * evidence.values.mean() + 1e-300))
    return logs - logs.mean(1, keepdims=True)


def _channels(evidence: Evidence) -> Figures | None:
    """The per cent of rows whose colour fits its neighbours only with two channels exchanged, and how far apart."""
    colours, (_, weight) = _colours(evidence), evidence.logs
    if colours is None:
        return None
    fits = [evidence.fitted(logs=colours[:, c]) for c in range(colours.shape[1])]
    expected = np.stack([colours[:, c] - fit.residual for c, fit in enumerate(fits)], 1)
    scale = max(fit.scale for fit in fits) + 0.01
    own = np.abs(colours - expected).max(1)
    best = 0.0
    for one in range(colours.shape[1]):
        for two in range(one + 1, min(colours.shape[1], one + 4)):
            order = list(range(colours.shape[1]))
            order[one], order[two] = two, one
            other = np.abs(colours[:, order] - expected).max(1)
            struck = (weight > 0.3) & (own > 6 * scale) & (other < 0.35 * own)
            best = max(best, float(struck.mean()))
    return (min(100 * best, 10.0),)


def _late(evidence: Evidence) -> Figures | None:
    """The fall of the colours' error, in logs, where one channel is moved by a row: the best of both ways."""
    colours = _colours(evidence)
    if colours is None:
        return None
    raw = np.log(np.maximum(evidence.values, 1e-6 * evidence.values.mean() + 1e-300))
    best = -1.0
    for c in range(min(raw.shape[1], 3)):
        others = np.delete(raw, c, 1).mean(1)
        here = evidence.fitted(logs=raw[:, c] - others).scale
        for late in (-1, 1):
            there = evidence.fitted(logs=np.roll(raw[:, c], late) - others).scale
            best = max(best, math.log((here + 1e-3) / (there + 1e-3)))
    return (best,)


_MEASURE_AGAIN = "measure again, or take it out of the file"
_CHECK_GAINS = (
    f"check the lamp's and the detector's gain over their angles; {Advice('calibrate', 'rings')} divides it out"
)
CHECKS = (
    Check(
        "drift-in-time", _time, lambda f: f"the gain drifts along the rows by {math.exp(f[0]):.0%} RMS: the lamp",
        remedy=f"divide by the lamp's monitor, or by what {Advice('calibrate', 'rows')} estimates",
    ),
    Check(
        "drift-with-angle", _angle,
        lambda f: f"swapped directions differ by a smooth gain over the angle, {math.exp(f[0]):.0%} RMS",
        remedy=f"{_CHECK_GAINS}, {Advice('reciprocal', False)} follows the data",
    ),
    Check(
        "gains", _gains,
        lambda f: f"the gain differs from angle to angle, {math.exp(f[0]):.0%} RMS, from {math.exp(f[1]):.2f}"
        f" to {math.exp(f[2]):.2f}",
        remedy=_CHECK_GAINS,
    ),
    Check(
        "ring", _ring,
        lambda f: f"the ring at {'θo' if f[2] else 'θi'} = {f[3]:.3g}° is {abs(math.expm1(min(f[4], 5))):.0%}"
        f" {'darker' if f[4] < 0 else 'brighter'} than its neighbours; a narrow highlight between coarse rings can look"
        " like it",
        remedy=f"{_MEASURE_AGAIN}, or {Advice('calibrate', 'rings')}",
    ),
    Check(
        "shadow", shadow,
        lambda f: f"darker by {-math.expm1(-min(max(f[0], 0), 9)):.0%} near the light, as in an arm's shadow",
        remedy="leave out the samples within 8° of the light",
    ),
    Check(
        "channels", _channels, lambda f: f"{f[0]:.2g}% of the rows have two channels exchanged",
        remedy="exchange them in the file, or leave these rows out",
    ),
    Check(
        "channel-late", _late, lambda f: "a channel is a row late or early",
        remedy="move its column by one row",
    ),
)  # fmt: skip
