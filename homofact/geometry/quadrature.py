"""Fixed nodes for integrals of a BRDF over the hemisphere of one direction, while the other is fixed.

A BRDF has peaks around the mirror direction, and sometimes around the retroreflection direction, over a smooth base.
The nodes are therefore placed over the half vector h of the two directions, in rings that grow like t⁴ from h = n:

    θh = t⁴ θmax(φh),  2 θmax = π/2 + atan2(sinθ cosφh, cosθ),  0 < t < 1,

Here θ is the angle of the fixed direction, and φh is counted from its azimuth. At θmax the mirrored direction reaches
the horizon, so every node is above the horizon and the horizon cuts through no cell. dωo = 4 (ωi·h) dωh. The nodes use
Gauss-Legendre quadrature in t and equal steps in φh, which converge fast for integrands that are smooth in h.

A second set is the first one rotated by π about the normal, so it is fine around retroreflection. Both are combined by
the balance heuristic (Veach and Guibas 1995): a node has the weight p/(p + p'), where p is the density of its own set
and p' that of the other set.
"""

import math

import numpy as np
import torch
from torch import Tensor

from homofact.geometry.directions import from_cosine, normalize

RINGS, SPOKES = 128, 64


def hemisphere_nodes(fixed: Tensor, rings: int = RINGS, spokes: int = SPOKES) -> tuple[Tensor, Tensor]:
    """Return directions (K, M, 3) above the horizon and their solid angles (K, M), M = 2 · rings · spokes.

    Σ of solid angle times g over the nodes k is ∫ g dω over the hemisphere, for g peaked at the mirror direction of
    `fixed` (K, 3), at `fixed` itself, or smooth. `fixed` are unit vectors with z > 0. float64.
    """
    fixed = fixed.to(torch.float64)
    nodes, weights = np.polynomial.legendre.leggauss(rings)
    t = torch.from_numpy((nodes + 1) / 2).repeat_interleave(spokes)
    step = torch.from_numpy(weights / 2).repeat_interleave(spokes) * (2 * math.pi / spokes)
    # Half a step off the plane of incidence, to which many tables are aligned.
    turn = ((torch.arange(spokes, dtype=torch.float64) + 0.5) * (2 * math.pi / spokes)).repeat(rings)
    azimuth = torch.atan2(fixed[:, 1], fixed[:, 0])[:, None]
    theta = t**4 * _limit(fixed[:, 2:], torch.cos(turn))
    h = from_cosine(torch.cos(theta), turn + azimuth)
    # cosθh has lost the digits of a narrow peak's angles.
    h[..., :2] = torch.sin(theta)[..., None] * torch.stack((torch.cos(turn + azimuth), torch.sin(turn + azimuth)), -1)
    towards = (h * fixed[:, None]).sum(-1, keepdim=True)
    found = 2 * towards * h - fixed[:, None]
    half = found * found.new_tensor([-1, -1, 1])
    density, other = (_density(fixed[:, None], each) for each in (found, half))
    share = density / (density + other)
    return torch.cat((found, half), 1), torch.cat((share * step / density,) * 2, 1)


def disc_nodes(levels: int) -> tuple[Tensor, Tensor]:
    """Return Gauss-Legendre nodes θ (K,) in radians and weights (K,) of sum 1 for ∫ g(θ) cosθ dω/π."""
    nodes, weights = np.polynomial.legendre.leggauss(levels)
    return torch.asin(torch.from_numpy((nodes + 1) / 2).sqrt()), torch.from_numpy(weights / 2)


def _limit(cosine: Tensor, turn: Tensor) -> Tensor:
    """θmax in radians at the cosine of φh, for a direction at `cosine` = cosθ."""
    sine = (1 - cosine**2).clamp_min(0).sqrt()
    return (math.pi / 2 + torch.atan2(sine * turn, cosine)) / 2


def _density(fixed: Tensor, found: Tensor) -> Tensor:
    """1/|dω/(dt dφh)| (K, M) of the first set at directions `found` (K, M, 3)."""
    h = normalize(fixed + found)
    sine = h[..., :2].norm(dim=-1)
    along = (h[..., :2] * fixed[..., :2]).sum(-1)
    off = (sine * fixed[..., :2].norm(dim=-1)).clamp_min(1e-300)
    limit = _limit(fixed[..., 2], (along / off).clamp(-1, 1))
    t = (torch.atan2(sine, h[..., 2]) / limit).clamp(1e-300, 1) ** 0.25
    towards = (h * fixed).sum(-1)
    return 1 / (16 * towards * sine * limit * t**3).clamp_min(1e-300)
