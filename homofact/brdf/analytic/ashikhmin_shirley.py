"""Ashikhmin and Shirley's anisotropic Phong model (2000), eq. 3–5.

ρs = √((nu+1)(nv+1))/8π · (n·h)^((nu (h·u)² + nv (h·v)²)/(1 − (n·h)²)) / ((h·k) max(n·k1, n·k2)) · F(k·h)
ρd = 28 Rd/23π · (1 − Rs)(1 − (1 − n·k1/2)⁵)(1 − (1 − n·k2/2)⁵)

F is Schlick's approximation with the reflectance Rs at normal incidence. The model conserves energy and is reciprocal.
The lobe is wider along the axis with the smaller exponent.
"""

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from homofact.brdf.analytic.common import AnalyticModel, Colour, grazing, half_vector, schlick
from homofact.errors import BadInput


@dataclass(frozen=True)
class AshikhminShirley(AnalyticModel):
    """ρs + ρd in sr⁻¹. `diffuse` Rd and `specular` Rs in [0, 1], exponents `nu` along x and `nv` along y."""

    diffuse: Colour
    specular: Colour
    nu: float
    nv: float

    def __post_init__(self) -> None:
        """Refuse colours that do not fit the channels or exceed 1, and negative exponents."""
        for name in ("diffuse", "specular"):
            self.check_colour(name)
            if max(getattr(self, name)) > 1:
                raise BadInput(
                    f"{name} is {getattr(self, name)}", where="AshikhminShirley", expected="numbers in [0, 1]"
                )
        self.check_above("nu", 0, inclusive=True)
        self.check_above("nv", 0, inclusive=True)

    @property
    def isotropic(self) -> bool:
        """True where both exponents are equal."""
        return self.nu == self.nv

    def formula(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Return both terms."""
        h, cosine = half_vector(wi, wo)
        x_squared, y_squared = h[..., 0] ** 2, h[..., 1] ** 2
        sine_squared = x_squared + y_squared
        # At h = n the exponent is 0/0 and the power is 1 whatever it is.
        exponent = (self.nu * x_squared + self.nv * y_squared) / sine_squared.clamp_min(torch.finfo(wi.dtype).tiny)
        power = torch.exp(exponent * torch.log(grazing(h[..., 2])))
        ni, no = grazing(wi[..., 2]), grazing(wo[..., 2])
        scale = math.sqrt((self.nu + 1) * (self.nv + 1)) / (8 * math.pi)
        lobe = scale * power / (grazing(cosine) * torch.maximum(ni, no))
        specular = self.colour(self.specular, wi)
        fade = (1 - (1 - wi[..., 2] / 2) ** 5) * (1 - (1 - wo[..., 2] / 2) ** 5)
        matte = 28 / (23 * math.pi) * self.colour(self.diffuse, wi) * (1 - specular)
        return lobe[..., None] * schlick(specular, cosine) + matte * fade.clamp_min(0)[..., None]
