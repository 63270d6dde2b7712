"""How a triangular light divides among the bands of one or two angles (Ben-Artzi et al. 2006, appendix A, code 1).

Where γ is linear over a triangle, what share of it lies below a boundary follows from γ at its corners alone: with
yA ≤ yB ≤ yC the share below y0 is (y0 − yA)²/((yB − yA)(yC − yA)) up to yB, and 1 − (yC − y0)²/((yC − yB)(yC − yA))
from there. A triangle is divided into four at the middles of its edges, and where the shares of the four add up to
others than the triangle's own, γ is not linear, and each of them is divided again. The four count by their solid
angles. Shares need not be compared where every middle's γ is so near to the mean of its edge's ends that they can
differ by no more: no share moves faster than 2/(yC − yA).

Two curves (eq. 25): a light adds the products of its shares in the bands of both, taken here over the last small
triangles, within which alone the angles are taken to be independent. What lies outside [0, π/2] counts to the nearest
band, so that the shares of every light add up to 1 and curves that are 1 give ∫ L V ρ_q cosθi, whatever their angles.
"""

import numpy as np

from homofact.linear.kernels import kernel
from homofact.scene.editing.angles import RIGHT_ANGLE, angle_at

# Shares that differ by less are alike; how often a light is divided at most.
TOLERANCE, DEEPEST = 0.05, 5
_STACK = 3 * DEEPEST + 4


@kernel()
def share_below(edge: float, a: float, b: float, c: float) -> float:  # pragma: no cover (compiled)
    """The share of a triangle's area where γ < edge, γ linear with a ≤ b ≤ c at the corners."""
    if edge <= a:
        return 0.0
    if edge >= c:
        return 1.0
    if edge <= b:
        return (edge - a) * (edge - a) / ((b - a) * (c - a))
    return 1.0 - (c - edge) * (c - edge) / ((c - b) * (c - a))


@kernel()
def _below(edge: float, t: np.ndarray, k: int) -> float:  # pragma: no cover (compiled)
    """`share_below` of row k of (., 5) numbers: a, b, c and the two denominators' inverses."""
    if edge <= t[k, 0]:
        return 0.0
    if edge >= t[k, 2]:
        return 1.0
    if edge <= t[k, 1]:
        return (edge - t[k, 0]) * (edge - t[k, 0]) * t[k, 3]
    return 1.0 - (t[k, 2] - edge) * (t[k, 2] - edge) * t[k, 4]


@kernel()
def _put(t: np.ndarray, k: int, a: float, b: float, c: float) -> None:  # pragma: no cover (compiled)
    """Row k for `_below`, from γ at three corners in any order."""
    if a > b:
        a, b = b, a
    if b > c:
        b, c = c, b
    if a > b:
        a, b = b, a
    t[k, 0], t[k, 1], t[k, 2] = a, b, c
    t[k, 3] = 1.0 / ((b - a) * (c - a)) if b > a else 0.0
    t[k, 4] = 1.0 / ((c - b) * (c - a)) if c > b else 0.0


@kernel()
def _five(y: np.ndarray, n: int, t: np.ndarray) -> None:  # pragma: no cover (compiled)
    """Rows of the four triangles (the middle one's number is 3) and of the whole (4), of γ (., 6) in row n of `y`."""
    _put(t, 0, y[n, 0], y[n, 4], y[n, 5])
    _put(t, 1, y[n, 1], y[n, 3], y[n, 5])
    _put(t, 2, y[n, 2], y[n, 3], y[n, 4])
    _put(t, 3, y[n, 3], y[n, 4], y[n, 5])
    _put(t, 4, y[n, 0], y[n, 1], y[n, 2])


@kernel()
def _band(y: float, count: int) -> int:  # pragma: no cover (compiled)
    return min(max(int(np.floor(y)), 0), count - 1)


@kernel()
def _range(y: np.ndarray, n: int) -> tuple[float, float]:  # pragma: no cover (compiled)
    low, high = y[n, 0], y[n, 0]
    for k in range(1, 6):
        low, high = min(low, y[n, k]), max(high, y[n, k])
    return low, high


