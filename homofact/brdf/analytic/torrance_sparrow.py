"""The simplified Torrance-Sparrow model of Mahajan, Tseng and Ramamoorthi (2008), eq. 14.

ρ = exp(−(θh/σ)²)/(4πσ²), θh = acos(n·h): the Gaussian of facet angles alone, without masking, Fresnel term
or cosines. It is the half-angle model for which the number of in-out terms K ≈ (l*)²/4 is known.
"""

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from homofact.brdf.analytic.common import AnalyticModel, Colour, half_vector


@dataclass(frozen=True)
class TorranceSparrow(AnalyticModel):
    """f = kd/π + ks exp(−(θh/σ)²)/(4πσ²) in sr⁻¹, `sigma` in radians.

    ks is the albedo of a narrow lobe at normal incidence.
    """

    diffuse: Colour
    specular: Colour
    sigma: float

    def __post_init__(self) -> None:
        """Refuse colours that do not fit the channels and σ ≤ 0."""
        self.check_colour("diffuse")
        self.check_colour("specular")
        self.check_above("sigma", 0)

    def formula(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Diffuse term and Gaussian."""
        h, _ = half_vector(wi, wo)
        # atan2, because acos loses half of the digits at the peak.
        theta = torch.atan2(torch.hypot(h[..., 0], h[..., 1]), h[..., 2])
        lobe = torch.exp(-((theta / self.sigma) ** 2)) / (4 * math.pi * self.sigma**2)
        return self.diffuse_term(self.diffuse, wi) + lobe[..., None] * self.colour(self.specular, wi)
