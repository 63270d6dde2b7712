"""How a triangular light divides among the bands of one or two angles (Ben-Artzi et al. 2006, appendix A, code 1).

Where y, a rising function of γ, is linear over a triangle, what share of it lies below a boundary follows from y at its
corners alone: with yA ≤ yB ≤ yC the share below y0 is (y0 − yA)²/((yB − yA)(yC − yA)) up to yB, and
1 − (yC − y0)²/((yC − yB)(yC − yA)) from there. The paper takes γ itself; here y is 2 sin(γ/2), as straight and without
arc functions.

A triangle counts as it is where y at the middles of its edges is that of a linear function, but for what moves no share
by more than `TOLERANCE` (none moves faster than 2/(yC − yA)) or no boundary by more than `SLACK` of a band. Elsewhere
shares of the whole and of the four triangles between the middles are compared. Where they agree the four are counted,
by their solid angles, and where they differ each of the four is divided again. Of two angles the four also count where
the triangle reaches into more than `CELLS` pairs of bands.

Two curves (eq. 25): a light adds the products of its shares in the bands of both, taken here over the last small
triangles, within which alone the angles are taken to be independent. What lies outside [0, π/2] counts to the nearest
band, so that the shares of every light add up to 1 and curves that are 1 give ∫ L V ρ_q cosθi, whatever their angles.
"""

from functools import lru_cache

import numpy as np

from homofact.linear.kernels import kernel
from homofact.scene.editing.angles import RIGHT_ANGLE, chord_at

# Shares that differ by less are alike; part of a band that is none; how often a light is divided at most.
TOLERANCE, SLACK, DEEPEST = 0.05, 0.03, 5
# Pairs of bands within which two angles count as independent though they could be told apart further.
CELLS = 16
_STACK = 3 * DEEPEST + 4
# Steps of y in which its band is looked up.
_STEPS = 1024


@lru_cache(maxsize=8)
def band_table(count: int) -> tuple[np.ndarray, np.ndarray]:
    """(y at the J + 1 edges of the bands, the band (steps,) that each step of y from 0 to √2 begins in)."""
    edges = 2 * np.sin(np.arange(count + 1) * (RIGHT_ANGLE / count) / 2)
    looked = np.searchsorted(edges, np.arange(_STEPS) * (edges[-1] / _STEPS), side="right") - 1
    return edges, np.clip(looked, 0, count - 1)


@kernel(error_model="numpy", forceinline=True)
def share_below(edge: float, a: float, b: float, c: float) -> float:  # pragma: no cover (compiled)
    """The share of a triangle's area where y < edge, y linear with a ≤ b ≤ c at the corners."""
    if edge <= a:
        return 0.0
    if edge >= c:
        return 1.0
    if edge <= b:
        return (edge - a) * (edge - a) / ((b - a) * (c - a))
    return 1.0 - (c - edge) * (c - edge) / ((c - b) * (c - a))


@kernel(error_model="numpy", forceinline=True)
def _below(edge: float, t: np.ndarray, k: int) -> float:  # pragma: no cover (compiled)
    """`share_below` of row k of (., 5) numbers: a, b, c and the two denominators' inverses."""
    if edge <= t[k, 0]:
        return 0.0
    if edge >= t[k, 2]:
        return 1.0
    if edge <= t[k, 1]:
        return (edge - t[k, 0]) * (edge - t[k, 0]) * t[k, 3]
    return 1.0 - (t[k, 2] - edge) * (t[k, 2] - edge) * t[k, 4]


@kernel(error_model="numpy", forceinline=True)
def _put(t: np.ndarray, k: int, u: float, v: float, w: float) -> None:  # pragma: no cover (compiled)
    """Row k for `_below`, from y at three corners in any order."""
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
def _four(y: np.ndarray, n: int, t: np.ndarray) -> None:  # pragma: no cover (compiled)
    """Rows of the four triangles (the middle one's number is 3), of y (., 6) in row n."""
    _put(t, 0, y[n, 0], y[n, 4], y[n, 5])
    _put(t, 1, y[n, 1], y[n, 3], y[n, 5])
    _put(t, 2, y[n, 2], y[n, 3], y[n, 4])
    _put(t, 3, y[n, 3], y[n, 4], y[n, 5])


@kernel(error_model="numpy", forceinline=True)
def _band(y: float, edges: np.ndarray, looked: np.ndarray) -> int:  # pragma: no cover (compiled)
    """The band that y lies in; what is outside counts to the nearest."""
    last = len(edges) - 2
    if y >= edges[last]:
        return last
    band = looked[int(y * (len(looked) / edges[last + 1]))]
    while y >= edges[band + 1]:
        band += 1
    return band


