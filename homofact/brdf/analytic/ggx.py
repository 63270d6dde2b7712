"""Microfacets of Walter, Marschner, Li and Torrance (2007, "GGX"), one lobe or several over a diffuse base.

f = kd/π + Σ ks F D G/(4 cosθi cosθo)

D = α²/(π (cos²θh (α² − 1) + 1)²)                                              eq. 33, with α for αb
G/(4 cosθi cosθo) = ½/(cosθo √(cos²θi (1 − α²) + α²) + cosθi √(cos²θo (1 − α²) + α²))
                                                        Smith's, both directions together (Heitz 2014, eq. 99)
F = F0 + (1 − F0)(1 − cosθd)⁵                                                   Schlick 1994

Each lobe has its own α, F0 and colour ks. ks may exceed 1, since fits to measurements can need larger values.
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from homofact.brdf.analytic.common import AnalyticModel, Colour, grazing, half_vector, schlick
from homofact.errors import BadInput
from homofact.geometry.namespace import like, namespace

if TYPE_CHECKING:
    from torch import Tensor


@dataclass(frozen=True)
class GgxLobe:
    """One lobe: `roughness` α > 0, `reflectance` F0 in [0, 1] for all channels, and `specular` ks per channel."""

    specular: Colour
    roughness: float
    reflectance: float


@dataclass(frozen=True)
class GgxBrdf(AnalyticModel):
    """The model of the module docstring; values in sr⁻¹, `diffuse` is kd."""

    diffuse: Colour
    lobes: tuple[GgxLobe, ...]

    def __post_init__(self) -> None:
        """Refuse colours that do not fit the channels, α ≤ 0 and F0 outside [0, 1]."""
        self.check_colour("diffuse")
        for lobe in self.lobes:
            if len(lobe.specular) != len(self.channels) or not all(0 <= x < math.inf for x in lobe.specular):
                raise BadInput(f"specular is {lobe.specular}", where="Ggx", expected="one number >= 0 a channel")
            if not 0 < lobe.roughness < math.inf or not 0 <= lobe.reflectance <= 1:
                raise BadInput(
                    where="Ggx",
                    found=f"a roughness of {lobe.roughness} and a reflectance of {lobe.reflectance}",
                    expected="the one above 0, the other from 0 to 1",
                )

    def formula(self, wi: "Tensor", wo: "Tensor") -> "Tensor":
        """Diffuse term and lobes."""
        values = self.diffuse_term(self.diffuse, wi)
        for lobe in self.lobes:
            alpha, f0 = (like(x, wi) for x in (lobe.roughness, lobe.reflectance))
            values = values + ggx_lobe(alpha, f0, wi, wo)[..., None] * self.colour(lobe.specular, wi)
        return values


def ggx_lobe(alpha: "Tensor", f0: "Tensor", wi: "Tensor", wo: "Tensor") -> "Tensor":
    """Return F D G/(4 cosθi cosθo) (N,) in sr⁻¹, of scalars α and F0."""
    h, cosine = half_vector(wi, wo)
    squared = alpha**2
    spread = h[..., 2] ** 2 * (squared - 1) + 1
    ni, no = grazing(wi[..., 2]), grazing(wo[..., 2])
    root = namespace(wi).sqrt
    masked = no * root(ni**2 * (1 - squared) + squared) + ni * root(no**2 * (1 - squared) + squared)
    return schlick(f0, cosine)[..., 0] * squared / (math.pi * spread**2) * 0.5 / masked
