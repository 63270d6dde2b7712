"""The kernels by which levels of a sky's chain average light: powers of the cosine, or GGX half vectors.

A level of our own chain (`rendering.sky_chain`) weighs light at an angle γ from its direction by a power of the cosine,

    K(γ) = (p + 1)/(2π) cosᵖγ,   0 ≤ γ < π/2,   p = 1/α²,   ∫ K dω = 1,

which is close to a Gaussian with a standard deviation of α radians along each axis. For α = 1 it is the cosine kernel,
and the averaged light is E/π.

Engines filter their skies by GGX for a viewer along the normal (Karis 2013). Light at γ is reflected by half vectors at
γ/2, and weighted by the cosine or by Smith's masking and shadowing G. With α = roughness²

    K(γ) ∝ D(γ/2) w(γ),   D(γ/2) ∝ 1/(1 + α² − (1 − α²) cosγ)²,   0 ≤ γ < π/2,
    w(γ) = cosγ   or   w(γ) = G = 2 cosγ/(cosγ + √(α² + (1 − α²) cos²γ)).

With the weight cosγ, roughness 1 also gives the cosine kernel. A level of roughness 0 is the sky itself, whose texels
act as the kernel.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

_NODES = 256


@dataclass(frozen=True)
class ChainKernels:
    """The kernels of a chain's levels by ascending α: powers of the cosine, or GGX weighted by "cosine" or "Smith".

    `least` is the width of a texel of the first level; a GGX kernel narrower than that is replaced by a power of the
    cosine with α = `least`. The last level, with α = 1, is the irradiance over π.
    """

    alphas: tuple[float, ...]
    ggx: str = ""
    least: float = 0.0

    @property
    def narrowest(self) -> float:
        """About the standard deviation of the first level's kernel, in radians."""
        return max(self.alphas[0], self.least)

    def at(self, level: int, gamma: np.ndarray) -> np.ndarray:
        """K of a level in sr⁻¹ at angles γ in radians."""
        alpha = self.alphas[level]
        # The last level is the irradiance, whatever the others are.
        if not self.ggx or alpha < self.least or alpha == 1:
            return cosine_power(max(alpha, self.least), gamma)
        return _ggx(alpha, self.ggx, gamma) / _whole(alpha, self.ggx)


def cosine_power(alpha: float, gamma: np.ndarray) -> np.ndarray:
    """Return the power of the cosine of an α in sr⁻¹ at angles γ in radians."""
    power = alpha**-2
    return (power + 1) / (2 * math.pi) * np.cos(gamma).clip(0) ** power


def ggx_kernels(roughnesses: tuple[float, ...], least: float, weight: str = "cosine") -> ChainKernels:
    """Return the kernels of an engine's chain for these roughnesses, the last 1; `least` is a texel in radians."""
    return ChainKernels(tuple(roughness**2 for roughness in roughnesses), weight, least)


def _ggx(alpha: float, weight: str, gamma: np.ndarray) -> np.ndarray:
    cosine, square = np.cos(gamma).clip(0), alpha * alpha
    weighted = cosine
    if weight == "Smith":
        weighted = 2 * cosine / (cosine + np.sqrt(square + (1 - square) * cosine**2))
    return weighted / (1 + square - (1 - square) * cosine) ** 2


@lru_cache(maxsize=64)
def _whole(alpha: float, weight: str) -> float:
    """The integral over the hemisphere, by Gauss and Legendre's nodes of y, γ = α sinh y."""
    x, w = np.polynomial.legendre.leggauss(_NODES)
    reach = math.asinh(math.pi / 2 / alpha)
    y = (x + 1) * (reach / 2)
    gamma = alpha * np.sinh(y)
    inner = _ggx(alpha, weight, gamma) * np.sin(gamma) * alpha * np.cosh(y)
    return float(2 * math.pi * (inner * w).sum() * reach / 2)
