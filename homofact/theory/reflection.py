"""Reflection as convolution: spectra of common lightings and BRDFs (Ramamoorthi 2002, chapter 3).

Equation numbers are the chapter's. A homogeneous convex surface under distant light L blurs it with its transfer
function ρ̂ = ρ cosθi: with Λ_l = √(4π/(2l+1)) a lobe that is symmetric about one direction gives
B_lm = Λ_l ρ̂_l L_lm (3.10), where ρ̂ = Σ ρ̂_l Y_l0; any isotropic one B_lmpq = Λ_l L_lm ρ̂_lpq (3.5). What the
functions of BRDFs return is the filter Λ_l ρ̂_l, dimensionless, which the chapter prints and plots; the mirror's
is 1 at every order. Lighting coefficients are ((order+1)²,) with (l, m) at l² + l + m (`theory.harmonics`).
"""

import math

import torch
from torch import Tensor

from homofact.errors import BadInput
from homofact.theory.harmonics import energy_by_order, harmonics, orders, zonal


def normalisation(order: int) -> Tensor:
    """Λ_l = √(4π/(2l+1)) for l ≤ `order`, (order+1,): Y_l0(0) = 1/Λ_l."""
    return torch.sqrt(4 * math.pi / (2 * torch.arange(order + 1, dtype=torch.float64) + 1))


def directional_lighting(order: int, direction: Tensor) -> Tensor:
    """L_lm = Y_lm of the direction of a source of unit irradiance (3.13): ((order+1)²,).

    Along z it is δ_m0/Λ_l (3.14): the spectrum does not decay, and every order of a BRDF can be had from it.
    """
    return harmonics(order, direction[None])[0]


def axial_lighting(coefficients: Tensor) -> Tensor:
    """Lighting symmetric about z from its zonal coefficients L_l (order+1,): L_lm = δ_m0 L_l (3.18), ((order+1)²,)."""
    degree, m = orders(len(coefficients) - 1)
    return torch.where(m == 0, coefficients[degree], torch.zeros_like(coefficients[degree]))


def uniform_lighting(order: int, radiance: float | None = None) -> Tensor:
    """Lighting equal everywhere: only L_00 differs from 0 (3.19), ((order+1)²,).

    L_00 = radiance · √(4π); unless a radiance is given, the chapter's 1/Λ_0, radiance 1/4π.
    """
    coefficients = torch.zeros((order + 1) ** 2, dtype=torch.float64)
    coefficients[0] = math.sqrt(4 * math.pi) * (1 / (4 * math.pi) if radiance is None else radiance)
    return coefficients


def mirror_transfer(order: int) -> Tensor:
    """ρ̂_lpq = (−1)^q δ_lp of a mirror, by [l, p, q + order] (3.23); 0 for |q| > l."""
    values = torch.zeros(order + 1, order + 1, 2 * order + 1, dtype=torch.float64)
    for degree in range(order + 1):
        q = torch.arange(-degree, degree + 1)
        values[degree, degree, order - degree : order + degree + 1] = (1 - 2 * (q.abs() % 2)).double()
    return values


def mirror_filter(order: int) -> Tensor:
    """Λ_l ρ̂_l = 1 of a mirror about the reflected direction (3.27)."""
    return torch.ones(order + 1, dtype=torch.float64)


