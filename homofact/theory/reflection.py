"""Reflection as convolution: spectra of common lightings and BRDFs (Ramamoorthi 2002, chapter 3).

Equation numbers are the chapter's. A homogeneous convex surface under distant light L blurs it with its transfer
function ρ̂ = ρ cosθi: with Λ_l = √(4π/(2l+1)) a lobe that is symmetric about one direction gives
B_lm = Λ_l ρ̂_l L_lm (3.10), where ρ̂ = Σ ρ̂_l Y_l0; any isotropic BRDF gives B_lmpq = Λ_l L_lm ρ̂_lpq (3.5). The
functions for BRDFs return the dimensionless filter Λ_l ρ̂_l, which the chapter prints and plots. The filter of a mirror
is 1 at every order. Lighting coefficients are ((order+1)²,) with (l, m) at l² + l + m (`theory.harmonics`).
"""

import math

import torch
from torch import Tensor

from homofact.errors import BadInput
from homofact.theory.harmonics import energy_by_order, harmonics, orders


def normalisation(order: int) -> Tensor:
    """Λ_l = √(4π/(2l+1)) for l ≤ `order`, (order+1,): Y_l0(0) = 1/Λ_l."""
    return torch.sqrt(4 * math.pi / (2 * torch.arange(order + 1, dtype=torch.float64) + 1))


def directional_lighting(order: int, direction: Tensor) -> Tensor:
    """L_lm = Y_lm of the direction of a source of unit irradiance (3.13): ((order+1)²,).

    Along z it is δ_m0/Λ_l (3.14): the spectrum does not decay, so every order of a BRDF can be recovered with it.
    """
    return harmonics(order, direction[None])[0]


def uniform_lighting(order: int) -> Tensor:
    """Lighting of radiance 1/4π everywhere: only L_00 = 1/Λ_0 differs from 0 (3.19), ((order+1)²,)."""
    coefficients = torch.zeros((order + 1) ** 2, dtype=torch.float64)
    coefficients[0] = 1 / math.sqrt(4 * math.pi)
    return coefficients


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

    From l − 2 to l, the filter changes by the factor (s − l + 2)/(s + l + 1). Once s − l + 2 is 0, every second value
    from this l on is 0; where it is negative, signs alternate. Raises BadInput for s < 0.
    """
    if not exponent >= 0:
        raise BadInput(where="exponent", found=exponent, expected="0 or more")
    values = torch.ones(order + 1, dtype=torch.float64)
    for degree in range(1, order + 1):
        before = (exponent + 1) / (exponent + 2) if degree == 1 else values[degree - 2]
        step = 1.0 if degree == 1 else (exponent - degree + 2) / (exponent + degree + 1)
        values[degree] = before * step
    return values


def convolve_isotropic(lighting: Tensor, transfer: Tensor) -> Tensor:
    """B_lmpq = Λ_l L_lm ρ̂_lpq (3.5), by [lm, p, q]; `transfer` is ρ̂ by [l, p, q + order]."""
    scaled = normalisation(transfer.shape[0] - 1)[:, None, None] * transfer
    degree = orders(transfer.shape[0] - 1)[0]
    return lighting[:, None, None] * scaled[degree]


def lighting_condition(brdf_filter: Tensor, order: int | None = None) -> float:
    """Return the noise amplification of inverse lighting up to `order` (default: all), relative to order 0.

    max |Λ_l ρ̂_l| / min |Λ_l ρ̂_l|: 1 for a mirror, infinite for Lambert from order 3 on, about exp(order²/2s) for
    Phong.
    """
    sizes = brdf_filter[: None if order is None else order + 1].abs()
    return float(sizes.max() / sizes.min()) if float(sizes.min()) > 0 else math.inf


def brdf_condition(lighting: Tensor, order: int | None = None) -> float:
    """Return how much estimating a BRDF's filter up to `order` magnifies noise: max / min over l of √(Σ_m L_lm²) Λ_l.

    1 for one directional source, infinite for uniform light above order 0.
    """
    energy = energy_by_order(lighting)
    sizes = (energy.sqrt() * normalisation(len(energy) - 1))[: None if order is None else order + 1]
    # A source's own orders agree to rounding; below that is nothing.
    least, most = float(sizes.min()), float(sizes.max())
    return most / least if least > 1e-14 * most else math.inf
