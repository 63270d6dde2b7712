"""How a triangular light divides among the bands of one or two angles (Ben-Artzi et al. 2006, appendix A, code 1).

Where γ is linear over a triangle, what share of it lies below a boundary follows from γ at its corners alone: with
yA ≤ yB ≤ yC the share below y0 is (y0 − yA)²/((yB − yA)(yC − yA)) up to yB, and 1 − (yC − y0)²/((yC − yB)(yC − yA))
from there. A triangle is divided into four at the middles of its edges, and where the shares of the four add up to
others than the triangle's own, γ is not linear, and each of them is divided again. The four count by their solid
angles.

Two curves (eq. 25): a light adds the products of its shares in the bands of both, taken here over the last small
triangles, within which alone the angles are taken to be independent. What lies outside [0, π/2] counts to the nearest
band, so that the shares of every light add up to 1 and curves that are 1 give ∫ L V ρ_q cosθi, whatever their angles.
"""

import numpy as np

from homofact.linear.kernels import kernel
from homofact.scene.editing.angles import RIGHT_ANGLE, angle_at, angles_at

# Shares that differ by less are alike; how often a light is divided at most.
TOLERANCE, DEEPEST = 0.02, 5
_STACK = 4 * DEEPEST + 4


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
def _ordered(a: float, b: float, c: float) -> tuple[float, float, float]:  # pragma: no cover (compiled)
    if a > b:
        a, b = b, a
    if b > c:
        b, c = c, b
    if a > b:
        a, b = b, a
    return a, b, c


@kernel()
def _band(y: float, count: int) -> int:  # pragma: no cover (compiled)
    return min(max(int(np.floor(y)), 0), count - 1)


@kernel()
def _size(t: np.ndarray) -> float:  # pragma: no cover (compiled)
    """tan(Ω/2) of a spherical triangle (3, 3), which is Ω/2 where it is small."""
    volume = (
        t[0, 0] * (t[1, 1] * t[2, 2] - t[1, 2] * t[2, 1])
        - t[0, 1] * (t[1, 0] * t[2, 2] - t[1, 2] * t[2, 0])
        + t[0, 2] * (t[1, 0] * t[2, 1] - t[1, 1] * t[2, 0])
    )
    dots = 1.0
    for k in range(3):
        for i in range(3):
            dots += t[k, i] * t[(k + 1) % 3, i]
    return abs(volume) / max(dots, 1e-12)


@kernel()
def _four(corners: np.ndarray, children: np.ndarray) -> None:  # pragma: no cover (compiled)
    """Fill `children` (4, 3, 3) with the triangles at the corners (3, 3), the middle one last."""
    for k in range(3):
        length = 0.0
        for i in range(3):
            children[3, k, i] = corners[(k + 1) % 3, i] + corners[(k + 2) % 3, i]
            length += children[3, k, i] ** 2
        length = np.sqrt(length)
        for i in range(3):
            children[3, k, i] /= length
    for k in range(3):
        for i in range(3):
            children[k, k, i] = corners[k, i]
            children[k, (k + 1) % 3, i] = children[3, (k + 2) % 3, i]
            children[k, (k + 2) % 3, i] = children[3, (k + 1) % 3, i]


@kernel()
def _values_of_four(corners: np.ndarray, middles: np.ndarray, values: np.ndarray) -> None:  # pragma: no cover
    """Fill `values` (4, 3) with γ at the corners of the four, in ascending order, from γ at corners and middles (3,)."""
    for k in range(3):
        values[k, 0], values[k, 1], values[k, 2] = _ordered(corners[k], middles[(k + 1) % 3], middles[(k + 2) % 3])
    values[3, 0], values[3, 1], values[3, 2] = _ordered(middles[0], middles[1], middles[2])


@kernel()
def _is_linear(
    corners: np.ndarray, values: np.ndarray, sizes: np.ndarray, first: int, last: int
) -> bool:  # pragma: no cover (compiled)
    """Whether the shares below the boundaries first + 1 … last are alike, of the whole and of its four together."""
    a, b, c = _ordered(corners[0], corners[1], corners[2])
    for edge in range(first + 1, last + 1):
        whole, parts = share_below(edge, a, b, c), 0.0
        for k in range(4):
            parts += sizes[k] * share_below(edge, values[k, 0], values[k, 1], values[k, 2])
        if abs(whole - parts) > TOLERANCE:
            return False
    return True


@kernel()
def _deposit(
    light: np.ndarray, a: np.ndarray, b: np.ndarray, sizes: np.ndarray, share: float, bands: tuple[int, int],
    found: np.ndarray,
) -> None:  # pragma: no cover (compiled)  # fmt: skip
    """Add light (C,) times `share` to `found` (J·K, C) by the four triangles' angles a, b (4, 3), ascending, in bands."""
    for k in range(4):
        first, last = _band(a[k, 0], bands[0]), _band(a[k, 2], bands[0])
        below = 0.0
        for i in range(first, last + 1):
            upto = share_below(i + 1.0, a[k, 0], a[k, 1], a[k, 2]) if i < last else 1.0
            of_a = (upto - below) * sizes[k] * share
            below = upto
            if bands[1] == 1:
                for c in range(len(light)):
                    found[i, c] += of_a * light[c]
                continue
            lowest, highest = _band(b[k, 0], bands[1]), _band(b[k, 2], bands[1])
            under = 0.0
            for j in range(lowest, highest + 1):
                to = share_below(j + 1.0, b[k, 0], b[k, 1], b[k, 2]) if j < highest else 1.0
                for c in range(len(light)):
                    found[i * bands[1] + j, c] += of_a * (to - under) * light[c]
                under = to


