"""In-out factors under mapped normals: the light that a material reflects with its normal tilted off the surface's.

Precomputed transport has the visibility and the frame of the vertex, and a normal map tilts the normal at each pixel.
With the local normal n' and the rotation R that takes it to z, factors f = Σ_k g_k(ωi) h_k(ωo) become

    B(ωo, n') = Σ_k h_k(R ωo) ∫ L V g_k(R ω) max(0, n'·ω) dω,

over the hemisphere of the vertex. The functions g_k(R ω) max(0, n'·ω) of ω, of all k and tilts n', are smooth and
alike. They are factored once more, by a singular value decomposition over the tilts that the map has:

    g_k(R ω) max(0, n'·ω) ≈ Σ_j G_j(ω) H_jk(n').

So the light maps are G_j, which have the cosine in them, and B = Σ_k h_k(R ωo) Σ_j H_jk(n') T_j. Sloan (2006, Normal
mapping for precomputed radiance transfer) does the same with fixed bases for matt surfaces. As in `decomposition`, the
expected light is natural, whose power falls with the harmonic order. At n' = z the factors are in-out factors of f
again, with the view maps Σ_k H_jk(z) h_k.

Light between surfaces arrives as Zernike's polynomials (`smooth_response`), six of them, Σ c_j Z_j(ω), and the material
reflects Σ c'_i h_i(R ωo) with c'_i = Σ_j c_j ∫ Z_i(R ω) Z_j(ω) max(0, n'·ω) dω: these integrals are their H_ji.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from homofact.geometry.parabolic import from_disc
from homofact.linear.threads import one_thread
from homofact.relighting.factors import InOutFactors, fitted_texels, look_up, texel_points
from homofact.relighting.smooth_response import modes, zernike
from homofact.relighting.tilt_kernels import TiltArrays, shade_tilted
from homofact.theory.harmonics import harmonics, orders

TILTS = 21  # nodes along each side of the square of tilts
ERROR = 0.01  # of the light that the tilted functions may leave out, relative RMS
MOST_TERMS = 32  # of each part
# The sine of the largest tilt, at least and at most; more than the map's own, since vertices have other normals than
# the points between them.
_LEAST, MOST_REACH, _MARGIN = 0.25, 0.97, 0.08
# The density of tilts is a part even over the disc.
_EVEN, _BINS = 0.2, 24
_RINGS, _SPOKES, _DEGREE = 20, 48, 8


@dataclass(frozen=True)
class TiltedView:
    """The effect of tilted normals on terms: `view` maps h (K, M, M, C), and functions H of n', `tilts` (T, T, S).

    Node (a, b) of the tilts is n' = (x, y, …) with x and y from −`reach` to `reach`. A row (j, k, s) of `entries`
    (E, 3) means that term j adds to view map k, times function s.
    """

    view: np.ndarray
    tilts: np.ndarray
    entries: np.ndarray
    reach: float

    @property
    def nbytes(self) -> int:
        """Bytes of the maps."""
        return self.view.nbytes + self.tilts.nbytes

    def upright(self, terms: int) -> np.ndarray:
        """Return the view maps (J, M, M, C) of `terms` terms for untilted normals."""
        found = np.zeros((terms, *self.view.shape[1:]), np.float32)
        middle = self.tilts[TILTS // 2, TILTS // 2]
        for j, k, s in self.entries.tolist():
            found[j] += middle[s] * self.view[k]
        return found

    def light(
        self,
        tuples: np.ndarray,
        frames: np.ndarray,
        corners: np.ndarray,
        shares: np.ndarray,
        normals: np.ndarray,
        views: np.ndarray,
        tinted: np.ndarray,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return two radiances (P, 3) float32 of points: by the untinted terms, and by the tinted terms.

        `tuples` (V, J, 3) and `frames` (V, 3, 3) are the vertices'; points interpolate `corners` (P, 3) with the
        weights `shares` (P, 3). Their mapped `normals` (P, 3) and the directions `views` (P, 3) to the eye are in the
        world frame. `tinted` (J,) are the terms that a texture tints.
        """
        out = np.zeros((2, len(normals), 3), np.float32)
        given = TiltArrays(
            np.ascontiguousarray(self.view.transpose(1, 2, 0, 3)), self.tilts, self.entries, self.reach,
            np.ascontiguousarray(tinted),
        )  # fmt: skip
        f32 = [np.ascontiguousarray(each, np.float32) for each in (tuples, frames, shares, normals, views)]
        shade_tilted(f32[0], f32[1], np.ascontiguousarray(corners, np.int64), *f32[2:], given, out)
        return out[0], out[1]

    def with_bounce(self, factors: InOutFactors, colours: int) -> "TiltedView":
        """Return the same with the interreflection terms of `factors` appended, for `colours` colours."""
        first, last, parts = len(self.view), factors.direct, 2 if factors.tinted else 1
        size = factors.bounced // parts // colours
        order = next(n for n in range(size) if len(modes(n)) == size)
        nodes, weights = _hemisphere()
        slots = []
        for x, y in self._nodes():
            turn = rotation(x, y)
            local = nodes @ turn.T
            cosine = local[:, 2].clip(0) * weights
            slots.append((zernike(nodes, order) * cosine) @ zernike(_above(local), order).T)
        more = np.stack(slots).reshape(TILTS, TILTS, -1).astype(np.float32)
        start, entries = self.tilts.shape[2], []
        for part in range(parts):
            at = part * size * colours
            entries += [
                (last + at + j * colours + r, first + at + i * colours + r, start + j * size + i)
                for r in range(colours)
                for j in range(size)
                for i in range(size)
            ]
        channels = factors.view.shape[3]
        view = np.broadcast_to(self.view, (*self.view.shape[:3], channels))
        return TiltedView(
            np.concatenate((view, factors.view[last:])), np.concatenate((self.tilts, more), 2),
            np.concatenate((self.entries, np.array(entries, np.int32))), self.reach,
        )  # fmt: skip

    def _nodes(self) -> list[tuple[float, float]]:
        return tilt_nodes(self.reach)


