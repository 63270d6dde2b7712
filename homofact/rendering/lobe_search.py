"""The search for the lobes of one viewer: Nelder and Mead's simplex, compiled together with what it minimises.

The searched numbers x of K lobes are a level and a tilt for each; for an anisotropic material five: level and tilt of a
middle lobe, then level, tilt and spread of two equal lobes on both sides of it. The search minimises

    E/scale + Σ |x − clip(x)| + SMOOTH Σ price (x − x')²,

where E is that of `rendering.lobe_levels` and x' are the numbers of the neighbouring viewer, if there is one. The
simplex moves as that of scipy.optimize (Nelder and Mead 1965; Lagarias et al. 1998). It is compiled here because scipy
would need more time for the calls than for the function itself.
"""

import math
from typing import NamedTuple

import numpy as np

from homofact.linear.kernels import kernel
from homofact.rendering.lobe_levels import energy

SMOOTH = 1e-3
CLOSE, FLAT_ENOUGH = 1e-3, 1e-7  # of the simplex, in x and in value, where the search ends


class Seen(NamedTuple):
    """The flux of a material for viewers at one θo, as input of `energy`, with each viewer at azimuth 0.

    `grains` (T, 3) are g, `towards` (M, 3) ωi, and `flux` (T, M, C) f cosθi dω. `whole` (2, C) has two means over all
    azimuths: the sum of the flux, which is the albedo, and its `pull_of` for the last level.
    """

    theta: float
    grains: np.ndarray
    towards: np.ndarray
    flux: np.ndarray
    whole: np.ndarray


class Bounds(NamedTuple):
    """The searched numbers' `least` and `most`, and the `price` of a change, (n,) each.

    `paired` is true for a middle lobe and a pair; if `signed`, shares may be negative.
    """

    least: np.ndarray
    most: np.ndarray
    price: np.ndarray
    paired: bool
    signed: bool


