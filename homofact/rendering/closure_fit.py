"""The sum of closures (`rendering.closures`) that reflects skies most like a material.

For viewers at every θo the closures minimise the error under natural skies of `rendering.lobe_levels`,

    E(Δ) = ∫∫ Δ(ω) G(ω·ω') Δ(ω') dω dω' + FLAT ∫ Δ² dω,   G(cosγ) = −ln((1 − cosγ)/2)/(4π) + a constant,

Δ the difference in f cosθi, integrated by the nodes of `geometry.quadrature`. FLAT represents small lamps. The closures
reflect as much light as the material for every θo and channel, so they are exact under uniform light and a constant in
G does not matter. The weights are ≥ 0 and are solved directly for given shapes of the lobes. Nelder and Mead's simplex
searches the shapes. It starts at a middle θo and proceeds to the normal and to the horizon, at every θo from the shapes
of the neighbouring angle. A small penalty on changes keeps lobes without weight from drifting.
"""

import math
from dataclasses import dataclass

import numpy as np
import torch
from scipy.optimize import minimize
from torch import Tensor

from homofact.brdf.reflectance import Reflectance
from homofact.brdf.symmetry import find_symmetry
from homofact.errors import BadInput
from homofact.geometry.directions import from_spherical
from homofact.geometry.quadrature import hemisphere_nodes
from homofact.linear.kernels import kernel
from homofact.rendering.closures import LEAST_ALPHA, Closures
from homofact.rendering.lobe_levels import FLAT, shared
from homofact.rendering.split_sum import widest_azimuth
from homofact.rendering.surface import ToRgb, shader

COLUMNS, LOBES = 64, 2
AZIMUTHS = 12  # of the weights of an anisotropic material
GRAZING = math.radians(89.0)  # what stands for θo = 90°, where nothing is seen
_EVERY, _MIDDLE = 3, 45  # columns whose shapes are searched, and the first of them
_STEEP = 1e-4  # radians
_NODES = {True: (48, 24), False: (32, 16)}
_SEEN_FROM = 4  # azimuths of half a turn for which shapes are searched
# α of the lobes at first; the last of them may begin on the way back.
_STARTS = {
    1: ((0.01,), (0.1,), (0.4,)),
    2: ((0.01, 0.1), (0.05, 0.4), (0.1, 0.4), (0.02, 0.3)),
    3: ((0.01, 0.05, 0.3), (0.03, 0.1, 0.4), (0.1, 0.3, 0.7)),
}
_FIRST_STEPS, _STEPS = 60, 25
# Of lnα, lean and artanh of the anisotropy: the simplex at first, and the bounds.
_SIMPLEX = np.array((0.4, 0.03, 0.1))
_LEAST, _MOST = np.array((math.log(LEAST_ALPHA), -0.6, -1.5)), np.array((0.0, 1.05, 1.5))
_SMOOTH = 1e-3 * np.array((0.3, 1.0, 0.3))
# The least cosine of a lobe's mirror direction, below which Blender turns the normal; the least albedo of a lobe.
_LOWEST, _FAINTEST = 0.01, 0.1
_SELF = 0.61 / (8 * math.pi)  # of a cell's solid angle: the mean of lnγ² within a disc of that size is ln(a² e^(−1/2))


