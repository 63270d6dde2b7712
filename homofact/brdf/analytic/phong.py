"""Phong's lobe about the mirror direction and Blinn's about the half vector, as reciprocal BRDFs.

Phong (1975) defined the light reflected towards the eye, without a unit. If it is normalised and not divided by a
cosine, it is a BRDF (Lewis 1994). With r the mirror direction of ωi, r·ωo = 2 ωi.z ωo.z − ωi·ωo is symmetric, so the
BRDF is reciprocal. ∫ (n+2)/2π (r·ωo)ⁿ cosθo dωo is 1 at normal incidence and less elsewhere. Blinn (1977) uses (n·h)ⁿ
instead of (r·ωo)ⁿ; its integral at normal incidence is 8π(2^(−n/2) + n)/((n+2)(n+4)) (Giesen 2009).
"""

import math
from dataclasses import dataclass

from torch import Tensor

from homofact.brdf.analytic.common import AnalyticModel, Colour, half_vector


@dataclass(frozen=True)
class Phong(AnalyticModel):
    """f = kd/π + ks (n+2)/2π max(0, r·ωo)ⁿ in sr⁻¹, n the `exponent`.

    kd + ks ≤ 1 conserves energy: ks is the albedo of the lobe at normal incidence.
    """

    diffuse: Colour
    specular: Colour
    exponent: float

    def __post_init__(self) -> None:
        """Refuse colours that do not fit the channels and a negative exponent."""
        self.check_colour("diffuse")
        self.check_colour("specular")
        self.check_above("exponent", 0, inclusive=True)

    def formula(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Diffuse term and lobe."""
        cosine = (2 * wi[..., 2] * wo[..., 2] - (wi * wo).sum(-1)).clamp(0, 1)
        lobe = (self.exponent + 2) / (2 * math.pi) * cosine**self.exponent
        return self.diffuse_term(self.diffuse, wi) + lobe[..., None] * self.colour(self.specular, wi)


@dataclass(frozen=True)
class BlinnPhong(AnalyticModel):
    """f = kd/π + ks (n+2)(n+4)/(8π(2^(−n/2) + n)) (n·h)ⁿ in sr⁻¹, n the `exponent`.

    ks is the albedo of the lobe at normal incidence.
    """

    diffuse: Colour
    specular: Colour
    exponent: float

    def __post_init__(self) -> None:
        """Refuse colours that do not fit the channels and a negative exponent."""
        self.check_colour("diffuse")
        self.check_colour("specular")
        self.check_above("exponent", 0, inclusive=True)

    def formula(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Diffuse term and lobe."""
        n = self.exponent
        h, _ = half_vector(wi, wo)
        scale = (n + 2) * (n + 4) / (8 * math.pi * (2 ** (-n / 2) + n))
        lobe = scale * h[..., 2].clamp(0, 1) ** n
        return self.diffuse_term(self.diffuse, wi) + lobe[..., None] * self.colour(self.specular, wi)
