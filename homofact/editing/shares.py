"""Compute the share of a triangle in each band of an angle, from the angle at its corners alone.

See `overlap`, whose compiled parts these are: y is 2 sin(γ/2), linear over the triangle.
"""

from functools import lru_cache

import numpy as np

from homofact.editing.curves import band_edges
from homofact.linear.kernels import kernel

# Shares that differ by less are alike.
TOLERANCE = 0.05
# Steps of y in which its band is looked up.
_STEPS = 1024


@lru_cache(maxsize=8)
def band_table(count: int, finer: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Return (y at the J + 1 edges of the bands, the band (steps,) that each step of y from 0 to √2 begins in)."""
    edges = 2 * np.sin(band_edges(count, finer).numpy() / 2)
    looked = np.searchsorted(edges, np.arange(_STEPS) * (edges[-1] / _STEPS), side="right") - 1
    return edges, np.clip(looked, 0, count - 1)


@kernel(error_model="numpy", forceinline=True)
def below(edge: float, t: np.ndarray, k: int) -> float:  # pragma: no cover (compiled)
    """The share of a triangle's area where y < edge, of row k of (., 5): a, b, c and two denominators' inverses."""
    if edge <= t[k, 0]:
        return 0.0
    if edge >= t[k, 2]:
        return 1.0
    if edge <= t[k, 1]:
        return (edge - t[k, 0]) * (edge - t[k, 0]) * t[k, 3]
    return 1.0 - (t[k, 2] - edge) * (t[k, 2] - edge) * t[k, 4]


@kernel(error_model="numpy", forceinline=True)
def put_corners(t: np.ndarray, k: int, u: float, v: float, w: float) -> None:  # pragma: no cover (compiled)
    """Row k for `below`, from y at three corners in any order."""
    # Conditional expressions, no branches: which one is the least is anyone's guess.
    low, high = (u if u < v else v), (v if u < v else u)
    a, c = (low if low < w else w), (high if high > w else w)
    inner = high if high < w else w
    b = low if low > inner else inner
    t[k, 0], t[k, 1], t[k, 2] = a, b, c
    product = (b - a) * (c - b) * (c - a)
    if product > 0:
        inverse = 1.0 / product
        t[k, 3], t[k, 4] = (c - b) * inverse, (b - a) * inverse
    else:
        t[k, 3] = 1.0 / ((b - a) * (c - a)) if b > a else 0.0
        t[k, 4] = 1.0 / ((c - b) * (c - a)) if c > b else 0.0


@kernel(error_model="numpy", forceinline=True)
def put_four(y: np.ndarray, n: int, t: np.ndarray) -> None:  # pragma: no cover (compiled)
    """Rows of the four triangles (the middle one's number is 3), of y (., 6) in row n."""
    put_corners(t, 0, y[n, 0], y[n, 4], y[n, 5])
    put_corners(t, 1, y[n, 1], y[n, 3], y[n, 5])
    put_corners(t, 2, y[n, 2], y[n, 3], y[n, 4])
    put_corners(t, 3, y[n, 3], y[n, 4], y[n, 5])


@kernel(error_model="numpy", forceinline=True)
def band_at(y: float, edges: np.ndarray, looked: np.ndarray) -> int:  # pragma: no cover (compiled)
    """Return the band that y lies in; what is outside counts to the nearest."""
    last = len(edges) - 2
    if y >= edges[last]:
        return last
    band = looked[int(y * (len(looked) / edges[last + 1]))]
    while y >= edges[band + 1]:
        band += 1
    return band


@kernel(error_model="numpy", forceinline=True)
def value_range(y: np.ndarray, n: int) -> tuple[float, float]:  # pragma: no cover (compiled)
    """Return the least and the greatest of the six values in row n."""
    low, high = y[n, 0], y[n, 0]
    for k in range(1, 6):
        low, high = min(low, y[n, k]), max(high, y[n, k])
    return low, high


@kernel(error_model="numpy", forceinline=True)
def bend(y: np.ndarray, n: int) -> float:  # pragma: no cover (compiled)
    """Return how far the middles are from the means of their edges' ends at most."""
    off = abs(y[n, 3] - 0.5 * (y[n, 1] + y[n, 2]))
    off = max(off, abs(y[n, 4] - 0.5 * (y[n, 0] + y[n, 2])))
    return max(off, abs(y[n, 5] - 0.5 * (y[n, 0] + y[n, 1])))


@kernel(error_model="numpy", forceinline=True)
def alike(
    t: np.ndarray, first: int, last: int, edges: np.ndarray, sizes: np.ndarray, m: int
) -> bool:  # pragma: no cover (compiled)
    """Return whether the whole triangle (row 4) and its four parts have the same shares below all edges."""
    for band in range(first + 1, last + 1):
        parts = 0.0
        for k in range(4):
            parts += sizes[m, k] * below(edges[band], t, k)
        if abs(below(edges[band], t, 4) - parts) > TOLERANCE:
            return False
    return True


@kernel(error_model="numpy", forceinline=True)
def band_shares(
    t: np.ndarray, k: int, edges: np.ndarray, looked: np.ndarray, part: float, shares: np.ndarray
) -> tuple[int, int]:  # pragma: no cover (compiled)
    """Write `part` times the share of each band of row k to `shares`, from 0 on; return (first, last) band."""
    first, last = band_at(t[k, 0], edges, looked), band_at(t[k, 2], edges, looked)
    a, b, c, rise, fall = t[k, 0], t[k, 1], t[k, 2], part * t[k, 3], part * t[k, 4]
    below, i = 0.0, first
    while i < last and edges[i + 1] <= b:
        upto = (edges[i + 1] - a) * (edges[i + 1] - a) * rise
        shares[i - first] = upto - below
        below = upto
        i += 1
    while i < last:
        upto = part - (c - edges[i + 1]) * (c - edges[i + 1]) * fall
        shares[i - first] = upto - below
        below = upto
        i += 1
    shares[last - first] = part - below
    return first, last