@kernel(nogil=True)
def lobes_of(x, paired):  # pragma: no cover (compiled)
    """Levels, tilts and spreads (K, 3) of the searched numbers."""
    if paired:
        lobes = np.zeros((3, 3))
        lobes[0, 0], lobes[0, 1] = x[0], x[1]
        for k in range(1, 3):
            lobes[k, 0], lobes[k, 1] = x[2], x[3]
        lobes[1, 2], lobes[2, 2] = x[4], -x[4]
        return lobes
    lobes = np.zeros((len(x) // 2, 3))
    for k in range(len(lobes)):
        lobes[k, 0], lobes[k, 1] = x[2 * k], x[2 * k + 1]
    return lobes


@kernel(nogil=True)
def axes_of(theta, grains, lobes):  # pragma: no cover (compiled)
    """The lobes' directions (T, K, 3) from levels, tilts and spreads (K, 3)."""
    axes = np.empty((len(grains), len(lobes), 3))
    sine, cosine = math.sin(theta), math.cos(theta)
    for turn in range(len(grains)):
        for k in range(len(lobes)):
            hx, hy = lobes[k, 2] * grains[turn, 0], lobes[k, 2] * grains[turn, 1]
            hz = 1 + lobes[k, 2] * grains[turn, 2]
            along, square = 2 * (hx * sine + hz * cosine), hx * hx + hy * hy + hz * hz
            x, y, z = along * hx - square * sine, along * hy, along * hz - square * cosine + lobes[k, 1]
            length = math.sqrt(x * x + y * y + z * z)
            axes[turn, k, 0], axes[turn, k, 1], axes[turn, k, 2] = x / length, y / length, z / length
    return axes


@kernel(nogil=True)
def reflected(x, seen, known, bounds):  # pragma: no cover (compiled)
    """Return (E minus a constant, the best shares (K + 1, C)) of the lobes with these numbers."""
    lobes = lobes_of(x, bounds.paired)
    axes, levels = axes_of(seen.theta, seen.grains, lobes), lobes[:, 0].copy()
    return energy(axes, levels, seen.towards, seen.flux, seen.whole, known.potential, known.overlap, bounds.signed)


@kernel(nogil=True)
def value_of(x, before, scale, seen, known, bounds):  # pragma: no cover (compiled)
    """Return the minimised value; `before` (n,) are the neighbour's numbers, (0,) if there is none."""
    value = reflected(x, seen, known, bounds)[0] / scale
    for k in range(len(x)):
        value += max(bounds.least[k] - x[k], 0.0) + max(x[k] - bounds.most[k], 0.0)
        if len(before) > 0:
            value += SMOOTH * bounds.price[k] * (x[k] - before[k]) ** 2
    return value


@kernel(nogil=True)
def simplex(start, first, most, before, scale, seen, known, bounds):  # pragma: no cover (compiled)
    """Minimise from `start` with first steps `first` (n,), within `most` evaluations; return the numbers (n,)."""
    count = len(start)
    corners, values = np.empty((count + 1, count)), np.empty(count + 1)
    for k in range(count + 1):
        for i in range(count):
            corners[k, i] = start[i] + (first[i] if k == i + 1 else 0.0)
        values[k] = value_of(corners[k], before, scale, seen, known, bounds)
    asked = count + 1
    middle, near, far = np.empty(count), np.empty(count), np.empty(count)
    while asked < most:
        _sort(corners, values)
        if values[count] - values[0] <= FLAT_ENOUGH and _width(corners) <= CLOSE:
            break
        for i in range(count):
            middle[i] = 0.0
            for k in range(count):
                middle[i] += corners[k, i] / count
        found = _moved(near, 1.0, middle, corners[count], before, scale, seen, known, bounds)
        asked += 1
        if found < values[count - 1]:
            further = math.inf
            if found < values[0] and asked < most:
                further = _moved(far, 2.0, middle, corners[count], before, scale, seen, known, bounds)
                asked += 1
            if further < found:
                _put(corners, values, count, far, further)
            else:
                _put(corners, values, count, near, found)
            continue
        if asked >= most:
            break
        outside = found < values[count]
        way = 0.5 if outside else -0.5
        nearer = _moved(near, way, middle, corners[count], before, scale, seen, known, bounds)
        asked += 1
        if (outside and nearer <= found) or (not outside and nearer < values[count]):
            _put(corners, values, count, near, nearer)
            continue
        for k in range(1, count + 1):
            if asked < most:
                _put(
                    corners,
                    values,
                    k,
                    near,
                    _moved(near, -0.5, corners[0], corners[k], before, scale, seen, known, bounds),
                )
                asked += 1
    _sort(corners, values)
    return corners[0].copy()


@kernel(nogil=True)
def _moved(place, way, middle, corner, before, scale, seen, known, bounds):  # pragma: no cover (compiled)
    """The value at middle + way (middle − corner), put into `place`."""
    for i in range(len(place)):
        place[i] = middle[i] + way * (middle[i] - corner[i])
    return value_of(place, before, scale, seen, known, bounds)


@kernel(nogil=True)
def _put(corners, values, k, place, value):  # pragma: no cover (compiled)
    """Make a place corner k."""
    values[k] = value
    for i in range(len(place)):
        corners[k, i] = place[i]


@kernel(nogil=True)
def _sort(corners, values):  # pragma: no cover (compiled)
    """Order the corners by their values, in place: they are few."""
    for k in range(1, len(values)):
        j = k
        while j > 0 and values[j] < values[j - 1]:
            values[j], values[j - 1] = values[j - 1], values[j]
            for i in range(corners.shape[1]):
                corners[j, i], corners[j - 1, i] = corners[j - 1, i], corners[j, i]
            j -= 1


@kernel(nogil=True)
def _width(corners):  # pragma: no cover (compiled)
    """The largest difference of a number from that of the first corner."""
    widest = 0.0
    for k in range(1, len(corners)):
        for i in range(corners.shape[1]):
            widest = max(widest, abs(corners[k, i] - corners[0, i]))
    return widest
