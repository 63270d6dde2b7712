"""Where a renderer looks for light: a density of directions that follows the lobe of a reflectance.

Seen from ωo, ωi is drawn from the mixture

    p(ωi | ωo) = c(ωo) cosθi/π + (1 − c(ωo)) g(h)/(4 h·ωo),    h = norm(ωi + ωo),

its second part by drawing h from the table g and mirroring ωo at it, dωh = dωi/(4 h·ωo) (Walter et al. 2007,
eq. 14). A mirrored direction under the horizon is lost: over the hemisphere p integrates to 1 less that share.

g (sr⁻¹ of h) and c follow from f. Let t(h | ωo) ∝ f cosθi 4 h·ωo be the density of h from which light would be
drawn without noise. Of all g and c we want the mixture with the least mean Kullback-Leibler divergence from t, the
mean over viewers uniform on the hemisphere; expectation-maximization finds it (Dempster, Laird and Rubin 1977). With
the lobe's part r = (1 − c) g/((1 − c) g + c cosθi/π · 4 h·ωo), one step is g ← mean of r t over viewers, normalised,
and 1 − c(ωo) ← ∫ r t dωh. c is tabulated over cosθo and never below `LEAST`, which bounds the weight f cosθi/p.

The table. With s = sin²(θh/2) = (1 − hz)/2 in [0, ½], dωh = 2 ds dφh. Rows are even steps of
y = asinh(s/σ)/asinh(1/(2σ)), linear up to s = σ and logarithmic beyond, so that a narrow lobe gets its nodes; columns
even steps of x = φh/2π, the first and the last the same direction. The table holds the density in (x, y), bilinear
between nodes, P = 4π (ds/dy) g with ds/dy = asinh(1/(2σ)) √(σ² + s²): it integrates to 1 over the unit square.
"""

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from homofact.brdf.reflectance import Reflectance
from homofact.geometry.directions import normalize
from homofact.linear.bilinear import lookup
from homofact.shading.mixture_fit import viewers

SIGMA = 1e-4  # θh = 1.1°: no fitted texture holds a narrower lobe
SCALE = math.asinh(1 / (2 * SIGMA))
LEAST = 0.1
_STEPS = 30
_ROWS, _ISOTROPIC_ROWS, _COLUMNS, _LEVELS, _AZIMUTHS = 128, 256, 48, 16, 6
_BATCH = 1 << 17


@dataclass(frozen=True)
class LobeSampling:
    """The mixture of the module's head.

    `table` (K, J) float64 ≥ 0 is P at the nodes, two equal columns where the material is isotropic; `cosine` (L,)
    in [LEAST, 1] is c at cosθo = (l + ½)/L, linear between.
    """

    table: Tensor
    cosine: Tensor

    @property
    def isotropic(self) -> bool:
        """Whether g is the same for every azimuth of h."""
        return self.table.shape[1] == 2

    def half_density(self, h: Tensor) -> Tensor:
        """g (N,) in sr⁻¹ at unit half vectors (N, 3); 0 under the horizon."""
        # (1 − hz)/2 without cancellation at the lobe's centre.
        s = (h[:, :2] ** 2).sum(1) / (2 * (1 + h[:, 2]).clamp_min(1e-12))
        y = torch.asinh(s / SIGMA) / SCALE
        x = torch.remainder(torch.atan2(h[:, 1], h[:, 0]) / (2 * torch.pi), 1)
        density = lookup(self.table[..., None].to(h), torch.stack((x, y), 1) * 2 - 1)[:, 0]
        return density / (4 * torch.pi * SCALE * torch.sqrt(SIGMA**2 + s**2)) * (h[:, 2] >= 0)

    def cosine_share(self, wo: Tensor) -> Tensor:
        """c (N,), dimensionless, for viewers (N, 3)."""
        levels = len(self.cosine)
        position = (wo[:, 2] * levels - 0.5) * (2 / (levels - 1)) - 1
        uv = torch.stack((position, torch.zeros_like(position)), 1)
        return lookup(self.cosine[None, :, None].to(wo), uv)[:, 0]

    def density(self, wi: Tensor, wo: Tensor) -> Tensor:
        """p(ωi | ωo) (N,) in sr⁻¹ of ωi; 0 where a direction is under the horizon."""
        h = normalize(wi + wo)
        lobe = self.half_density(h) / (4 * (h * wo).sum(1).clamp_min(1e-12))
        share = self.cosine_share(wo)
        above = (wi[:, 2] > 0) & (wo[:, 2] > 0)
        return (share * wi[:, 2] / torch.pi + (1 - share) * lobe) * above


