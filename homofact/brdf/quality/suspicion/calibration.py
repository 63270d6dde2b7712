"""Convert the figures of a check to odds: weights and an offset of the log odds for every check.

They are set by hand, so that the odds change between the figures of clean samples and those of samples with simulated
faults (`scripts/verdict/planting.py`), nearer to the latter. The odds express a degree of suspicion; they are not
measured frequencies.
"""

import math
from collections.abc import Sequence

SAID = 50.0  # odds under which nothing is said
# Of the exponents of cosines in real measurements (paints of Cornell and RGL: up to 0.6 off), and of the base's in
# surrogates of MERL.
RECIPROCITY_SPREAD = 0.25
BASE_EXPONENT, BASE_SPREAD = 0.02, 0.25
_COSINE = ((1.0,), -2.0)
_DIRECTION = ((6.0, 6.0), -3.0)
LOGISTIC: dict[str, tuple[tuple[float, ...], float]] = {
    "radians": ((40.0,), 8.0),
    "elevation": _DIRECTION,
    "elevation-i": _DIRECTION,
    "elevation-o": _DIRECTION,
    "azimuth": ((5.0, 5.0), -4.0),  # a retroreflector is as likely where the gain is small
    "quantised": ((20.0, 3.0), -4.0),
    "clipped": ((4.0,), -3.0),
    "zeros": ((2.0,), -1.0),
    "cosine-o": _COSINE,
    "cosine-i": _COSINE,
    "cosines": _COSINE,
    "cosine-o-squared": _COSINE,
    "cosine-i-squared": _COSINE,
    "per-cosine-o": _COSINE,
    "per-cosine-i": _COSINE,
    "per-cosines": _COSINE,
    "pi": ((12.0,), 0.0),
    "drift-in-time": ((2.0, 12.0), 5.5),
    "drift-with-angle": ((2.0, 4.0), 4.8),
    "gains": ((12.0, 0.0, 0.0), 40.9),  # even at 3.3% RMS; clean draws: under 2%
    "ring": ((1.5, 4.0, 0.0, 0.0, 0.0), -3.3),
    "shadow": ((8.0, 0.4), -3.3),
    "channels": ((2.0,), -2.0),
    "channel-late": ((3.0,), -1.5),
}
_MOST_LOG_ODDS = math.log(1e30)


def log_odds(name: str, figures: Sequence[float]) -> float:
    """Return the log odds of the fault `name` against none, given its figures; the prior odds are 1."""
    weights, offset = LOGISTIC[name]
    odds = offset + sum(weight * figure for weight, figure in zip(weights, figures, strict=True))
    return min(max(odds, -_MOST_LOG_ODDS), _MOST_LOG_ODDS)
