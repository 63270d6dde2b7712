"""The curves of the analytic models as functions of their sliders (σ, n, k; nu, nv).

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


def matte_fade(channels: int) -> Formula:
    """1 − (1 − cosθ/2)⁵ of Ashikhmin and Shirley's matte term, for either direction."""

    def fade(gamma: Tensor) -> Tensor:
        value = 1 - (1 - torch.cos(gamma).clamp_min(0) / 2) ** 5
        return value[..., None].expand(*gamma.shape, channels)

    return Formula(fade, channels, "matte fade")


def _check(name: str, value: float, above_zero: bool = False) -> None:
    if not math.isfinite(value) or value < 0 or (above_zero and value == 0):
        raise BadInput(where=name, found=value, expected=f"a finite number {'above 0' if above_zero else '>= 0'}")