def lambertian_filter(order: int) -> Tensor:
    """Λ_l ρ̂_l of the clamped cosine max(cosθ, 0) (3.32): π, 2π/3, π/4, 0, −π/24 … as printed in (3.33).

    The BRDF itself, albedo/π, is left out, as in the chapter.
    """
    values = torch.zeros(order + 1, dtype=torch.float64)
    for degree in range(order + 1):
        if degree == 1:
            values[degree] = 2 * math.pi / 3
        elif degree % 2 == 0:
            # l!/(2^l (l/2)!²) = Γ((l+1)/2)/(√π Γ(l/2+1)), free of large numbers; (−1)^(l/2−1) at l = 0 is −1.
            bracket = math.exp(math.lgamma((degree + 1) / 2) - math.lgamma(degree / 2 + 1)) / math.sqrt(math.pi)
            sign = -1 if (degree // 2) % 2 == 0 else 1
            # Λ_l ρ̂_l = 2π times the rest of (3.32), its root cancelled by Λ_l.
            values[degree] = 2 * math.pi * sign / ((degree + 2) * (degree - 1)) * bracket
    return values


def phong_filter(order: int, exponent: float) -> Tensor:
    """Λ_l ρ̂_l of Phong's normalised lobe (s+1)/2π cos^s about the mirror direction (3.37), s the `exponent`.

    From l − 2 to l it is a factor (s − l + 2)/(s + l + 1): 0 from there on once s − l + 2 is 0, and alternating
    beyond. Raises BadInput for s < 0.
    """
    if not exponent >= 0:
        raise BadInput(where="exponent", found=exponent, expected="0 or more")
    values = torch.ones(order + 1, dtype=torch.float64)
    for degree in range(1, order + 1):
        before = (exponent + 1) / (exponent + 2) if degree == 1 else values[degree - 2]
        step = 1.0 if degree == 1 else (exponent - degree + 2) / (exponent + degree + 1)
        values[degree] = before * step
    return values


def phong_gaussian(order: int, exponent: float) -> Tensor:
    """exp(−l²/2s), what Phong's filter tends to for l ≪ s (3.40). Raises BadInput for s ≤ 0."""
    if not exponent > 0:
        raise BadInput(where="exponent", found=exponent, expected="above 0")
    return torch.exp(-(torch.arange(order + 1, dtype=torch.float64) ** 2) / (2 * exponent))


def microfacet_filter(order: int, sigma: float) -> Tensor:
    """exp(−(σl)²), the approximate filter of the simplified Torrance-Sparrow lobe (3.51), σ in radians.

    exp(−(θh/σ)²)/4πσ² seen from the normal, where θh is half the angle to the mirror direction. Good for σ ≪ 1 and
    far from grazing; at the normal within .45 σ of the integral (3.44). Raises BadInput for σ ≤ 0.
    """
    if not sigma > 0:
        raise BadInput(where="sigma", found=sigma, expected="above 0")
    return torch.exp(-((sigma * torch.arange(order + 1, dtype=torch.float64)) ** 2))


def convolve(lighting: Tensor, brdf_filter: Tensor) -> Tensor:
    """B_lm = Λ_l ρ̂_l L_lm (3.10), ((order+1)²,) like `lighting`; `brdf_filter` is Λ_l ρ̂_l (order+1,)."""
    return lighting * _by_coefficient(lighting, brdf_filter)


def convolve_isotropic(lighting: Tensor, transfer: Tensor) -> Tensor:
    """B_lmpq = Λ_l L_lm ρ̂_lpq (3.5), by [lm, p, q]; `transfer` is ρ̂ by [l, p, q] as `mirror_transfer` has it."""
    scaled = normalisation(transfer.shape[0] - 1)[:, None, None] * transfer
    degree = orders(transfer.shape[0] - 1)[0]
    return lighting[:, None, None] * scaled[degree]


def inverse_lighting(reflected: Tensor, brdf_filter: Tensor, floor: float = 0.0) -> Tensor:
    """L_lm = B_lm/(Λ_l ρ̂_l) (3.12 for a symmetric lobe); NaN where |Λ_l ρ̂_l| ≤ `floor`: not to be recovered."""
    own = _by_coefficient(reflected, brdf_filter)
    return torch.where(own.abs() > floor, reflected / own, torch.full_like(reflected, math.nan))


def inverse_brdf(reflected: Tensor, lighting: Tensor, floor: float = 0.0) -> Tensor:
    """Λ_l ρ̂_l (order+1,) from B_lm and L_lm (3.11): the least squares answer over m.

    NaN at orders where the lighting's Σ_m L_lm² is ≤ `floor`²: that light cannot tell (3.20 for uniform light).
    """
    energy = energy_by_order(lighting)
    degree = orders(len(energy) - 1)[0]
    product = torch.zeros_like(energy).index_add(0, degree, reflected * lighting)
    return torch.where(energy > floor**2, product / energy, torch.full_like(energy, math.nan))


def lighting_condition(brdf_filter: Tensor, order: int | None = None) -> float:
    """How much inverse lighting up to `order` (all unless given) magnifies noise, relative to order 0's.

    max |Λ_l ρ̂_l| / min |Λ_l ρ̂_l|: 1 for a mirror, infinite for Lambert from order 3 on, about exp(order²/2s) for
    Phong.
    """
    sizes = brdf_filter[: None if order is None else order + 1].abs()
    return float(sizes.max() / sizes.min()) if float(sizes.min()) > 0 else math.inf


def brdf_condition(lighting: Tensor, order: int | None = None) -> float:
    """How much estimating a BRDF's filter up to `order` magnifies noise: max / min over l of √(Σ_m L_lm²) Λ_l.

    1 for one directional source, infinite for uniform light above order 0.
    """
    energy = energy_by_order(lighting)
    sizes = (energy.sqrt() * normalisation(len(energy) - 1))[: None if order is None else order + 1]
    # A source's own orders agree to rounding; below that is nothing.
    least, most = float(sizes.min()), float(sizes.max())
    return most / least if least > 1e-14 * most else math.inf


def recoverable_order(brdf_filter: Tensor, noise: float) -> int:
    """The last order before |Λ_l ρ̂_l| first falls below `noise` times that of order 0 (orders that vanish passed over).

    About √(−2s ln noise) for Phong and √(−ln noise)/σ for microfacets; 2 for Lambert with noise .05.
    """
    sizes = brdf_filter.abs() / brdf_filter[0].abs()
    below = ((sizes < noise) & (sizes > 1e-12)).nonzero()
    last = int(below[0, 0]) - 1 if len(below) else len(sizes) - 1
    kept = (sizes[: last + 1] >= noise).nonzero()
    return int(kept[-1, 0])


def irradiance_share(order: int = 2) -> float:
    """Share of the energy of max(cosθ, 0), ∫ = 2π/3, that l ≤ `order` holds: .992 for the 9 terms of order 2."""
    own = (lambertian_filter(order) / normalisation(order)) ** 2
    return float(own.sum() / (2 * math.pi / 3))


def irradiance_error_bound(order: int = 2) -> float:
    """Largest error of irradiance by l ≤ `order` under any light ≥ 0 of unit flux ∫ L dω: 3/32 for order 2.

    |∫ L (k − k_order)| ≤ max |k − k_order| ∫ L, k = max(cosθ, 0); a single source reaches it. A source's own largest
    irradiance is 1, its mean 1/4.
    """
    cosine = torch.linspace(-1, 1, 20_001, dtype=torch.float64)
    kept = zonal(order, cosine) @ (lambertian_filter(order) / normalisation(order))
    return float((cosine.clamp_min(0) - kept).abs().max())


def _by_coefficient(coefficients: Tensor, by_order: Tensor) -> Tensor:
    if len(coefficients) != len(by_order) ** 2:
        raise BadInput(
            where="lighting",
            found=f"{len(coefficients)} coefficients beside a filter up to order {len(by_order) - 1}",
            expected=len(by_order) ** 2,
        )
    return by_order[orders(len(by_order) - 1)[0]]
