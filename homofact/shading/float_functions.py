"""exp, log, atan2 and asinh in float32 as a few additions and products each, for loops that compilers vectorise.

A call of the C library prevents vectorisation. These functions have no calls, branches or tables. Each reduces its
argument and evaluates a polynomial, which is fitted to the exact function at Chebyshev nodes when the module is
imported:

    exp x   = 2^k exp r,      k = round(x/log 2), |r| ≤ log(2)/2
    log x   = k log 2 + log m,     x = 2^k m, m in [√½, √2), log m = t P(t²), t = (m − 1)/(m + 1)
    atan a  = a P(a²)         on [0, 1]; the other octants by symmetry

Their errors are a few units in the last place (tests/shading/test_compiled.py). 2^k and k are computed from the bits of
the floating-point number.
"""

import math
from typing import Any

import numpy as np
from numba import njit
from numpy.polynomial import Chebyshev, Polynomial


def _fitted(function: Any, low: float, high: float, degree: int) -> tuple[np.float32, ...]:
    """Coefficients, the constant one first, of the interpolant in Chebyshev nodes."""
    polynomial = Chebyshev.interpolate(function, degree, [low, high]).convert(kind=Polynomial, domain=[-1, 1])
    return tuple(np.float32(value) for value in polynomial.coef)


def _atan_part(squared: np.ndarray) -> np.ndarray:
    a = np.sqrt(np.maximum(squared, 1e-12))
    return np.arctan(a) / a


def _log_part(squared: np.ndarray) -> np.ndarray:
    t = np.sqrt(np.maximum(squared, 1e-12))
    return 2 * np.arctanh(t) / t


_HALF_LOG = math.log(2) / 2
_EXP = _fitted(np.exp, -_HALF_LOG, _HALF_LOG, 6)
_ATAN = _fitted(_atan_part, 0.0, 1.0, 9)
_LOG = _fitted(_log_part, 0.0, ((math.sqrt(2) - 1) / (math.sqrt(2) + 1)) ** 2, 4)
_ONE, _ZERO, _HALF = np.float32(1), np.float32(0), np.float32(0.5)
_LEAST, _MOST = np.float32(-87), np.float32(88)
_PER_LOG = np.float32(1 / math.log(2))
# log 2 in two parts: k times the first is exact.
_LOG_HIGH = np.float32(355 / 512)
_LOG_LOW = np.float32(math.log(2) - 355 / 512)
_LOG_TWO = np.float32(math.log(2))
_PI, _HALF_PI = np.float32(math.pi), np.float32(math.pi / 2)
_TINY = np.float32(1e-30)


@njit(fastmath=True, error_model="numpy")
def _polynomial(coefficients, x):  # pragma: no cover (compiled)
    value = coefficients[-1]
    for k in range(len(coefficients) - 2, -1, -1):
        value = value * x + coefficients[k]
    return value


@njit(fastmath=True, error_model="numpy")
def exp(x):  # pragma: no cover (compiled)
    """Return e^x, with x clamped to [−87, 88], the range of float32."""
    x = min(max(x, _LEAST), _MOST)
    k = np.floor(x * _PER_LOG + _HALF)
    r = x - k * _LOG_HIGH - k * _LOG_LOW
    bits = np.int32((np.int32(k) + np.int32(127)) << np.int32(23))
    return _polynomial(_EXP, r) * bits.view(np.float32)


@njit(fastmath=True, error_model="numpy")
def log(x):  # pragma: no cover (compiled)
    """log x of a normal number above 0."""
    bits = np.float32(x).view(np.int32)
    # The exponent as if the mantissa began at √½, whose bits these are.
    k = np.int32((bits - np.int32(0x3F3504F3)) >> np.int32(23))
    m = np.int32(bits - np.int32(k << np.int32(23))).view(np.float32)
    t = (m - _ONE) / (m + _ONE)
    return np.float32(k) * _LOG_TWO + t * _polynomial(_LOG, t * t)


@njit(fastmath=True, error_model="numpy")
def asinh(x):  # pragma: no cover (compiled)
    """Return asinh x for x ≥ 0, with an absolute error of about 1e-7."""
    return log(x + np.sqrt(x * x + _ONE))


@njit(fastmath=True, error_model="numpy")
def atan2(y, x):  # pragma: no cover (compiled)
    """The angle of (x, y) in (−π, π]; 0 at the origin."""
    a, b = abs(x), abs(y)
    low, high = min(a, b), max(a, b)
    ratio = low / max(high, _TINY)
    angle = ratio * _polynomial(_ATAN, ratio * ratio)
    angle = _HALF_PI - angle if b > a else angle
    angle = _PI - angle if x < _ZERO else angle
    return -angle if y < _ZERO else angle
