"""How a triangular light divides among the bands of one or two angles (Ben-Artzi et al. 2006, appendix A, code 1).

If y, a rising function of γ, is linear over a triangle, the share of the triangle below a boundary follows from y at
its corners: with yA ≤ yB ≤ yC the share below y0 is (y0 − yA)²/((yB − yA)(yC − yA)) up to yB, and 1 − (yC − y0)²/((yC −
yB)(yC − yA)) from there. The paper uses γ itself. Here y is 2 sin(γ/2), which is equally close to linear and needs no
arc functions.

A triangle is used undivided if y at the midpoints of its edges is close to a linear function: the deviation must move
no share by more than `TOLERANCE` (no share moves faster than 2/(yC − yA)), or no boundary by more than `SLACK` of a
band. Otherwise the shares of the whole triangle are compared with those of the four triangles between the midpoints. If
they agree, the four are used, weighted by their solid angles; if they differ, each of the four is divided again. With
two angles, the four are also used if the triangle overlaps more than `CELLS` pairs of bands.

For two curves (eq. 25), a light adds the products of its shares in the bands of both curves. Here the products are
computed on the smallest triangles, so the two angles are assumed independent only within these. Angles outside [0, π/2]
are assigned to the nearest band. So the shares of every light add up to 1, and curves equal to 1 give ∫ L V ρ_q cosθi
for all angles.
"""

from typing import NamedTuple

import numpy as np

from homofact.editing.angles import ANGLES, PEAKED, chord_at
from homofact.editing.lights import TriangleLights
from homofact.editing.shares import (
    TOLERANCE,
    alike,
    band_at,
    band_shares,
    band_table,
    bend,
    put_corners,
    put_four,
    value_range,
)
from homofact.linear.kernels import kernel
from homofact.scene.visibility import VisiblePixels

# Part of a band that is none; how often a light is divided at most.
SLACK, DEEPEST = 0.03, 5
# Pairs of bands within which two angles count as independent though they could be told apart further.
CELLS = 16
_STACK = 3 * DEEPEST + 4


class VisibleLights(NamedTuple):
    """The S lights that P pixels see: pixel p sees the lights `numbers`[begins[p] … begins[p + 1]].

    `light` (S, C) is L V ρ_q cosθi Ω of each.
    """

    begins: np.ndarray
    numbers: np.ndarray
    light: np.ndarray


class _Shapes(NamedTuple):
    """The geometric arrays of `TriangleLights`."""

    vertices: np.ndarray
    triangles: np.ndarray
    middles: np.ndarray
    sizes: np.ndarray


class _BandTables(NamedTuple):
    """The results of `band_table` for both angles."""

    edges_a: np.ndarray
    looked_a: np.ndarray
    edges_b: np.ndarray
    looked_b: np.ndarray


@kernel(error_model="numpy", forceinline=True)
def _one_angle(
    light: np.ndarray, s: int, part: float, t: np.ndarray, k: int, edges: np.ndarray, looked: np.ndarray,
    shares: np.ndarray, sums: np.ndarray, times: int, more: int,
) -> None:  # pragma: no cover (compiled)  # fmt: skip
    """Add `part` of light s to entry `more` of the bands in `sums` (J·times·3,), shared by row k of `t`."""
    first, last = band_shares(t, k, edges, looked, part, shares)
    red, green, blue = light[s, 0], light[s, 1], light[s, 2]
    for i in range(last - first + 1):
        place = 3 * ((first + i) * times + more)
        sums[place] += shares[i] * red
        sums[place + 1] += shares[i] * green
        sums[place + 2] += shares[i] * blue


@kernel(error_model="numpy", forceinline=True)
def _two_angles(
    light: np.ndarray, s: int, part: float, ta: np.ndarray, tb: np.ndarray, k: int, edges_a: np.ndarray,
    looked_a: np.ndarray, edges_b: np.ndarray, looked_b: np.ndarray, shares: np.ndarray, lit: np.ndarray,
    sums: np.ndarray,
) -> None:  # pragma: no cover (compiled)  # fmt: skip
    """Add a light to bands of two angles, (J·K·3,), as if the angles were independent in the triangle."""
    lowest, highest = band_shares(tb, k, edges_b, looked_b, part, shares)
    red, green, blue = light[s, 0], light[s, 1], light[s, 2]
    count = highest - lowest + 1
    for j in range(count):
        lit[3 * j], lit[3 * j + 1], lit[3 * j + 2] = shares[j] * red, shares[j] * green, shares[j] * blue
    first, last = band_shares(ta, k, edges_a, looked_a, 1.0, shares)
    for i in range(last - first + 1):
        begin = 3 * ((first + i) * (len(edges_b) - 1) + lowest)
        of_a = shares[i]
        for q in range(3 * count):
            sums[begin + q] += of_a * lit[q]


