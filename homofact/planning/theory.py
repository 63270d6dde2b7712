"""Predict, before any fit, which orders of a lobe a lighting needs, and the error of one colour.

Averaged over all turnings of the lighting, the mean square of B = ∫ L g, g(ωi) = f cosθi at one view, is
Σ_l w_l e_l with w_l = E_l/(2l+1), E_l and e_l the energies by order of lighting and lobe (`scene.lighting`). The same
holds for the difference of two lobes, so the relative error of the light that one colour reflects is known as a mean
over all rotations. There is no such prediction for textures: their error depends on the directions and the stretching
of their projections. A bound from the orders that evenly spaced texels represent was within a factor of two of the
measured error in only 43 of 118 fits. K terms of an in-out SVD carry orders up to √(2K) − 1 (Mahajan et al. 2008: 2l+1
equal eigenvalues an order on the sphere, half of them on the hemisphere).
"""

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from homofact.brdf.reflectance import Reflectance
from homofact.geometry.directions import from_spherical
from homofact.planning.ladder import CONSTANT, Candidate
from homofact.scene.lighting import IRRADIANCE_ORDER, ORDER, Lighting
from homofact.theory.harmonics import energy_by_order, harmonics, quadrature

# Each the middle of as much of a sphere's picture: sin²θo at 1/12, 3/12 …
VIEW_SINES_SQUARED = tuple((2 * i + 1) / 12 for i in range(6))
_NODES = 48


@dataclass(frozen=True)
class Lobes:
    """Coefficients of f cosθi, (V, (ORDER+1)², C), at V views of equal weight, and of cosθi alone ((ORDER+1)²,)."""

    coefficients: Tensor
    cosine: Tensor

    @classmethod
    def of(cls, reflectance: Reflectance) -> "Lobes":
        """Return those of a reflectance, by quadrature on the upper hemisphere."""
        wi, weights = quadrature(_NODES, low=0.0)
        basis = harmonics(ORDER, wi) * (weights * wi[:, 2])[:, None]
        angles = torch.tensor(VIEW_SINES_SQUARED, dtype=torch.float64).sqrt().asin()
        views = from_spherical(angles, torch.zeros_like(angles))
        lobes = [basis.T @ reflectance.evaluate(wi, wo.expand_as(wi)).to(torch.float64) for wo in views]
        return cls(torch.stack(lobes), basis.sum(0))


def excitation(lighting: Lighting) -> Tensor:
    """Return w_l = E_l/(2l+1) (ORDER+1,): the mean square of the light per unit of a lobe's energy at order l."""
    return lighting.energies / (2 * torch.arange(ORDER + 1, dtype=torch.float64) + 1)


def mean_square(lobes: Tensor, lighting: Lighting) -> Tensor:
    """Return w_l e_l by order (ORDER+1,), averaged over views and summed over channels of the lobes."""
    return excitation(lighting) * torch.stack([energy_by_order(lobe).sum(1) for lobe in lobes]).mean(0)


def lost_above(lobes: Lobes, lighting: Lighting) -> Tensor:
    """Return relative error of the reflected light where a lobe is cut after each order: (ORDER+1,), falling to 0."""
    by_order = mean_square(lobes.coefficients, lighting)
    kept = by_order.cumsum(0) / by_order.sum()
    return (1 - kept).clamp_min(0).sqrt()


def order_needed(lobes: Lobes, lighting: Lighting, error: float) -> int:
    """Return the least order after which a lobe may be cut with this relative error of the reflected light."""
    return int((lost_above(lobes, lighting) <= error).nonzero()[0, 0])


def terms_needed(order: int) -> int:
    """Return how many terms of an in-out SVD represent all orders up to this one: (order+1)²/2, at least 1."""
    return max(1, math.ceil((order + 1) ** 2 / 2))


def colour_error(candidate: Candidate, lobes: Lobes, lighting: Lighting) -> float:
    """The relative error of the reflected light of the best colour, as "constant" or "lambert-9", over all turnings."""
    cosine = lobes.cosine.clone()
    if candidate.method != CONSTANT:
        cosine[(IRRADIANCE_ORDER + 1) ** 2 :] = 0
    whole = mean_square(lobes.coefficients, lighting).sum()
    residual = lobes.coefficients - best_colour(lobes, lighting) * cosine[:, None]
    return float((mean_square(residual, lighting).sum() / whole).sqrt())


def best_colour(lobes: Lobes, lighting: Lighting) -> Tensor:
    """c (C,) in sr⁻¹ whose lobe c cosθi comes nearest in reflected light."""
    degree = torch.arange(ORDER + 1).repeat_interleave(2 * torch.arange(ORDER + 1) + 1)
    weights = excitation(lighting)[degree]
    return (weights * lobes.cosine) @ lobes.coefficients.mean(0) / (weights * lobes.cosine**2).sum()
