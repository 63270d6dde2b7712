"""The curves of the analytic models as functions of their sliders.

Each is what its model in `brdf.analytic` computes, with the same guards, so that model and curves agree to rounding.
"""

import math

import torch
from torch import Tensor

from homofact.brdf.analytic.common import MIN_COSINE
from homofact.editing.curves import Formula
from homofact.errors import BadInput


def beckmann(sigma: float, channels: int) -> Formula:
    """D(θh) = exp(−(tanθh/σ)²)/(4σ² cos⁴θh), as `CookTorrance` has it; σ the RMS slope, above 0."""
    _check("sigma", sigma, above_zero=True)

    def density(gamma: Tensor) -> Tensor:
        cosine = torch.cos(gamma).clamp_min(MIN_COSINE)
        exponent = -((torch.sin(gamma) / cosine / sigma) ** 2) - 4 * torch.log(cosine)
        return (torch.exp(exponent) / (4 * sigma**2))[..., None].expand(*gamma.shape, channels)

    return Formula(density, channels, f"Beckmann, sigma {sigma:g}")


def fresnel(n: tuple[float, ...], k: tuple[float, ...]) -> Formula:
    """F(θd), the unpolarised Fresnel reflectance from air into an index n + ik of each channel, n > 0 and k ≥ 0."""
    if len(n) != len(k):
        raise BadInput(where="k", found=f"{len(k)} numbers", expected=f"{len(n)}, as many as n has")
    for value in n:
        _check("n", value, above_zero=True)
    for value in k:
        _check("k", value)
    real, imaginary = (torch.tensor(part, dtype=torch.float64) for part in (n, k))

    def reflectance(gamma: Tensor) -> Tensor:
        cosine = torch.cos(gamma)[..., None].clamp(0, 1)
        sine2 = 1 - cosine**2
        # (a + ib)² = (n + ik)² − sin²θ, as in Born and Wolf (14.2): s- and p-polarised reflectances.
        inner = real**2 - imaginary**2 - sine2
        length = torch.sqrt(inner**2 + (2 * real * imaginary) ** 2)
        a = ((length + inner) / 2).clamp_min(0).sqrt()
        s = (length - 2 * a * cosine + cosine**2) / (length + 2 * a * cosine + cosine**2)
        whole, mixed = length * cosine**2 + sine2**2, 2 * a * cosine * sine2
        return s * (1 + (whole - mixed) / (whole + mixed)) / 2

    words = f"Fresnel, n {', '.join(f'{x:g}' for x in n)}, k {', '.join(f'{x:g}' for x in k)}"
    return Formula(reflectance, len(n), words)


def cosine_power(exponent: float, channels: int) -> Formula:
    """√(n + 1) cosⁿγ: α and β of eq. 15 and 16, n the `exponent` ≥ 0."""
    _check("exponent", exponent)

    def lobe(gamma: Tensor) -> Tensor:
        # log cosγ = ½ log(1 − sin²γ), with its digits at the peak; cosγ stops at 1e-6 as in the model.
        sine2 = torch.sin(gamma) ** 2
        logarithm = (0.5 * torch.log1p(-sine2.clamp_max(1 - 1e-16))).clamp_min(math.log(MIN_COSINE))
        value = math.sqrt(exponent + 1) * torch.exp(exponent * logarithm)
        return value[..., None].expand(*gamma.shape, channels)

    return Formula(lobe, channels, f"cosine to the power {exponent:g}")


def phong_lobe(exponent: float, channels: int) -> Formula:
    """Return (n + 2)/2π cosⁿθr of `Phong`, n the `exponent` ≥ 0."""
    return _cosine_lobe(exponent, (exponent + 2) / (2 * math.pi), channels, "Phong")


def blinn_lobe(exponent: float, channels: int) -> Formula:
    """Return (n + 2)(n + 4)/(8π(2^(−n/2) + n)) cosⁿθh of `BlinnPhong`, n the `exponent` ≥ 0."""
    scale = (exponent + 2) * (exponent + 4) / (8 * math.pi * (2 ** (-exponent / 2) + exponent))
    return _cosine_lobe(exponent, scale, channels, "Blinn-Phong")


def sharpened(sharpening: float, channels: int) -> Formula:
    """cosᵐγ, m the `sharpening` ≥ 0: what makes a lobe narrower that is in the quotient; 1 everywhere for m = 0."""
    return _cosine_lobe(sharpening, 1.0, channels, "sharpened")


def facet_gaussian(sigma: float, channels: int) -> Formula:
    """exp(−(θh/σ)²)/(4πσ²) of `TorranceSparrow`, σ in radians, above 0."""
    _check("sigma", sigma, above_zero=True)

    def lobe(gamma: Tensor) -> Tensor:
        value = torch.exp(-((gamma / sigma) ** 2)) / (4 * math.pi * sigma**2)
        return value[..., None].expand(*gamma.shape, channels)

    return Formula(lobe, channels, f"Gaussian of angles, sigma {sigma:g}")


def slope_gaussian(alpha: float, channels: int, dimensions: int = 2) -> Formula:
    """exp(−tan²γ/α²)/(4πα²)^(d/2), α the RMS slope above 0.

    Isotropic `Ward` takes it over θh with d = 2; anisotropic, it is such a curve over θx times one over θy, d = 1 each.
    """
    _check("alpha", alpha, above_zero=True)

    def lobe(gamma: Tensor) -> Tensor:
        slope = torch.sin(gamma) / torch.cos(gamma).clamp_min(MIN_COSINE)
        value = torch.exp(-((slope / alpha) ** 2)) / (4 * math.pi * alpha**2) ** (dimensions / 2)
        return value[..., None].expand(*gamma.shape, channels)

    return Formula(lobe, channels, f"Gaussian of slopes, alpha {alpha:g}")


def _cosine_lobe(exponent: float, scale: float, channels: int, words: str) -> Formula:
    _check("exponent", exponent)

    def lobe(gamma: Tensor) -> Tensor:
        value = scale * torch.cos(gamma).clamp_min(0) ** exponent
        return value[..., None].expand(*gamma.shape, channels)

    return Formula(lobe, channels, f"{words}, exponent {exponent:g}")


def matte_fade(channels: int) -> Formula:
    """1 − (1 − cosθ/2)⁵ of Ashikhmin and Shirley's matte term, for either direction."""

    def fade(gamma: Tensor) -> Tensor:
        value = 1 - (1 - torch.cos(gamma).clamp_min(0) / 2) ** 5
        return value[..., None].expand(*gamma.shape, channels)

    return Formula(fade, channels, "matte fade")


def _check(name: str, value: float, above_zero: bool = False) -> None:
    if not math.isfinite(value) or value < 0 or (above_zero and value == 0):
        raise BadInput(where=name, found=value, expected=f"a finite number {'above 0' if above_zero else '>= 0'}")