def tilt_nodes(reach: float) -> list[tuple[float, float]]:
    """(x, y) of the nodes of a square of tilts, those beyond the disc on its edge."""
    along = np.linspace(-reach, reach, TILTS)
    x, y = (each.ravel() for each in np.meshgrid(along, along, indexing="ij"))
    # Where look-ups need a node outside the disc, it has the value of a tilt a little beyond.
    most = min(1.15 * reach, 0.99)
    short = np.minimum(1.0, most / np.hypot(x, y).clip(1e-12))
    return list(zip((x * short).tolist(), (y * short).tolist(), strict=True))


def rotation(x: float, y: float) -> np.ndarray:
    """Rows (3, 3) of the frame whose normal is (x, y, √(1 − x² − y²)), turned there from z the shortest way."""
    z = math.sqrt(max(1 - x * x - y * y, 0.0))
    a = 1 / (1 + z)
    return np.array([[1 - x * x * a, -x * y * a, -x], [-x * y * a, 1 - y * y * a, -y], [x, y, z]])


@one_thread
def tilted(factors: InOutFactors, sines: np.ndarray, error: float = ERROR) -> tuple[InOutFactors, TiltedView]:
    """Return (factors with light maps for tilted normals, their `TiltedView`), without interreflection terms.

    `sines` (N,) are the sines of the normal map's tilts. `error` is the allowed error of the tilted functions alone,
    relative to the light of the whole material.
    """
    reach = min(max(float(np.quantile(sines, 0.999)) + _MARGIN, _LEAST), MOST_REACH)
    density = _density(sines, reach)
    own = factors.tinted_terms
    whole = float(factors.strength.sum())
    # What is left of the material beside a lobe is a small part of its light.
    allowed = (error**2) * factors.energy
    lights, strengths, slots, entries, start = [], [], [], [], 0
    blocks = [np.flatnonzero(each) for each in (own, ~own) if each.any()]
    for chosen in blocks:
        light, functions, energy = _factored(factors, chosen, reach, density, allowed / len(blocks), whole)
        first = sum(len(each) for each in lights)
        entries += [
            (first + j, int(k), start + j * len(chosen) + n) for j in range(len(light)) for n, k in enumerate(chosen)
        ]
        start += len(light) * len(chosen)
        lights.append(light)
        strengths.append(energy)
        slots.append(functions.reshape(TILTS, TILTS, -1))
    view = TiltedView(
        factors.view, np.concatenate(slots, 2).astype(np.float32), np.array(entries, np.int32), reach
    )  # fmt: skip
    light = np.concatenate(lights)
    found = replace(
        factors, light=light, view=view.upright(len(light)), strength=np.concatenate(strengths),
        tinted=len(lights[0]) if factors.tinted else 0, cosine=True,
    )  # fmt: skip
    return found, view


