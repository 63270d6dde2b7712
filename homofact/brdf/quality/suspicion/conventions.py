"""Detect factors of cosines or π by which the values are too large or too small.

A factor cosθi^p cosθo^q is detected from two exponents. The difference q − p breaks reciprocity: it is the coefficient
of ½ (log cosθo − log cosθi), added to the smooth reciprocal fit. The sum p + q follows from the statistics of real
materials: away from the highlight their values hardly depend on the cosines, so the fitted exponent of cosθi cosθo is
(p + q)/2. Both are compared with their values without the factor, as normal deviates whose spread comes from the
calibration.

A factor of π is detected only by energy: an albedo above 1. A dark material times π is a plausible brighter material,
and f/π a plausible darker one, so neither can be detected.
"""

import math
from collections.abc import Callable
from functools import lru_cache

import numpy as np

from homofact.brdf.quality.suspicion.base import base_of
from homofact.brdf.quality.suspicion.calibration import BASE_EXPONENT, BASE_SPREAD, RECIPROCITY_SPREAD
from homofact.brdf.quality.suspicion.check import Check, Figures
from homofact.brdf.quality.suspicion.evidence import Evidence

_LEAST = 0.2  # cosines below this graze, where few measurements are to be trusted
_FEWEST = 100
POWERS = {
    "cosine-o": (0, 1), "cosine-i": (1, 0), "cosines": (1, 1), "cosine-o-squared": (0, 2), "cosine-i-squared": (2, 0),
    "per-cosine-o": (0, -1), "per-cosine-i": (-1, 0), "per-cosines": (-1, -1),
}  # fmt: skip


@lru_cache(maxsize=4)
def exponents(evidence: Evidence) -> tuple[float, float] | None:
    """Return (q − p, (p + q)/2) of the module's head; None where too few samples are away from grazing."""
    base = base_of(evidence)
    cos_i, cos_o = evidence.cosines
    inner = (cos_i > _LEAST) & (cos_o > _LEAST) & (evidence.brightness > 0)
    # Where all lights are at one angle, cosθi is a constant and the symmetric part takes what cosθo has.
    if base is None or inner.sum() < _FEWEST or np.std(np.log(cos_i[inner])) < 0.02:
        return None
    part = Evidence(evidence.wi[inner], evidence.wo[inner], evidence.values[inner], evidence.place[inner])
    odd = 0.5 * (np.log(cos_o[inner]) - np.log(cos_i[inner]))
    return float(part.fitted(odd[:, None]).further[0]), base[0]


def _ratio(power_i: int, power_o: int) -> Callable[[Evidence], Figures | None]:
    """The log likelihood ratio of a factor with these powers, as the only figure."""

    def figures(evidence: Evidence) -> Figures | None:
        measured = exponents(evidence)
        if measured is None:
            return None
        odd, even = measured[0], measured[1] - BASE_EXPONENT
        off_odd, off_even = power_o - power_i, (power_i + power_o) / 2
        gain = (odd**2 - (odd - off_odd) ** 2) / (2 * RECIPROCITY_SPREAD**2)
        gain += (even**2 - (even - off_even) ** 2) / (2 * BASE_SPREAD**2)
        return (gain,)

    return figures


def _albedo(evidence: Evidence) -> Figures | None:
    """The log of the base's albedo."""
    base = base_of(evidence)
    return None if base is None or base[1] <= 0 else (math.log(base[1]),)


CHECKS = (
    *(Check(name, _ratio(*powers), undo=name) for name, powers in POWERS.items()),
    Check(
        "pi", _albedo, lambda f: f"more light out than in ({math.exp(f[0]):.2g} from the base alone): times π or so",
        undo="pi",
    ),
)  # fmt: skip
