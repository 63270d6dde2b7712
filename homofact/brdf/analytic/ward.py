"""Ward's anisotropic Gaussian (Ward 1992, eq. 5a).

f = ρd/π + ρs exp(−tan²δ (cos²φ/αx² + sin²φ/αy²))/(√(cosθi cosθo) 4π αx αy)

δ and φ are the polar and azimuth angles of h, αx and αy the standard deviations of the slope along the
tangent and the binormal. It diverges as 1/√(cosθi cosθo) at grazing angles, so `evaluate` uses cosines of at least
1e-6.
"""

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from homofact.brdf.analytic.common import AnalyticModel, Colour, grazing, half_vector


@dataclass(frozen=True)
class Ward(AnalyticModel):
    """The model of the module docstring; values in sr⁻¹.

    `diffuse` ρd, `specular` ρs, `alpha_x` and `alpha_y` the RMS slopes; ρd + ρs ≤ 1 conserves energy for
    α of at most about 0.2, as Ward's normalisation is approximate.
    """

    diffuse: Colour
    specular: Colour
    alpha_x: float
    alpha_y: float

    def __post_init__(self) -> None:
        """Refuse colours that do not fit the channels and slopes ≤ 0."""
        self.check_colour("diffuse")
        self.check_colour("specular")
        self.check_above("alpha_x", 0)
        self.check_above("alpha_y", 0)

    @property
    def isotropic(self) -> bool:
        """True where both slopes are equal."""
        return self.alpha_x == self.alpha_y

    def formula(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Diffuse term and Gaussian."""
        h, _ = half_vector(wi, wo)
        # tan²δ cos²φ = (hx/hz)², and likewise for y.
        slope = ((h[..., 0] / self.alpha_x) ** 2 + (h[..., 1] / self.alpha_y) ** 2) / grazing(h[..., 2]) ** 2
        cosines = torch.sqrt(grazing(wi[..., 2]) * grazing(wo[..., 2]))
        lobe = torch.exp(-slope) / (cosines * (4 * math.pi * self.alpha_x * self.alpha_y))
        return self.diffuse_term(self.diffuse, wi) + lobe[..., None] * self.colour(self.specular, wi)
