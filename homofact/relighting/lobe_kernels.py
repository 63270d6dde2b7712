"""The sum over a cube map's cells of a lobe's light: fine cells where the lobe is, coarse ones around it."""

import math
from typing import NamedTuple

import numpy as np
from numba import prange

from homofact.linear.kernels import kernel
from homofact.relighting.lobe_table import CROWDING, STEEPEST
from homofact.relighting.sight import seen_part
from homofact.relighting.slope_grid import FARTHEST, PEAK

# The widest cell, its extent in slopes of h as a part of the table's width w. Beyond slopes of `CORE` w it may grow
# with the slope, parts of a bright texel beyond `NEAR` w.
WIDEST, CORE, NEAR = 0.25, 0.7, 2.0
_LEAST = math.cos(STEEPEST)
_ROOT_CELLS = 64


class PointArrays(NamedTuple):
    """`SurfacePoints` as the sum reads them."""

    frames: np.ndarray
    views: np.ndarray
    corners: np.ndarray
    shares: np.ndarray


class CellArrays(NamedTuple):
    """`LightCells` as the sum reads them."""

    light: np.ndarray
    places: np.ndarray
    parts: np.ndarray
    starts: np.ndarray
    divisions: int


class TableArrays(NamedTuple):
    """`LobeTable` as the sum reads it."""

    values: np.ndarray
    width: float
    period: float
    whole: bool


class HalfSeenCells(NamedTuple):
    """Cells that the corners of a point see to different degrees: `found` (P,) per point, up to the room.

    `cells` (P, M) are their indices, `light` (P, M, 3) is the radiance towards the viewer if the whole cell is visible,
    and `seen` (P, M) the fraction of it that was summed. Cells and texels that can change the radiance by less than
    `least` are left out.
    """

    cells: np.ndarray
    light: np.ndarray
    seen: np.ndarray
    found: np.ndarray
    least: float

    @classmethod
    def room(cls, points: int, most: int, least: float = 0.0) -> "HalfSeenCells":
        """Allocate `most` cells per point."""
        light = np.zeros((points, most, 3), np.float32)
        return cls(np.zeros((points, most), np.int64), light, light[..., 0].copy(), np.zeros(points, np.int64), least)


@kernel(nogil=True, inline="always", fastmath=True)
def _added(grid, a, b, own, found):  # pragma: no cover (compiled)
    """Return `found` plus `own` times a bilinear lookup at (a, b) in a grid of half vectors, 3 values."""
    i, j = min(int(a), grid.shape[0] - 2), min(int(b), grid.shape[1] - 2)
    a, b = a - np.float32(i), b - np.float32(j)
    one = np.float32(1)
    w00, w01 = own * (one - a) * (one - b), own * (one - a) * b
    w10, w11 = own * a * (one - b), own * a * b
    near, far = grid[i], grid[i + 1]
    return (
        found[0] + w00 * near[j, 0] + w01 * near[j + 1, 0] + w10 * far[j, 0] + w11 * far[j + 1, 0],
        found[1] + w00 * near[j, 1] + w01 * near[j + 1, 1] + w10 * far[j, 1] + w11 * far[j + 1, 1],
        found[2] + w00 * near[j, 2] + w01 * near[j + 1, 2] + w10 * far[j, 2] + w11 * far[j + 1, 2],
    )


@kernel(nogil=True, inline="always", fastmath=True)
def _times(f, light, share):  # pragma: no cover (compiled)
    """Return three values times light times a share."""
    return share * f[0] * light[0], share * f[1] * light[1], share * f[2] * light[2]


@kernel(nogil=True, inline="always", fastmath=True)
def _seen_between(sight, corners, shares, face, place, size):  # pragma: no cover (compiled)
    """Return a cell's visible part, interpolated from the corners, and the least and greatest corner values."""
    seen, fewest, most = np.float32(0), np.float32(1), np.float32(0)
    for c in range(3):
        if shares[c] > 0:
            part = seen_part(sight, corners[c], face, place, size)
            seen += shares[c] * part
            fewest, most = min(fewest, part), max(most, part)
    return seen, fewest, most


@kernel(nogil=True)
def _note(half_seen, p, cell, sent, seen, oz):  # pragma: no cover (compiled)
    """Record a cell for the point p if there is room."""
    cells, light, parts, found, _ = half_seen
    n = found[p]
    if n < cells.shape[1]:
        cells[p, n], parts[p, n], found[p] = cell, seen, n + 1
        for c in range(3):
            light[p, n, c] = sent[c] / oz