def closures_of(reflectance: Reflectance, lobes: int = LOBES, to_rgb: ToRgb | None = None) -> Closures:
    """Fit the sum of a Lambertian closure and `lobes` lobes, 1 to 3.

    Raises BadInput for unsuitable channels, values that are not finite, and a material that reflects nothing.
    """
    shade = shader(reflectance, to_rgb)
    isotropic = find_symmetry(reflectance).isotropic
    turn = None if isotropic else widest_azimuth(shade)
    axis = (1.0, 0.0) if turn is None else (math.cos(turn), math.sin(turn))
    searched = range(0, COLUMNS, _EVERY)
    # Off the axes, to which many tables are aligned.
    azimuths = [0.0] if isotropic else [0.1 + math.pi * k / _SEEN_FROM for k in range(_SEEN_FROM)]
    seen = {k: [_View.of(shade, k, azimuth, isotropic) for azimuth in azimuths] for k in searched}
    if not any(view.albedo.any() for views in seen.values() for view in views):
        raise BadInput("the values are all 0", where="Blender's closures", expected="something that reflects")
    found = _searched(seen, lobes, axis)
    numbers = np.stack([np.interp(range(COLUMNS), searched, found[:, j]) for j in range(found.shape[1])], 1)
    shapes = np.stack([_shapes(x) for x in numbers])
    # Nothing is longer in a plane that is none.
    if isotropic:
        shapes[-1, :, 1] = 0
    weights = _weights(shade, shapes, axis, isotropic)
    channels = reflectance.channels if to_rgb is None else ("R", "G", "B")
    return Closures(torch.from_numpy(shapes), torch.from_numpy(weights), turn, channels)


def _weights(shade, shapes: np.ndarray, axis: tuple[float, float], isotropic: bool) -> np.ndarray:
    """The weights (T, COLUMNS, 1 + K, C) for shapes (COLUMNS, K, 3)."""
    if isotropic:
        return np.stack([_View.of(shade, k, 0.0, True).reflected(shapes[k], axis)[1] for k in range(COLUMNS)])[None]
    searched = range(0, COLUMNS, _EVERY)
    rows = []
    for turn in range(AZIMUTHS):
        azimuth = (2 * turn / AZIMUTHS - 1) * math.pi
        own = np.stack([_View.of(shade, k, azimuth, False).reflected(shapes[k], axis)[1] for k in searched])
        flat = own.reshape(len(own), -1)
        between = np.stack([np.interp(range(COLUMNS), searched, column) for column in flat.T], 1)
        rows.append(between.reshape(COLUMNS, *own.shape[1:]))
    return np.stack([*rows, rows[0]])


@dataclass(frozen=True)
class _View:
    """What a viewer at unit `wo` (3,) sees, at M nodes `wi` (M, 3) with solid angles `solid` (M,).

    `flux` (M, C) is f cosθi dω and `albedo` (C,) its sum; `matte` (M,) that of a Lambertian albedo 1. `green` (M, M)
    are G and FLAT between nodes, `pulled` (M, 1 + C) what they make of `matte` and of `flux`.
    """

    wo: np.ndarray
    wi: np.ndarray
    solid: np.ndarray
    flux: np.ndarray
    albedo: np.ndarray
    matte: np.ndarray
    green: np.ndarray
    pulled: np.ndarray

    @classmethod
    def of(cls, shade, column: int, azimuth: float, isotropic: bool) -> "_View":
        """The viewer of a column at an azimuth; isotropic materials have both sides of the plane of incidence added."""
        theta = min(max(math.acos(column / (COLUMNS - 1)), _STEEP), GRAZING)
        wo = from_spherical(*(torch.tensor([angle], dtype=torch.float64) for angle in (theta, azimuth)))
        nodes = _NODES[isotropic]
        wi, solid = (each[0] for each in hemisphere_nodes(wo, *nodes))
        f = shade(wi, wo.expand_as(wi)).clamp_min(0)
        flux = f * (solid * wi[:, 2].clamp_min(0))[:, None]
        if isotropic:
            side = nodes[1] // 2

            def folded(each: Tensor) -> Tensor:
                rings = each.reshape(-1, nodes[1], each.shape[-1])
                return (rings[:, :side] + rings[:, side:].flip(1)).reshape(-1, each.shape[-1])

            flux, solid = folded(flux), folded(solid[:, None])[:, 0]
            wi = wi.reshape(-1, nodes[1], 3)[:, :side].reshape(-1, 3)
        places, sizes, own = (np.ascontiguousarray(each.numpy()) for each in (wi, solid, flux))
        matte = places[:, 2].clip(0) * sizes
        matte /= matte.sum()
        green = _green(places, sizes / (1 + isotropic), isotropic)
        pulled = green @ np.column_stack((matte, own))
        return cls(wo[0].numpy(), places, sizes, own, own.sum(0), matte, green.astype(np.float32), pulled)

    def reflected(self, shapes: np.ndarray, axis: tuple[float, float]) -> tuple[float, np.ndarray, float]:
        """(E over that of a matte surface of the albedo, weights (1 + K, C), the least albedo of a lobe)."""
        lobes = np.stack([_flux(shape, axis[0], axis[1], self.wo, self.wi, self.solid) for shape in shapes])
        whole = np.concatenate(((1.0,), lobes.sum(1).clip(1e-9)))
        lobes /= whole[1:, None]
        kernels = np.vstack((self.matte, lobes))
        pulled = np.vstack((self.pulled[:, 0], lobes.astype(np.float32) @ self.green))
        between, pull = pulled @ kernels.T, kernels @ self.pulled[:, 1:]
        misfit, shares = float((self.flux * self.pulled[:, 1:]).sum()), np.empty((len(kernels), len(self.albedo)))
        for channel in range(len(self.albedo)):
            value, shares[:, channel] = shared(
                (between + between.T) / 2, np.ascontiguousarray(pull[:, channel]), self.albedo[channel], False
            )
            misfit += value
        scale = float((self.albedo**2).sum() * (self.matte @ self.pulled[:, 0])) or 1.0
        return misfit / scale, shares / whole[:, None], float(whole[1:].min())


