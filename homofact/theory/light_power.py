"""The power spectrum of an environment map, to orders beyond those that pictures of smooth lobes need.

E_l = Σ_m |L_lm|² does not change if the environment rotates. Averaged over all rotations, each coefficient of order l
has the mean square E_l/(2l + 1). An FFT over azimuth transforms the rows of a lat-long map. For each order of azimuth,
the rows are then summed against P̄_lm(cosθ). For constant texels this is exact in azimuth; in elevation, each row uses
P̄_lm at its middle.
"""

import math

import torch
from torch import Tensor

from homofact.errors import BadInput
from homofact.rendering.light import EnvironmentMap
from homofact.theory.harmonics import normalised_legendre

_AT_ONCE = 64


def light_power(light: EnvironmentMap, order: int) -> Tensor:
    """E_l/(2l + 1) for l ≤ `order`, mean over channels: (order + 1,) float64. Raises BadInput for order < 0."""
    if order < 0:
        raise BadInput(where="harmonics", found=f"order {order}", expected="0 or more")
    rows, columns, channels = light.radiance.shape
    # Rows of a coarse map are divided: P̄_lm must not change much across one.
    times = max(1, -(-4 * (order + 1) // rows))
    radiance = light.radiance.double().repeat_interleave(times, 0)
    edges = torch.linspace(0, math.pi, rows * times + 1, dtype=torch.float64)
    height = -torch.cos(edges).diff()
    cosine = (torch.cos(edges[:-1]) + torch.cos(edges[1:])) / 2
    most = min(order, columns // 2)
    m = torch.arange(most + 1, dtype=torch.float64)
    # Of a texel's own width: the transform of a box.
    width = 2 * math.pi / columns * torch.sinc(m / columns)
    coefficients = torch.zeros(order + 1, most + 1, channels, dtype=torch.complex128)
    for part in torch.arange(rows * times).split(_AT_ONCE):
        waves = torch.fft.rfft(radiance[part], dim=1)[:, : most + 1] * width[:, None] * height[part][:, None, None]
        legendre = normalised_legendre(order, cosine[part])[:, : most + 1]
        coefficients += torch.einsum("lmr,rmc->lmc", legendre.to(waves), waves)
    twice = torch.where(m > 0, 2.0, 1.0)[:, None]
    energies = (coefficients.abs() ** 2 * twice).sum(1).mean(1)
    return energies / (2 * torch.arange(order + 1, dtype=torch.float64) + 1)