@kernel(error_model="numpy", forceinline=True)
def _between(
    points: np.ndarray, n: int, one: np.ndarray, i: int, other: np.ndarray, j: int
) -> None:  # pragma: no cover (compiled)
    """Write the normalized mean of two unit vectors, rows i and j, into row n of `points`."""
    x, y, z = one[i, 0] + other[j, 0], one[i, 1] + other[j, 1], one[i, 2] + other[j, 2]
    scale = 1.0 / np.sqrt(x * x + y * y + z * z)
    points[n, 0], points[n, 1], points[n, 2] = x * scale, y * scale, z * scale


@kernel(error_model="numpy")
def _divide(
    points: np.ndarray, n: int, kinds: tuple[int, int], ox: float, oy: float, oz: float, y: np.ndarray, z: np.ndarray,
    shares: np.ndarray, sizes: np.ndarray, m: int, made: np.ndarray, made_y: np.ndarray,
) -> None:  # pragma: no cover (compiled)  # fmt: skip
    """Replace the triangle in row n of the stack by its four parts in rows n … n + 3.

    `points` (., 6, 3) are the corners and the midpoints of the opposite edges; `y` and `z` (., 6) are the two angles
    there. `made` receives nine midpoints. Entry 3k + j lies between corner k and midpoint j ≠ k. Entry 4k lies between
    the two midpoints other than k.
    """
    own = points[n]
    for k in range(3):
        for j in range(3):
            if j == k:
                _between(made, 4 * k, own, 3 + (k + 1) % 3, own, 3 + (k + 2) % 3)
            else:
                _between(made, 3 * k + j, own, k, own, 3 + j)
    for k in range(6):
        for i in range(3):
            made[9 + k, i] = own[k, i]
        made_y[0, 9 + k], made_y[1, 9 + k] = y[n, k], z[n, k]
    for k in range(9):
        made_y[0, k] = chord_at(kinds[0], made[k, 0], made[k, 1], made[k, 2], ox, oy, oz)
        if kinds[1] >= 0:
            made_y[1, k] = chord_at(kinds[1], made[k, 0], made[k, 1], made[k, 2], ox, oy, oz)
    share, level = shares[n, 0], shares[n, 1] + 1
    for child in range(4):
        shares[n + child, 0], shares[n + child, 1] = share * sizes[m, child], level
        for k in range(6):
            if k < 3:
                # A corner of the light, or the middle that is opposite to the corner left over.
                found = 9 + k if k == child else 12 + (k if child == 3 else 3 - k - child)
            else:
                found = 4 * (k - 3) if child == 3 else 3 * child + k - 3
            for i in range(3):
                points[n + child, k, i] = made[found, i]
            y[n + child, k], z[n + child, k] = made_y[0, found], made_y[1, found]