def _searched(seen: dict[int, list[_View]], lobes: int, axis: tuple[float, float]) -> np.ndarray:
    """The searched numbers (columns of `seen`, 3 K), from the middle outwards."""
    found: dict[int, np.ndarray] = {}
    steps = np.tile(_SIMPLEX, lobes)

    def value(x: np.ndarray, views: list[_View], before: np.ndarray | None) -> float:
        shapes = _shapes(x)
        beyond = np.abs(x.reshape(-1, 3) - x.reshape(-1, 3).clip(_LEAST, _MOST)).sum()
        moved = 0.0 if before is None else (_SMOOTH * (x - before).reshape(-1, 3) ** 2).sum()
        total = 0.0
        for view in views:
            misfit, _, faintest = view.reflected(shapes, axis)
            total += misfit / len(views) + max(_FAINTEST - faintest, 0.0)
        return float(total + beyond + moved + 10 * (_LOWEST - _mirrored(shapes, views[0].wo)).clip(0).sum())

    def better(x: np.ndarray, views: list[_View], before: np.ndarray | None, count: int) -> np.ndarray:
        corners = np.vstack([x, x + np.diag(steps)])
        options = {"maxfev": count * len(x), "initial_simplex": corners, "xatol": 1e-3, "fatol": 1e-8}
        return minimize(value, x, (views, before), method="Nelder-Mead", options=options).x

    starts = []
    for start in _STARTS[lobes]:
        for lean in (0.0, 1.0):
            first = np.zeros((lobes, 3))
            first[:, 0] = np.log(start)
            first[-1, 1] = lean
            starts.append(better(first.reshape(-1), seen[_MIDDLE], None, _FIRST_STEPS))
    found[_MIDDLE] = min(starts, key=lambda x: value(x, seen[_MIDDLE], None))
    for order in (range(_MIDDLE + _EVERY, COLUMNS, _EVERY), range(_MIDDLE - _EVERY, -1, -_EVERY)):
        x = found[_MIDDLE]
        for k in order:
            x = found[k] = better(x, seen[k], x, _STEPS)
    return np.stack([found[k] for k in seen])


def _shapes(x: np.ndarray) -> np.ndarray:
    """Roughness, anisotropy and lean (K, 3) of searched numbers (3 K)."""
    level, lean, stretch = x.reshape(-1, 3).clip(_LEAST, _MOST).T
    return np.stack((np.exp(level / 2), np.tanh(stretch), lean), 1)