@kernel()
def _is_linear(
    y: np.ndarray, n: int, low: float, high: float, t: np.ndarray, sizes: np.ndarray, m: int, count: int
) -> bool:  # pragma: no cover (compiled)
    """Whether the shares below all boundaries are alike, of the whole and of its four together."""
    off = abs(y[n, 3] - 0.5 * (y[n, 1] + y[n, 2]))
    off = max(off, abs(y[n, 4] - 0.5 * (y[n, 0] + y[n, 2])))
    off = max(off, abs(y[n, 5] - 0.5 * (y[n, 0] + y[n, 1])))
    if 2 * off <= TOLERANCE * (high - low):
        return True
    for edge in range(_band(low, count) + 1, _band(high, count) + 1):
        parts = 0.0
        for k in range(4):
            parts += sizes[m, k] * _below(edge, t, k)
        if abs(_below(edge, t, 4) - parts) > TOLERANCE:
            return False
    return True


@kernel()
def _deposit(
    light: np.ndarray, s: int, share: float, ta: np.ndarray, tb: np.ndarray, sizes: np.ndarray, m: int,
    bands: tuple[int, int], found: np.ndarray, p: int,
) -> None:  # pragma: no cover (compiled)  # fmt: skip
    """Add light s times `share` to pixel p of `found` (P, C, J·K), each of the four triangles by itself."""
    channels = light.shape[1]
    for k in range(4):
        part = share * sizes[m, k]
        first, last = _band(ta[k, 0], bands[0]), _band(ta[k, 2], bands[0])
        below = 0.0
        if bands[1] == 1:
            for i in range(first, last + 1):
                upto = _below(i + 1.0, ta, k) if i < last else 1.0
                for c in range(channels):
                    found[p, c, i] += part * (upto - below) * light[s, c]
                below = upto
            continue
        lowest, highest = _band(tb[k, 0], bands[1]), _band(tb[k, 2], bands[1])
        for i in range(first, last + 1):
            upto = _below(i + 1.0, ta, k) if i < last else 1.0
            of_a = part * (upto - below)
            below, under = upto, 0.0
            for j in range(lowest, highest + 1):
                to = _below(j + 1.0, tb, k) if j < highest else 1.0
                for c in range(channels):
                    found[p, c, i * bands[1] + j] += of_a * (to - under) * light[s, c]
                under = to


@kernel()
def _divide(
    triangles: np.ndarray, n: int, kinds: tuple[int, int], bands: tuple[int, int], wo: np.ndarray, p: int,
    a: np.ndarray, b: np.ndarray, shares: np.ndarray, sizes: np.ndarray, m: int,
) -> None:  # pragma: no cover (compiled)  # fmt: skip
    """Put the four parts of the triangle in row n of the stack into its rows n … n + 3."""
    corners, middles = triangles[n].copy(), np.empty((3, 3))
    for k in range(3):
        length = 0.0
        for i in range(3):
            middles[k, i] = corners[(k + 1) % 3, i] + corners[(k + 2) % 3, i]
            length += middles[k, i] ** 2
        for i in range(3):
            middles[k, i] /= np.sqrt(length)
    share, level = shares[n, 0], shares[n, 1] + 1
    for child in range(4):
        for k in range(3):
            for i in range(3):
                triangles[n + child, k, i] = (
                    corners[k, i] if k == child else middles[k if child == 3 else 3 - k - child, i]
                )
        shares[n + child, 0], shares[n + child, 1] = share * sizes[m, child], level
        for k in range(3):
            one, other = triangles[n + child, (k + 1) % 3], triangles[n + child, (k + 2) % 3]
            x, y, z = triangles[n + child, k]
            u, v, w = one[0] + other[0], one[1] + other[1], one[2] + other[2]
            length = np.sqrt(u * u + v * v + w * w)
            u, v, w = u / length, v / length, w / length
            a[n + child, k] = bands[0] / RIGHT_ANGLE * angle_at(kinds[0], x, y, z, wo[p, 0], wo[p, 1], wo[p, 2])
            a[n + child, k + 3] = bands[0] / RIGHT_ANGLE * angle_at(kinds[0], u, v, w, wo[p, 0], wo[p, 1], wo[p, 2])
            if kinds[1] >= 0:
                b[n + child, k] = bands[1] / RIGHT_ANGLE * angle_at(kinds[1], x, y, z, wo[p, 0], wo[p, 1], wo[p, 2])
                b[n + child, k + 3] = bands[1] / RIGHT_ANGLE * angle_at(kinds[1], u, v, w, wo[p, 0], wo[p, 1], wo[p, 2])
            else:
                b[n + child, k], b[n + child, k + 3] = 0.0, 0.0