def lobe_sampling(reflectance: Reflectance, isotropic: bool) -> LobeSampling:
    """The mixture for a reflectance, from about 10⁵ evaluations of its channels' mean (6·10⁵ if not isotropic).

    Where it reflects nothing, or nothing finite, light is drawn from the cosine alone. Raises nothing.
    """
    rows, azimuths = (_ISOTROPIC_ROWS, 1) if isotropic else (_ROWS, _AZIMUTHS)
    y = torch.linspace(0, 1, rows, dtype=torch.float64)
    s = (SIGMA * torch.sinh(SCALE * y)).clamp_max(0.5)
    slope = SCALE * torch.sqrt(SIGMA**2 + s**2)
    halves = _half_vectors(s)
    ends = torch.ones(rows, dtype=torch.float64)
    ends[[0, -1]] = 0.5
    # Trapezoids in y, even steps around: solid angle of each node.
    angles = (2 * slope * ends / (rows - 1) * (2 * torch.pi / _COLUMNS))[:, None].expand(rows, _COLUMNS)
    target, cosine = _targets(reflectance, viewers(_LEVELS, azimuths), halves.reshape(-1, 3))
    weights = angles.reshape(-1)
    total = (target * weights).sum(1, keepdim=True)
    seen = torch.isfinite(total[:, 0]) & (total[:, 0] > 0)
    if not bool(seen.any()):
        return LobeSampling(torch.ones(2, 2, dtype=torch.float64), torch.ones(_LEVELS, dtype=torch.float64))
    density, share = _mixture(target[seen] / total[seen], cosine[seen], weights, isotropic)
    levels = torch.arange(_LEVELS).repeat_interleave(azimuths)[seen]
    count = torch.zeros(_LEVELS, dtype=torch.float64).index_add(0, levels, torch.ones_like(share))
    summed = torch.zeros(_LEVELS, dtype=torch.float64).index_add(0, levels, share)
    per_level = torch.where(count > 0, summed / count.clamp_min(1), torch.ones_like(summed))
    table = density.reshape(rows, _COLUMNS) * slope[:, None] * (4 * torch.pi)
    table = table[:, :1].expand(-1, 2) if isotropic else torch.cat((table, table[:, :1]), 1)
    return LobeSampling((table / _integral(table)).contiguous(), per_level.clamp(LEAST, 1))


def _half_vectors(s: Tensor) -> Tensor:
    """Nodes (K, J, 3) of the table, each direction once."""
    phi = torch.arange(_COLUMNS, dtype=torch.float64) * (2 * torch.pi / _COLUMNS)
    sine = 2 * torch.sqrt(s * (1 - s))
    around = torch.stack((torch.cos(phi), torch.sin(phi)), 1)
    height = (1 - 2 * s)[:, None, None].expand(-1, _COLUMNS, 1)
    return torch.cat((sine[:, None, None] * around, height), 2)


def _targets(reflectance: Reflectance, viewers: Tensor, halves: Tensor) -> tuple[Tensor, Tensor]:
    """f cosθi 4 h·ωo and cosθi/π · 4 h·ωo, both (V, M); 0 where the mirrored direction is not above."""
    target = torch.zeros(len(viewers), len(halves), dtype=torch.float64)
    cosine = torch.zeros_like(target)
    for rows in torch.arange(len(viewers)).split(max(1, _BATCH // len(halves))):
        wo = viewers[rows][:, None]
        towards = (wo * halves).sum(2)
        wi = 2 * towards[..., None] * halves - wo
        jacobian = 4 * towards * wi[..., 2]
        viewer, node = ((towards > 0) & (wi[..., 2] > 0)).nonzero(as_tuple=True)
        values = reflectance.evaluate(wi[viewer, node], viewers[rows][viewer]).to(torch.float64).mean(1)
        target[rows[viewer], node] = values.clamp_min(0) * jacobian[viewer, node]
        cosine[rows[viewer], node] = jacobian[viewer, node] / torch.pi
    return target, cosine


def _mixture(target: Tensor, cosine: Tensor, weights: Tensor, isotropic: bool) -> tuple[Tensor, Tensor]:
    """g (M,) and c (V,) of the module's head for normalised targets (V, M); `weights` (M,) are solid angles."""
    share = torch.full((len(target), 1), 0.5, dtype=torch.float64)
    density = target.mean(0)
    for _ in range(_STEPS):
        if isotropic:
            density = density.reshape(-1, _COLUMNS).mean(1).repeat_interleave(_COLUMNS)
        density = density / (density * weights).sum().clamp_min(torch.finfo(torch.float64).tiny)
        lobe = (1 - share) * density
        # Where neither part reaches, nothing is wanted either.
        part = target * lobe / (lobe + share * cosine).clamp_min(torch.finfo(torch.float64).tiny)
        share = 1 - (part * weights).sum(1, keepdim=True).clamp(0, 1)
        density = part.mean(0)
    if isotropic:
        density = density.reshape(-1, _COLUMNS).mean(1).repeat_interleave(_COLUMNS)
    return density, share[:, 0]


def _integral(table: Tensor) -> Tensor:
    """∫∫ of the bilinear table over the unit square, which trapezoids have exactly."""
    return ((table[:-1, :-1] + table[1:, :-1] + table[:-1, 1:] + table[1:, 1:]) / 4).mean()