def _mirrored(shapes: np.ndarray, wo: np.ndarray) -> np.ndarray:
    """Cosines (K,) of the directions in which the leaning normals mirror the viewer."""
    up = np.array((0.0, 0.0, 1.0))
    m = up + shapes[:, 2, None] * (wo - up)
    m /= np.linalg.norm(m, axis=1, keepdims=True)
    return 2 * (m @ wo) * m[:, 2] - wo[2]


@kernel(nogil=True)
def _green(wi, solid, folded):  # pragma: no cover (compiled)
    """G and FLAT (M, M) between nodes (M, 3) of solid angles (M,); `folded` nodes include those mirrored at y = 0."""
    count = len(wi)
    green = np.empty((count, count))
    for a in range(count):
        for b in range(a + 1):
            flat = wi[a, 0] * wi[b, 0] + wi[a, 2] * wi[b, 2]
            across = wi[a, 1] * wi[b, 1]
            own = _SELF * (solid[a] + solid[b])
            value = -math.log(max((1 - flat - across) / 2, 0.0) + own)
            if folded:
                value = (value - math.log(max((1 - flat + across) / 2, 0.0) + own)) / 2
            value /= 4 * math.pi
            if a == b:
                value += FLAT / solid[a] / (2 if folded else 1)
            green[a, b] = green[b, a] = value
    return green


@kernel(nogil=True)
def _flux(shape, cos, sin, wo, wi, solid):  # pragma: no cover (compiled)
    """f cosθi dω (M,) of a lobe's roughness, anisotropy and lean (3,), with the tangent (cos, sin)."""
    m = np.array((shape[2] * wo[0], shape[2] * wo[1], 1 + shape[2] * (wo[2] - 1)))
    m /= math.sqrt((m * m).sum())
    across = np.array((-m[2] * sin, m[2] * cos, m[0] * sin - m[1] * cos))
    across /= math.sqrt((across * across).sum())
    along = np.array(
        (
            across[1] * m[2] - across[2] * m[1],
            across[2] * m[0] - across[0] * m[2],
            across[0] * m[1] - across[1] * m[0],
        )
    )
    alpha = max(shape[0] ** 2, LEAST_ALPHA)
    narrow, wide = alpha * (1 - abs(shape[1])), min(alpha / (1 - abs(shape[1])), 1.0)
    first, second = (narrow, wide) if shape[1] >= 0 else (wide, narrow)
    ox = along[0] * wo[0] + along[1] * wo[1] + along[2] * wo[2]
    oy = across[0] * wo[0] + across[1] * wo[1] + across[2] * wo[2]
    oz = m[0] * wo[0] + m[1] * wo[1] + m[2] * wo[2]
    o_long = math.sqrt((first * ox) ** 2 + (second * oy) ** 2 + oz * oz)
    found = np.zeros(len(wi))
    for k in range(len(wi)):
        x = along[0] * wi[k, 0] + along[1] * wi[k, 1] + along[2] * wi[k, 2]
        y = across[0] * wi[k, 0] + across[1] * wi[k, 1] + across[2] * wi[k, 2]
        z = m[0] * wi[k, 0] + m[1] * wi[k, 1] + m[2] * wi[k, 2]
        if z <= 0 or wi[k, 2] <= 0 or oz <= 0:
            continue
        i_long = math.sqrt((first * x) ** 2 + (second * y) ** 2 + z * z)
        between = 2 + 2 * (wi[k, 0] * wo[0] + wi[k, 1] * wo[1] + wi[k, 2] * wo[2])
        spread = (((x + ox) / first) ** 2 + ((y + oy) / second) ** 2 + (z + oz) ** 2) / between
        visible = 0.5 / (z * o_long + oz * i_long)
        found[k] = visible / (math.pi * first * second * spread * spread) * z * solid[k]
    return found