@kernel(error_model="numpy", forceinline=True)
def _range(y: np.ndarray, n: int) -> tuple[float, float]:  # pragma: no cover (compiled)
    low, high = y[n, 0], y[n, 0]
    for k in range(1, 6):
        low, high = min(low, y[n, k]), max(high, y[n, k])
    return low, high


@kernel(error_model="numpy", forceinline=True)
def _bend(y: np.ndarray, n: int) -> float:  # pragma: no cover (compiled)
    """How far the middles are from the means of their edges' ends at most."""
    off = abs(y[n, 3] - 0.5 * (y[n, 1] + y[n, 2]))
    off = max(off, abs(y[n, 4] - 0.5 * (y[n, 0] + y[n, 2])))
    return max(off, abs(y[n, 5] - 0.5 * (y[n, 0] + y[n, 1])))


@kernel(error_model="numpy", forceinline=True)
def _alike(
    t: np.ndarray, first: int, last: int, edges: np.ndarray, sizes: np.ndarray, m: int
) -> bool:  # pragma: no cover (compiled)
    """Whether the shares below all edges are alike, of the whole (row 4) and of its four together."""
    for band in range(first + 1, last + 1):
        parts = 0.0
        for k in range(4):
            parts += sizes[m, k] * _below(edges[band], t, k)
        if abs(_below(edges[band], t, 4) - parts) > TOLERANCE:
            return False
    return True


@kernel(error_model="numpy", forceinline=True)
def _shares(
    t: np.ndarray, k: int, edges: np.ndarray, looked: np.ndarray, part: float, shares: np.ndarray
) -> tuple[int, int]:  # pragma: no cover (compiled)
    """(first, last) band of row k of `t`; `part` times the share of each of these from the beginning of `shares`."""
    first, last = _band(t[k, 0], edges, looked), _band(t[k, 2], edges, looked)
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


@kernel(error_model="numpy", forceinline=True)
def _one_angle(
    light: np.ndarray, s: int, part: float, t: np.ndarray, k: int, edges: np.ndarray, looked: np.ndarray,
    shares: np.ndarray, sums: np.ndarray, times: int, more: int,
) -> None:  # pragma: no cover (compiled)  # fmt: skip
    """Add light s times `part` to the bands of `sums` (J·times·3,), number `more` of each, by row k of `t`."""
    first, last = _shares(t, k, edges, looked, part, shares)
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
    """The same for the bands of two angles, (J·K·3,), independent within the triangle."""
    lowest, highest = _shares(tb, k, edges_b, looked_b, part, shares)
    red, green, blue = light[s, 0], light[s, 1], light[s, 2]
    count = highest - lowest + 1
    for j in range(count):
        lit[3 * j], lit[3 * j + 1], lit[3 * j + 2] = shares[j] * red, shares[j] * green, shares[j] * blue
    first, last = _shares(ta, k, edges_a, looked_a, 1.0, shares)
    for i in range(last - first + 1):
        begin = 3 * ((first + i) * (len(edges_b) - 1) + lowest)
        of_a = shares[i]
        for q in range(3 * count):
            sums[begin + q] += of_a * lit[q]


@kernel(error_model="numpy", forceinline=True)
def _between(
    points: np.ndarray, n: int, one: np.ndarray, i: int, other: np.ndarray, j: int
) -> None:  # pragma: no cover (compiled)
    """Put the middle of two unit vectors, rows i and j, into row n of `points`."""
    x, y, z = one[i, 0] + other[j, 0], one[i, 1] + other[j, 1], one[i, 2] + other[j, 2]
    scale = 1.0 / np.sqrt(x * x + y * y + z * z)
    points[n, 0], points[n, 1], points[n, 2] = x * scale, y * scale, z * scale


