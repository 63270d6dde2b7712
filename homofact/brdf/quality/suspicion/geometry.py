"""Detect wrong directions: elevation instead of zenith angle, an azimuth off by 180°, radians instead of degrees.

Wrong directions keep the values, but move the highlight off the mirror direction and make the data less smooth over
directions: the azimuth then matters at θ = 0 and does not at the horizon. So the smooth reciprocal fit is made twice,
to the data as read and to the corrected data. The figures are the logs of the ratio of the two errors, at the median
and at the 95% quantile of the residuals. A material without a highlight gives no evidence, but this fault hardly
changes its data either.
"""

import math
from collections.abc import Callable

import numpy as np

from homofact.brdf.quality.suspicion.check import Check, Figures
from homofact.brdf.quality.suspicion.evidence import Evidence
from homofact.brdf.quality.suspicion.undo import UNDO

_MOST_DEGREES = 1.6  # π/2 read as degrees, and a little
_FLOOR = 1e-3


def gain(evidence: Evidence, other: Evidence) -> Figures:
    """Return the log ratios of the errors of the fits to the data as read and to `other` directions.

    Both fits also have terms for a gain over the angle, so an extra cosine is not mistaken for a wrong direction.
    """
    errors = []
    for one in (evidence, other):
        fit, (_, weight) = one.fitted(odd_columns(one)), one.logs
        missed = np.abs(fit.residual)[weight > 0.1]
        errors.append((fit.scale + _FLOOR, (float(np.quantile(missed, 0.95)) if len(missed) else 0.0) + _FLOOR))
    return tuple(math.log(here / there) for here, there in zip(*errors, strict=True))


def odd_columns(evidence: Evidence) -> np.ndarray:
    """Return columns (N, 4) that break reciprocity smoothly: functions of θi minus the same functions of θo."""
    theta_i, theta_o = (np.arccos(np.clip(w[:, 2], 0, 1)) / (math.pi / 2) for w in (evidence.wi, evidence.wo))
    cos_i, cos_o = evidence.cosines
    powers = [theta_i**k - theta_o**k for k in (1, 2, 4)]
    return np.stack([*powers, np.log(cos_i) - np.log(cos_o)], 1)


def _undone(name: str) -> Callable[[Evidence], Figures | None]:
    def figures(evidence: Evidence) -> Figures | None:
        turned = UNDO[name].apply(evidence.samples())
        if len(turned) < len(evidence):
            return None
        return gain(evidence, evidence.with_directions(turned.wi.numpy(), turned.wo.numpy()))

    return figures


def _radians(evidence: Evidence) -> Figures | None:
    """How far the largest θ is under π/2 taken as degrees, in degrees, at most 5 over it."""
    largest = math.degrees(math.acos(np.clip(min(evidence.wi[:, 2].min(), evidence.wo[:, 2].min()), -1, 1)))
    return (max(_MOST_DEGREES - largest, -5.0),)


NAMES = ("elevation", "elevation-i", "elevation-o", "azimuth")
CHECKS = (
    Check("radians", _radians, undo="radians"),
    *(Check(name, _undone(name), undo=name) for name in NAMES),
)
