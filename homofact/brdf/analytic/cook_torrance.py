"""The model of Cook and Torrance (1982), with the distribution as in Foley, van Dam, Feiner and Hughes (1990, 16.7).

f = kd/π + ks F D G/(π cosθi cosθo)

D = exp(−(tan β/m)²)/(4 m² cos⁴β), β the angle of h from the normal, m the RMS slope. The 4 in Foley's D and the π in
the denominator of f together normalise the distribution: ∫ (4D/π) cosβ dω = 1. G = min(1, 2 (n·h)(n·ωo)/(h·ωo), 2
(n·h)(n·ωi)/(h·ωi)), the V-grooves of Torrance and Sparrow. F = ½ (g−c)²/(g+c)² (1 + ((c(g+c)−1)/(c(g−c)+1))²) with c =
h·ωi, g² = η² + c² − 1: the unpolarised Fresnel reflectance of a dielectric, whose index Cook and Torrance take from the
reflectance at normal incidence, η = (1+√F0)/(1−√F0).
"""

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from homofact.brdf.analytic.common import AnalyticModel, Colour, grazing, half_vector, v_grooves
from homofact.errors import BadInput


@dataclass(frozen=True)
class CookTorrance(AnalyticModel):
    """The model of the module docstring; values in sr⁻¹.

    `diffuse` kd and `specular` ks scale the two parts, `roughness` is m, `reflectance` is F0, the Fresnel
    reflectance at normal incidence in (0, 1), the same for all channels as in a dielectric.
    """

    diffuse: Colour
    specular: Colour
    roughness: float
    reflectance: float

    def __post_init__(self) -> None:
        """Refuse colours that do not fit the channels, m ≤ 0 and F0 outside (0, 1)."""
        self.check_colour("diffuse")
        self.check_colour("specular")
        self.check_above("roughness", 0)
        if not 0 < self.reflectance < 1:
            raise BadInput(f"reflectance is {self.reflectance}", where="CookTorrance", expected="between 0 and 1")

    @property
    def index(self) -> float:
        """η, the index of refraction."""
        root = math.sqrt(self.reflectance)
        return (1 + root) / (1 - root)

    def formula(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Diffuse term and microfacets."""
        h, cosine = half_vector(wi, wo)
        peak = grazing(h[..., 2])
        tangent_squared = (h[..., 0] ** 2 + h[..., 1] ** 2) / peak**2
        m_squared = self.roughness**2
        # exp and 1/cos⁴ in one exponent: apart, they are 0·∞ for h on the horizon.
        distribution = torch.exp(-tangent_squared / m_squared - 4 * torch.log(peak)) / (4 * m_squared)
        ni, no = grazing(wi[..., 2]), grazing(wo[..., 2])
        microfacets = dielectric(cosine, self.index) * distribution * v_grooves(wi, wo) / (math.pi * (ni * no))
        return self.diffuse_term(self.diffuse, wi) + microfacets[..., None] * self.colour(self.specular, wi)


def dielectric(cosine: Tensor, index: float) -> Tensor:
    """Return the unpolarised Fresnel reflectance in [0, 1] from air into `index` ≥ 1, at the angle with `cosine`."""
    c = cosine.clamp(0, 1)
    g = torch.sqrt(index**2 + c**2 - 1)
    parallel = (c * (g + c) - 1) / (c * (g - c) + 1)
    return 0.5 * ((g - c) / (g + c)) ** 2 * (1 + parallel**2)