@kernel(error_model="numpy")
def _divide(
    points: np.ndarray, n: int, kinds: tuple[int, int], ox: float, oy: float, oz: float, y: np.ndarray, z: np.ndarray,
    shares: np.ndarray, sizes: np.ndarray, m: int, made: np.ndarray, made_y: np.ndarray,
) -> None:  # pragma: no cover (compiled)  # fmt: skip
    """Put the four parts of the triangle in row n of the stack into its rows n … n + 3.

    `points` (., 6, 3) are corners and the middles opposite to them, `y` and `z` (., 6) the two angles there. The nine
    middles between corners and middles (3k + j: corner k and middle j ≠ k, k + k: the middles but k) go into `made`.
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
    vertices: np.ndarray, triangles: np.ndarray, middles: np.ndarray, sizes: np.ndarray, frames: np.ndarray,
    wo: np.ndarray, kinds: tuple[int, int], edges_a: np.ndarray, looked_a: np.ndarray, edges_b: np.ndarray,
    looked_b: np.ndarray, begins: np.ndarray, numbers: np.ndarray, light: np.ndarray, found: np.ndarray,
) -> None:  # pragma: no cover (compiled)  # fmt: skip
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
                low, high = _range(ya, depth)
                first, last = _band(low, edges_a, looked_a), _band(high, edges_a, looked_a)
                least, most, lowest, highest = 0.0, 0.0, 0, 0
                if two:
                    least, most = _range(yb, depth)
                    lowest, highest = _band(least, edges_b, looked_b), _band(most, edges_b, looked_b)
                share, level = shares[depth, 0], int(shares[depth, 1])
                if first == last and lowest == highest:
                    for c in range(3):
                        sums[3 * (first * count + lowest) + c] += share * light[s, c]
                    continue
                width = edges_a[first + 1] - edges_a[first]
                linear = first == last or _bend(ya, depth) <= max(0.5 * TOLERANCE * (high - low), SLACK * width)
                if two:
                    width = edges_b[lowest + 1] - edges_b[lowest]
                    fits = _bend(yb, depth) <= max(0.5 * TOLERANCE * (most - least), SLACK * width)
                    linear = linear and (lowest == highest or fits)
                if linear and lowest == highest:
                    _put(ta, 4, ya[depth, 0], ya[depth, 1], ya[depth, 2])
                    _one_angle(light, s, share, ta, 4, edges_a, looked_a, divided, sums, count, lowest)
                    continue
                if linear and first == last:
                    _put(tb, 4, yb[depth, 0], yb[depth, 1], yb[depth, 2])
                    _one_angle(light, s, share, tb, 4, edges_b, looked_b, divided, sums, 1, first * count)
                    continue
                if linear and two and (last - first + 1) * (highest - lowest + 1) <= CELLS:
                    _put(ta, 4, ya[depth, 0], ya[depth, 1], ya[depth, 2])
                    _put(tb, 4, yb[depth, 0], yb[depth, 1], yb[depth, 2])
                    _two_angles(light, s, share, ta, tb, 4, edges_a, looked_a, edges_b, looked_b, divided, lit, sums)
                    continue
                _four(ya, depth, ta)
                if two:
                    _four(yb, depth, tb)
                if not linear:
                    _put(ta, 4, ya[depth, 0], ya[depth, 1], ya[depth, 2])
                    linear = _alike(ta, first, last, edges_a, sizes, m)
                    if two:
                        _put(tb, 4, yb[depth, 0], yb[depth, 1], yb[depth, 2])
                        linear = linear and _alike(tb, lowest, highest, edges_b, sizes, m)
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
    vertices: np.ndarray, triangles: np.ndarray, middles: np.ndarray, sizes: np.ndarray, frames: np.ndarray,
    wo: np.ndarray, kinds: tuple[int, int], bands: tuple[int, int], begins: np.ndarray, numbers: np.ndarray,
    light: np.ndarray, found: np.ndarray,
) -> None:  # fmt: skip
    """T (eq. 21) or U (eq. 25) of P pixels, added to `found` (P, C, J·K).

    `vertices` (V, 3) in the world with `triangles`, `middles` (M, 3) into them and `sizes` (M, 4) as in
    `lights.TriangleLights`; `frames` (P, 3, 3), rows t, b, n; `wo` (P, 3) in them; pixel p sees the lights
    `numbers`[begins[p] … begins[p + 1]], of which `light` (S, C) is L V ρ_q cosθi Ω each. `kinds` are the angles'
    numbers in `ANGLES`, `bands` (J, K); without a second angle they are −1 and 1. Lets go of the interpreter's lock.
    """
    (edges_a, looked_a), (edges_b, looked_b) = band_table(bands[0]), band_table(bands[1])
    for begin in range(0, light.shape[1], 3):
        some = light[:, begin : begin + 3]
        # Three channels at a time, whatever their number.
        three = np.ascontiguousarray(some if some.shape[1] == 3 else np.pad(some, ((0, 0), (0, 3 - some.shape[1]))))
        _transport(
            vertices, triangles, middles, sizes, frames, wo, kinds, edges_a, looked_a, edges_b, looked_b, begins,
            numbers, three, found[:, begin : begin + 3],
        )  # fmt: skip