def _factored(
    factors: InOutFactors, chosen: np.ndarray, reach: float, density: np.ndarray, allowed: float, whole: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Factor the `chosen` terms: light maps (J, M, M), functions of tilt (T·T, J, K), and strengths (J,)."""
    size = factors.light.shape[1]
    maps = torch.from_numpy(factors.light[chosen]).permute(1, 2, 0).double()
    use = np.sqrt((factors.view[chosen].astype(np.float64) ** 2).mean((1, 2, 3)))
    nodes, solid = _hemisphere()
    towards = torch.from_numpy(nodes)
    lights = harmonics(_DEGREE, towards).numpy() * solid[:, None]
    lights *= np.sqrt(1 / (1.0 + orders(_DEGREE)[0].numpy()))
    places = tilt_nodes(reach)
    # Rows of the matrix: a node of the tilts and a term, times the roots of what they count.
    counts = np.sqrt(density)
    rows = np.stack([_tilted_maps(maps, towards, place).numpy().T @ lights for place in places])
    weighted = rows * counts[:, None, None] * use[:, None]
    flat = weighted.reshape(-1, weighted.shape[2])
    square, right = np.linalg.eigh(flat.T @ flat)
    square, right = square[::-1].clip(0), right[:, ::-1]
    strength = square * (float(factors.strength[chosen].sum()) / max(square.sum(), 1e-300))
    left = strength.sum() - strength.cumsum()
    enough = np.flatnonzero(left <= allowed)
    terms = min(int(enough[0]) + 1 if len(enough) else len(square), MOST_TERMS)
    # Of equal ones, a pair of one order of azimuth, both or none.
    while terms < min(len(square), MOST_TERMS) and square[terms] > 0.98 * square[terms - 1]:
        terms += 1
    terms = max(1, min(terms, int((square > 1e-9 * square[0]).sum())))
    root = np.sqrt(square[:terms])
    # H is the left vector without its weights, by Nyström's formula where these are 0.
    functions = np.einsum("nkl,lj->njk", rows, right[:, :terms]) / root[:, None]
    left_vectors = (flat @ right[:, :terms] / root).reshape(len(places), len(chosen), terms)
    asked = _texel_directions(size)
    light = np.zeros((len(asked), terms))
    for n, place in enumerate(places):
        if counts[n] > 0:
            light += _tilted_maps(maps, asked, place).numpy() @ (left_vectors[n] * counts[n] * use[:, None])
    made = fitted_texels(torch.from_numpy(light.T.reshape(terms, size, size)))
    return made.float().numpy(), functions, strength[:terms]


def _tilted_maps(maps: Tensor, towards: Tensor, tilt: tuple[float, float]) -> Tensor:
    """Return g_k(R ω) max(0, n'·ω) (N, K) of light maps (M, M, K) at directions (N, 3)."""
    local = towards @ torch.from_numpy(rotation(*tilt)).T
    return look_up(maps, local) * local[:, 2:].clamp_min(0)


def _hemisphere() -> tuple[np.ndarray, np.ndarray]:
    """Return directions (N, 3) of the upper hemisphere and their solid angles (N,)."""
    x, w = np.polynomial.legendre.leggauss(_RINGS)
    z, phi = (x + 1) / 2, 2 * math.pi * (np.arange(_SPOKES) + 0.5) / _SPOKES
    across = np.sqrt(1 - z**2)
    found = np.stack([np.outer(across, np.cos(phi)), np.outer(across, np.sin(phi)), np.outer(z, np.ones(_SPOKES))], -1)
    return found.reshape(-1, 3), np.repeat(w / 2 * 2 * math.pi / _SPOKES, _SPOKES)


def _above(w: np.ndarray) -> np.ndarray:
    """Return directions, moving those below the horizon onto it; their weight is 0."""
    return np.stack((w[:, 0], w[:, 1], w[:, 2].clip(0)), 1)


def _texel_directions(size: int) -> Tensor:
    """Return the directions (M·M, 3) of a parabolic map's texels; beyond the rim, those of the rim."""
    uv = texel_points(size).reshape(-1, 2)
    return from_disc(uv / uv.norm(dim=1, keepdim=True).clamp_min(1.0))


def _density(sines: np.ndarray, reach: float) -> np.ndarray:
    """Return weights (T·T,) of the tilt nodes, with sum 1: the frequency of tilts in a map, in any direction."""
    nodes = np.array(tilt_nodes(reach))
    radius = np.hypot(*nodes.T)
    counts, edges = np.histogram(np.minimum(sines, reach * (1 - 1e-9)), _BINS, (0, reach))
    per_area = counts / (edges[1:] ** 2 - edges[:-1] ** 2)
    middle = (edges[1:] + edges[:-1]) / 2
    found = np.interp(radius, middle, per_area)
    inside = radius <= reach * (1 + 1e-9)
    found = np.where(inside, found / max(float(found[inside].sum()), 1e-300), 0.0)
    return (1 - _EVEN) * found + _EVEN * inside / inside.sum()