@kernel(nogil=True, error_model="numpy")
def _transport(
    shapes: _Shapes, frames: np.ndarray, wo: np.ndarray, kinds: tuple[int, int], tables: _BandTables,
    seen: VisibleLights, found: np.ndarray,
) -> None:  # pragma: no cover (compiled)  # fmt: skip
    # Taken apart here: in the loops, each access would count references.
    vertices, triangles, middles, sizes = shapes
    edges_a, looked_a, edges_b, looked_b = tables
    begins, numbers, light = seen
    local = np.empty_like(vertices)
    all_a, all_b = np.empty(len(vertices)), np.zeros(len(vertices))
    last_pixel = np.full(len(vertices), -1)
    points, ya, yb = np.empty((_STACK, 6, 3)), np.empty((_STACK, 6)), np.zeros((_STACK, 6))
    shares, ta, tb = np.empty((_STACK, 2)), np.empty((5, 5)), np.empty((5, 5))
    two, count = kinds[1] >= 0, len(edges_b) - 1
    # Channels side by side: the bands of a pixel are written in no order.
    sums = np.empty(3 * found.shape[2])
    divided = np.empty(max(len(edges_a), len(edges_b)))
    lit = np.empty(3 * len(edges_b))
    made, made_y = np.empty((15, 3)), np.zeros((2, 15))
    for p in range(len(frames)):
        sums[:] = 0.0
        ox, oy, oz = wo[p, 0], wo[p, 1], wo[p, 2]
        for s in range(begins[p], begins[p + 1]):
            m = numbers[s]
            for k in range(6):
                v = triangles[m, k] if k < 3 else middles[m, k - 3]
                if last_pixel[v] != p:
                    last_pixel[v] = p
                    for i in range(3):
                        local[v, i] = (
                            frames[p, i, 0] * vertices[v, 0]
                            + frames[p, i, 1] * vertices[v, 1]
                            + frames[p, i, 2] * vertices[v, 2]
                        )
                    x, y, z = local[v, 0], local[v, 1], local[v, 2]
                    all_a[v] = chord_at(kinds[0], x, y, z, ox, oy, oz)
                    if two:
                        all_b[v] = chord_at(kinds[1], x, y, z, ox, oy, oz)
                ya[0, k], yb[0, k] = all_a[v], all_b[v]
            shares[0, 0], shares[0, 1] = 1.0, 0.0
            depth = 1
            while depth > 0:
                depth -= 1
                low, high = value_range(ya, depth)
                first, last = band_at(low, edges_a, looked_a), band_at(high, edges_a, looked_a)
                least, most, lowest, highest = 0.0, 0.0, 0, 0
                if two:
                    least, most = value_range(yb, depth)
                    lowest, highest = band_at(least, edges_b, looked_b), band_at(most, edges_b, looked_b)
                share, level = shares[depth, 0], int(shares[depth, 1])
                if first == last and lowest == highest:
                    for c in range(3):
                        sums[3 * (first * count + lowest) + c] += share * light[s, c]
                    continue
                width = edges_a[first + 1] - edges_a[first]
                linear = first == last or bend(ya, depth) <= max(0.5 * TOLERANCE * (high - low), SLACK * width)
                if two:
                    width = edges_b[lowest + 1] - edges_b[lowest]
                    fits = bend(yb, depth) <= max(0.5 * TOLERANCE * (most - least), SLACK * width)
                    linear = linear and (lowest == highest or fits)
                if linear and lowest == highest:
                    put_corners(ta, 4, ya[depth, 0], ya[depth, 1], ya[depth, 2])
                    _one_angle(light, s, share, ta, 4, edges_a, looked_a, divided, sums, count, lowest)
                    continue
                if linear and first == last:
                    put_corners(tb, 4, yb[depth, 0], yb[depth, 1], yb[depth, 2])
                    _one_angle(light, s, share, tb, 4, edges_b, looked_b, divided, sums, 1, first * count)
                    continue
                if linear and two and (last - first + 1) * (highest - lowest + 1) <= CELLS:
                    put_corners(ta, 4, ya[depth, 0], ya[depth, 1], ya[depth, 2])
                    put_corners(tb, 4, yb[depth, 0], yb[depth, 1], yb[depth, 2])
                    _two_angles(light, s, share, ta, tb, 4, edges_a, looked_a, edges_b, looked_b, divided, lit, sums)
                    continue
                put_four(ya, depth, ta)
                if two:
                    put_four(yb, depth, tb)
                if not linear:
                    put_corners(ta, 4, ya[depth, 0], ya[depth, 1], ya[depth, 2])
                    linear = alike(ta, first, last, edges_a, sizes, m)
                    if two:
                        put_corners(tb, 4, yb[depth, 0], yb[depth, 1], yb[depth, 2])
                        linear = linear and alike(tb, lowest, highest, edges_b, sizes, m)
                if linear or level == DEEPEST:
                    for k in range(4):
                        part = share * sizes[m, k]
                        if two:
                            _two_angles(
                                light, s, part, ta, tb, k, edges_a, looked_a, edges_b, looked_b, divided, lit, sums
                            )
                        else:
                            _one_angle(light, s, part, ta, k, edges_a, looked_a, divided, sums, 1, 0)
                    continue
                if level == 0:
                    for k in range(6):
                        v = triangles[m, k] if k < 3 else middles[m, k - 3]
                        for i in range(3):
                            points[0, k, i] = local[v, i]
                _divide(points, depth, kinds, ox, oy, oz, ya, yb, shares, sizes, m, made, made_y)
                depth += 4
        for c in range(found.shape[1]):
            for j in range(found.shape[2]):
                found[p, c, j] += sums[3 * j + c]


def transport(
    lights: TriangleLights,
    pixels: VisiblePixels,
    kinds: tuple[int, int],
    bands: tuple[int, int],
    seen: VisibleLights,
    found: np.ndarray,
) -> None:
    """T (eq. 21) or U (eq. 25) of P pixels, added to `found` (P, C, J·K).

    `kinds` are the angles' numbers in `ANGLES`, `bands` (J, K); without a second angle they are −1 and 1. Releases the
    GIL.
    """
    shapes = _Shapes(lights.vertices, lights.triangles, lights.middles, lights.sizes)
    first, second = (kind >= 0 and ANGLES[kind] in PEAKED for kind in kinds)
    tables = _BandTables(*band_table(bands[0], first), *band_table(bands[1], second))
    for begin in range(0, seen.light.shape[1], 3):
        some = seen.light[:, begin : begin + 3]
        # Three channels at a time, whatever their number.
        three = np.ascontiguousarray(some if some.shape[1] == 3 else np.pad(some, ((0, 0), (0, 3 - some.shape[1]))))
        own = seen._replace(light=three)
        _transport(shapes, pixels.frames, pixels.wo, kinds, tables, own, found[:, begin : begin + 3])
