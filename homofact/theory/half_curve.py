"""The half-angle curve of a reflectance and its highest order l*, from which the number of in-out terms follows.

Mahajan, Tseng and Ramamoorthi (2008), section 4: average the BRDF over θd, leaving out grazing angles, to a curve of
θh alone; transform it into (zonal) spherical harmonics; l* is the order up to which the wanted share of its energy
lies. Then K ≈ (l*)²/4. Orders start at 0, so l* + 1 orders are kept (the paper's eq. 10). This module therefore uses
(l* + 1)²/4: a Gaussian curve (eq. 14) has 99% of its energy up to l* + 1 = √(2 ln 100)/σ, which gives 58 terms for σ =
.2 and 14 for .4 where the paper says about 60 and 10 to 20.

The curve is extended as an even function beyond θh = 90°, f(180° − θh) = f(θh). If it were cut off at 90°, the step of
a diffuse part would contribute to every order.
"""

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from homofact.brdf.reflectance import Reflectance
from homofact.geometry.directions import from_half_difference, from_spherical
from homofact.theory.harmonics import gauss_legendre, order_for_share, zonal

NODES, ORDER = 420, 300
_DIFFERENCES, _TURNS = 12, 4


@dataclass(frozen=True)
class HalfCurve:
    """`values` (Q,) in sr⁻¹ at increasing `theta_h` (Q,) in radians, which are Gauss nodes in cosθh with `weights`."""

    theta_h: Tensor
    values: Tensor
    weights: Tensor

    def spectrum(self, order: int = ORDER) -> Tensor:
        """Return the zonal coefficients (order+1,) of the curve, extended as an even function; 0 at odd orders."""
        values = 4 * math.pi * zonal(order, torch.cos(self.theta_h)).T @ (self.weights * self.values)
        values[1::2] = 0
        return values

    def l_star(self, share: float = 0.99, order: int = ORDER) -> float:
        """Return the interpolated order up to which `share` of the energy lies, but at most `order`.

        Raises BadInput as `order_for_share`.
        """
        energies = self.spectrum(order) ** 2
        within = float(energies.sum()) / self.energy if self.energy > 0 else 1.0
        return order_for_share(energies, share / within) if share < within else float(order)

    @property
    def energy(self) -> float:
        """∫ f² over the sphere, the energy of all orders."""
        return float(4 * math.pi * (self.weights * self.values**2).sum())


def half_angle_curve(reflectance: Reflectance, limit: float = math.radians(85)) -> HalfCurve:
    """Return the mean over channels, θd and φd of a reflectance at each θh.

    θd has the value 0 and `_DIFFERENCES` evenly spaced values below `limit`. φd has `_TURNS` values in [0, π/2], and
    their mirror images in [π/2, π]. Pairs with a direction more than `limit` (radians) from the normal are left out.
    For θh without pairs, the curve repeats its last value.
    """
    cosine, weights = gauss_legendre(NODES, 0.0, 1.0)
    theta_h = torch.arccos(cosine).flip(0)
    theta_d = (torch.arange(_DIFFERENCES, dtype=torch.float64) + 0.5) * (limit / _DIFFERENCES)
    # θd = 0 is there for every θh within the limit.
    theta_d = torch.cat((torch.zeros(1, dtype=torch.float64), theta_d))
    phi_d = (torch.arange(_TURNS, dtype=torch.float64) + 0.5) * (math.pi / 2 / _TURNS)
    phi_d = torch.cat((phi_d, math.pi - phi_d))
    h = from_spherical(theta_h, torch.zeros_like(theta_h))[:, None, None, :]
    angles = torch.meshgrid(theta_d, phi_d, indexing="ij")
    d = from_spherical(*angles)[None]
    wi, wo = from_half_difference(*torch.broadcast_tensors(h, d))
    inside = (wi[..., 2] >= math.cos(limit) - 1e-12) & (wo[..., 2] >= math.cos(limit) - 1e-12)
    values = torch.zeros(inside.shape, dtype=torch.float64)
    values[inside] = reflectance.evaluate(wi[inside], wo[inside]).double().mean(1)
    counts = inside.sum((1, 2))
    means = values.sum((1, 2)) / counts.clamp_min(1)
    last = int((counts > 0).nonzero()[-1, 0])
    means[last + 1 :] = means[last]
    return HalfCurve(theta_h, means, weights.flip(0))