@kernel()
def add_light(
    light: np.ndarray, corners: np.ndarray, a: np.ndarray, b: np.ndarray, wo: np.ndarray, kinds: tuple[int, int],
    bands: tuple[int, int], found: np.ndarray, work: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray],
) -> None:  # pragma: no cover (compiled)  # fmt: skip
    """Add one light to the bands `found` (J·K, C).

    `light` (C,) is L V ρ_q cosθi Ω; `corners` (3, 3) in the surface frame; a and b (6,) the two angles in bands at
    corners and middles (`kinds`: their numbers in `ANGLES`); K is 1 without a second. `work` is room for the stack.
    """
    triangles, angles_a, angles_b, shares = work
    four, values_a, values_b, sizes = np.empty((4, 3, 3)), np.empty((4, 3)), np.empty((4, 3)), np.empty(4)
    triangles[0], angles_a[0], angles_b[0], shares[0, 0], shares[0, 1] = corners, a, b, 1.0, 0.0
    depth = 1
    while depth > 0:
        depth -= 1
        ya, yb, share, level = angles_a[depth], angles_b[depth], shares[depth, 0], int(shares[depth, 1])
        first, last = _band(ya.min(), bands[0]), _band(ya.max(), bands[0])
        lowest, highest = _band(yb.min(), bands[1]), _band(yb.max(), bands[1])
        if first == last and lowest == highest:
            for c in range(len(light)):
                found[first * bands[1] + lowest, c] += share * light[c]
            continue
        _four(triangles[depth], four)
        total = 0.0
        for k in range(4):
            sizes[k] = _size(four[k])
            total += sizes[k]
        for k in range(4):
            sizes[k] /= total
        _values_of_four(ya[:3], ya[3:], values_a)
        _values_of_four(yb[:3], yb[3:], values_b)
        linear = _is_linear(ya, values_a, sizes, first, last) and _is_linear(yb, values_b, sizes, lowest, highest)
        if linear or level == DEEPEST:
            _deposit(light, values_a, values_b, sizes, share, bands, found)
            continue
        for k in range(4):
            triangles[depth + k] = four[k]
            shares[depth + k, 0], shares[depth + k, 1] = share * sizes[k], level + 1.0
            _angles_of(four[k], kinds[0], bands[0], wo, angles_a[depth + k])
            _angles_of(four[k], kinds[1], bands[1], wo, angles_b[depth + k])
        depth += 4


@kernel()
def _angles_of(
    corners: np.ndarray, kind: int, bands: int, wo: np.ndarray, found: np.ndarray
) -> None:  # pragma: no cover (compiled)
    """Fill `found` (6,) with γ in bands at the corners (3, 3) and the middles of the edges opposite to them."""
    if kind < 0:
        found[:] = 0.0
        return
    scale = bands / RIGHT_ANGLE
    for k in range(3):
        x, y, z = corners[k, 0], corners[k, 1], corners[k, 2]
        found[k] = scale * angle_at(kind, x, y, z, wo[0], wo[1], wo[2])
        x = corners[(k + 1) % 3, 0] + corners[(k + 2) % 3, 0]
        y = corners[(k + 1) % 3, 1] + corners[(k + 2) % 3, 1]
        z = corners[(k + 1) % 3, 2] + corners[(k + 2) % 3, 2]
        length = np.sqrt(x * x + y * y + z * z)
        found[k + 3] = scale * angle_at(kind, x / length, y / length, z / length, wo[0], wo[1], wo[2])


@kernel(nogil=True)
def transport(
    vertices: np.ndarray, triangles: np.ndarray, middles: np.ndarray, frames: np.ndarray, wo: np.ndarray,
    kinds: tuple[int, int], bands: tuple[int, int], begins: np.ndarray, numbers: np.ndarray, light: np.ndarray,
    found: np.ndarray,
) -> None:  # pragma: no cover (compiled)  # fmt: skip
    """T (eq. 21) or U (eq. 25) of P pixels, added to `found` (P, J·K, C).

    `vertices` (V, 3) in the world with `triangles` and `middles` (M, 3) into them (`lights.TriangleLights`); `frames`
    (P, 3, 3), rows t, b, n; `wo` (P, 3) in them; pixel p sees the lights `numbers`[begins[p] … begins[p + 1]], of
    which `light` (S, C) is L V ρ_q cosθi Ω each. `kinds` and `bands` as in `add_light`; no second angle is −1 and 1.
    """
    local = np.empty_like(vertices)
    all_a, all_b = np.empty(len(vertices)), np.zeros(len(vertices))
    corners, a, b = np.empty((3, 3)), np.empty(6), np.empty(6)
    work = (np.empty((_STACK, 3, 3)), np.empty((_STACK, 6)), np.empty((_STACK, 6)), np.empty((_STACK, 2)))
    for p in range(len(frames)):
        if begins[p] == begins[p + 1]:
            continue
        for v in range(len(vertices)):
            for i in range(3):
                local[v, i] = (
                    frames[p, i, 0] * vertices[v, 0] + frames[p, i, 1] * vertices[v, 1] + frames[p, i, 2] * vertices[v, 2]
                )
        angles_at(kinds[0], local, wo[p], all_a)
        all_a *= bands[0] / RIGHT_ANGLE
        if kinds[1] >= 0:
            angles_at(kinds[1], local, wo[p], all_b)
            all_b *= bands[1] / RIGHT_ANGLE
        for s in range(begins[p], begins[p + 1]):
            m = numbers[s]
            for k in range(3):
                for i in range(3):
                    corners[k, i] = local[triangles[m, k], i]
                a[k], a[k + 3] = all_a[triangles[m, k]], all_a[middles[m, k]]
                b[k], b[k + 3] = all_b[triangles[m, k]], all_b[middles[m, k]]
            add_light(light[s], corners, a, b, wo[p], kinds, bands, found[p], work)
