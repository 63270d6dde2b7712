"""A sum of closures for renderers that integrate skies themselves: one Lambertian, and lobes of GGX.

    f(ωi, ωo) = w0/π + Σk wk Gk(ωi, ωo),    G = D(h) G2(ωi, ωo)/(4 (n·ωi) (m·ωo)),    k = 1 … K,

where D is the distribution of Trowbridge and Reitz (GGX) and G2 Smith's height-correlated masking and shadowing (Heitz
2014, equation 99), both about the closure's own normal m. There is no Fresnel term. This is Blender's node Glossy BSDF
with the distribution GGX: with roughness r and anisotropy a ≥ 0, α is r² (1 − a) along the tangent and r²/(1 − a)
across, at most 1; with a < 0 the two are exchanged. The tangent is the viewer's azimuth, so that a lobe can be longer
or shorter in the plane of incidence. For an anisotropic material the tangent is a direction in the surface. The normal
leans towards the viewer by s,

    m = norm(n + s (ωo − n)),

where s = 0 gives the mirror direction and s = 1 retroreflection. Light from below m is not reflected.

The weights w, one per channel, and r, a and s depend on cosθo. For an anisotropic material the weights also depend on
the azimuth of ωo. All are interpolated linearly in tables. The sum is therefore not reciprocal.
"""

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from homofact.brdf.in_kind import answering_in_kind
from homofact.geometry.directions import normalize

LEAST_ALPHA = 1e-3
ROUGHNESS, ANISOTROPY, LEAN = range(3)


@dataclass(frozen=True)
class Closures:
    """The sum of closures that the module describes.

    Attributes
    ----------
    lobes : Tensor
        (COLUMNS, K, 3): roughness, anisotropy and lean at even steps of cosθo from 0 to 1.
    weights : Tensor
        (T, COLUMNS, 1 + K, C), the Lambertian closure's first. T is 1, or the number of evenly spaced azimuths of ωo
        from −π to π, both ends included.
    turn : float or None
        The azimuth of the closures' tangent in radians; None for the viewer's.
    channels : tuple of str
        Names of the C channels.
    """

    lobes: Tensor
    weights: Tensor
    turn: float | None
    channels: tuple[str, ...]

    @property
    def nbytes(self) -> int:
        """Bytes of the tables in single precision."""
        return 4 * (self.lobes.numel() + self.weights.numel())

    @property
    def fetches(self) -> int:
        """One texel of weights per closure, and one of the other numbers per lobe."""
        return 2 * self.lobes.shape[1] + 1

    @answering_in_kind
    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Values (N, C) in sr⁻¹, without the cosine."""
        lobes, weights = self.at(wo)
        axis = wo[:, :2]
        if self.turn is not None:
            axis = axis.new_tensor((math.cos(self.turn), math.sin(self.turn))).expand(len(wo), 2)
        f = weights[:, 0] / math.pi
        for k in range(lobes.shape[1]):
            f = f + weights[:, k + 1] * glossy(lobes[:, k], axis, wi, wo)[:, None]
        above = (wi[:, 2:] > 0) & (wo[:, 2:] > 0)
        return torch.where(above, f, torch.zeros_like(f))

    def at(self, wo: Tensor) -> tuple[Tensor, Tensor]:
        """Lobes (N, K, 3) and weights (N, 1 + K, C) for viewers at unit `wo` (N, 3)."""
        lobes, weights = self.lobes.to(wo), self.weights.to(wo)
        column, up = _place(wo[:, 2].clamp(0, 1), len(lobes))

        def between(table: Tensor) -> Tensor:
            return table[column] * (1 - up) + table[column + 1] * up

        if len(weights) == 1:
            return between(lobes), between(weights[0])
        row, right = _place(torch.atan2(wo[:, 1], wo[:, 0]) / (2 * math.pi) + 0.5, len(weights))
        here, there = (weights[r, column] * (1 - up) + weights[r, column + 1] * up for r in (row, row + 1))
        return between(lobes), here * (1 - right) + there * right


def glossy(lobe: Tensor, axis: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
    """G (N,) in sr⁻¹ of closures of roughness, anisotropy and lean (N, 3) with the tangent along `axis` (N, 2)."""
    up = wo.new_tensor((0.0, 0.0, 1.0))
    m = normalize(up + lobe[:, LEAN, None] * (wo - up))
    # At the normal itself the viewer has no azimuth.
    nowhere = axis.norm(dim=1, keepdim=True) < 1e-12
    axis = torch.where(nowhere, axis.new_tensor((1.0, 0.0)), axis)
    axis = torch.cat((axis, torch.zeros_like(axis[:, :1])), 1)
    across = normalize(torch.linalg.cross(m, axis))
    along = torch.linalg.cross(across, m)
    alpha = torch.stack(alphas(lobe[:, ROUGHNESS], lobe[:, ANISOTROPY]), 1)

    def local(w: Tensor) -> tuple[Tensor, Tensor]:
        return torch.stack(((w * along).sum(1), (w * across).sum(1)), 1), (w * m).sum(1)

    flat, high = local(normalize(wi + wo))
    spread = ((flat / alpha) ** 2).sum(1) + high**2
    (i_flat, i_up), (o_flat, o_up) = local(wi), local(wo)
    i_long, o_long = ((((w * alpha) ** 2).sum(1) + z**2).sqrt() for w, z in ((i_flat, i_up), (o_flat, o_up)))
    visible = 0.5 / (i_up * o_long + o_up * i_long).clamp_min(1e-12)
    value = visible / (math.pi * alpha.prod(1) * spread**2)
    # A closure has the cosine of its own normal.
    value = value * i_up / wi[:, 2].clamp_min(1e-9)
    return torch.where((i_up > 0) & (o_up > 0), value, torch.zeros_like(value))


def alphas(roughness: Tensor, anisotropy: Tensor) -> tuple[Tensor, Tensor]:
    """α along and across the tangent."""
    alpha = (roughness**2).clamp_min(LEAST_ALPHA)
    narrow, wide = alpha * (1 - anisotropy.abs()), (alpha / (1 - anisotropy.abs())).clamp_max(1)
    return torch.where(anisotropy >= 0, narrow, wide), torch.where(anisotropy >= 0, wide, narrow)


def _place(share: Tensor, count: int) -> tuple[Tensor, Tensor]:
    """Of places in [0, 1] among `count` even ones: the one before (N,), and how far on to the next (N, 1, 1)."""
    exact = share * (count - 1)
    below = exact.floor().clamp(0, count - 2)
    return below.to(torch.int64), (exact - below)[:, None, None]