@kernel(nogil=True, parallel=True, fastmath=True)
def sum_lobe(points, sight, cells, lobe, out, half_seen):  # pragma: no cover (compiled)
    """Radiance `out` (P, 3) of a lobe at points with frames (P, 3, 3) in the world, towards views (P, 3) in them.

    The visibility at a point is interpolated from the vertices `corners` (P, 3) with the weights `shares` (P, 3).
    `sight` is a `SightArrays`, and `half_seen` a `HalfSeenCells`.
    """
    table, width, period, circle = lobe
    light, places, parts, starts, divisions = cells
    count = len(parts)
    frames, views, corners, shares = points
    room, least = half_seen[0].shape[1], half_seen[4]
    levels, turns = table.shape[0], table.shape[1]
    top = len(starts) - 1
    texels = np.int64(_ROOT_CELLS) << (2 * top)
    sights = sight.texels
    finer = 0
    while (sights << (2 * finer)) < texels:
        finer += 1
    one, half = np.float32(1), np.float32(0.5)
    w, widest, tail, close = np.float32(width), np.float32(WIDEST), np.float32(1 - CORE), np.float32(NEAR * width)
    # Places on the grid, as `slope_grid` has them, times the steps between its nodes.
    steep = np.float32(PEAK / width)
    along = np.float32((table.shape[2] - 1) / math.log1p(FARTHEST * PEAK / width))
    around, last = np.float32((table.shape[3] - 1) / (4 if circle else 2)), np.float32(table.shape[2] - 1)
    for p in prange(len(frames)):
        ox, oy, oz = views[p, 0], views[p, 1], views[p, 2]
        out[p, 0], out[p, 1], out[p, 2] = 0, 0, 0
        if oz <= 0:
            continue
        if oz < _LEAST:
            # Raised to the last level.
            raised = math.sqrt((one - np.float32(_LEAST * _LEAST)) / max(ox * ox + oy * oy, np.float32(1e-12)))
            ox, oy, oz = ox * raised, oy * raised, np.float32(_LEAST)
        from_last = max(one - math.acos(min(oz, one)) / np.float32(STEEPEST), 0.0)
        level = (one - from_last ** (1 / CROWDING)) * (levels - 1)
        low = min(int(level), levels - 2)
        up = np.float32(min(level - low, 1.0))
        across = math.sqrt(ox * ox + oy * oy)
        ca, sa = one, np.float32(0)
        if across > 1e-6:
            ca, sa = ox / across, oy / across
        turn = math.atan2(oy, ox) / period
        turn = (turn - math.floor(turn)) * turns
        first = int(turn) % turns
        over = np.float32(turn - int(turn)) if turns > 1 else np.float32(0)
        second = (first + 1) % turns
        fx, fy, fz = frames[p, 0], frames[p, 1], frames[p, 2]
        red, green, blue = np.float32(0), np.float32(0), np.float32(0)
        bright = False
        for face in range(6):
            place, k = np.int64(0), top
            while place < texels:
                cell = starts[k] + ((face * texels + place) >> (2 * k))
                here = parts[cell] if k < divisions else places[cell - count]
                dx, dy, dz, wide = here[0], here[1], here[2], here[3]
                z = fz[0] * dx + fz[1] * dy + fz[2] * dz
                extent = abs(wide)
                divided = False
                if k >= divisions:
                    # Of the parts of a texel, which come after it, too.
                    bright = wide < 0
                if z > -half * extent - half * half * extent:
                    x = fx[0] * dx + fx[1] * dy + fx[2] * dz
                    y = fy[0] * dx + fy[1] * dy + fy[2] * dz
                    short = one / (max(z, np.float32(0)) + oz)
                    hx, hy = (x + ox) * short, (y + oy) * short
                    slope = math.sqrt(hx * hx + hy * hy)
                    within, own = extent * short, max(w, slope + tail * w)
                    if bright and k <= divisions and slope < close + within:
                        own = w
                    divided = k > 0 and ((bright and k > divisions) or within > widest * own)
                    if not divided and z > 0:
                        size, at = np.int64(1) << (2 * max(k - finer, 0)), place >> (2 * finer)
                        seen, fewest, most = _seen_between(sight, corners[p], shares[p], face, at, size)
                        if seen > 0:
                            ux, uy = ca * hx + sa * hy, ca * hy - sa * hx
                            side = ux / max(abs(ux) + abs(uy), np.float32(1e-30))
                            a = min(math.log(one + slope * steep) * along, last)
                            b = (np.float32(3) + side if circle and uy < 0 else one - side) * around
                            f = (np.float32(0), np.float32(0), np.float32(0))
                            for step in range(2):
                                own = up if step else one - up
                                f = _added(table[low + step, first], a, b, own * (one - over), f)
                                if turns > 1:
                                    f = _added(table[low + step, second], a, b, own * over, f)
                            # The parts of a texel have its light.
                            whole = max(k, divisions)
                            own_light = light[starts[whole] - count + ((face * texels + place) >> (2 * whole))]
                            sent = _times(f, own_light, extent * extent)
                            red += seen * sent[0]
                            green += seen * sent[1]
                            blue += seen * sent[2]
                            # Parts of a texel are asked for their part of the light.
                            asked = 3 * least * oz / np.float32(1 << (2 * max(divisions - k, 0)))
                            if room > 0 and (most - fewest) * abs(sent[0] + sent[1] + sent[2]) > asked:
                                _note(half_seen, p, cell, sent, seen, oz)
                if divided:
                    k -= 1
                else:
                    place += np.int64(1) << (2 * k)
                    while k < top and (place >> (2 * k)) & 3 == 0:
                        k += 1
        # The cosine of the light is in the table; that of the view is not.
        out[p, 0], out[p, 1], out[p, 2] = red / oz, green / oz, blue / oz