@kernel(nogil=True)
def transport(
    vertices: np.ndarray, triangles: np.ndarray, middles: np.ndarray, sizes: np.ndarray, frames: np.ndarray,
    wo: np.ndarray, kinds: tuple[int, int], bands: tuple[int, int], begins: np.ndarray, numbers: np.ndarray,
    light: np.ndarray, found: np.ndarray,
) -> None:  # pragma: no cover (compiled)  # fmt: skip
    """T (eq. 21) or U (eq. 25) of P pixels, added to `found` (P, C, J·K).

    `vertices` (V, 3) in the world with `triangles`, `middles` (M, 3) into them and `sizes` (M, 4) as in
    `lights.TriangleLights`; `frames` (P, 3, 3), rows t, b, n; `wo` (P, 3) in them; pixel p sees the lights
    `numbers`[begins[p] … begins[p + 1]], of which `light` (S, C) is L V ρ_q cosθi Ω each. `kinds` are the angles'
    numbers in `ANGLES`, `bands` (J, K); without a second angle they are −1 and 1.
    """
    local = np.empty_like(vertices)
    all_a, all_b = np.empty(len(vertices)), np.zeros(len(vertices))
    last_pixel = np.full(len(vertices), -1)
    corners, ya, yb, shares = (
        np.empty((_STACK, 3, 3)),
        np.empty((_STACK, 6)),
        np.empty((_STACK, 6)),
        np.empty((_STACK, 2)),
    )
    ta, tb = np.empty((5, 5)), np.empty((5, 5))
    for p in range(len(frames)):
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
                    all_a[v] = bands[0] / RIGHT_ANGLE * angle_at(kinds[0], x, y, z, wo[p, 0], wo[p, 1], wo[p, 2])
                    if kinds[1] >= 0:
                        all_b[v] = bands[1] / RIGHT_ANGLE * angle_at(kinds[1], x, y, z, wo[p, 0], wo[p, 1], wo[p, 2])
                ya[0, k], yb[0, k] = all_a[v], all_b[v]
            shares[0, 0], shares[0, 1] = 1.0, 0.0
            depth = 1
            while depth > 0:
                depth -= 1
                low, high = _range(ya, depth)
                least, most = _range(yb, depth)
                share, level = shares[depth, 0], int(shares[depth, 1])
                first, lowest = _band(low, bands[0]), _band(least, bands[1])
                if first == _band(high, bands[0]) and lowest == _band(most, bands[1]):
                    for c in range(light.shape[1]):
                        found[p, c, first * bands[1] + lowest] += share * light[s, c]
                    continue
                _five(ya, depth, ta)
                _five(yb, depth, tb)
                if level == DEEPEST or (
                    _is_linear(ya, depth, low, high, ta, sizes, m, bands[0])
                    and _is_linear(yb, depth, least, most, tb, sizes, m, bands[1])
                ):
                    _deposit(light, s, share, ta, tb, sizes, m, bands, found, p)
                    continue
                if level == 0:
                    for k in range(3):
                        for i in range(3):
                            corners[0, k, i] = local[triangles[m, k], i]
                _divide(corners, depth, kinds, bands, wo, p, ya, yb, shares, sizes, m)
                depth += 4
