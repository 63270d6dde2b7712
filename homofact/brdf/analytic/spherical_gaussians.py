"""Microfacets whose slopes are a sum of spherical Gaussians (Wang, Ren, Gong, Snyder and Guo 2009, section 3).

f = kd/π + F G/(4 cosθi cosθo) Σ aⱼ exp(λⱼ (cosθh − 1))

G = min(1, 2 (n·h)(n·ωo)/(h·ωo), 2 (n·h)(n·ωi)/(h·ωi)), the V-grooves of Torrance and Sparrow. F is Schlick's
approximation, with one F0 for all Gaussians. Wang et al. fit the same sum but derive their shadowing term from it; the
V-grooves have no parameters.
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from homofact.brdf.analytic.common import AnalyticModel, Colour, grazing, half_vector, schlick, v_grooves
from homofact.errors import BadInput
from homofact.geometry.namespace import like, namespace

if TYPE_CHECKING:
    from torch import Tensor


@dataclass(frozen=True)
class Gaussian:
    """One Gaussian about the normal: `amplitude` aⱼ per channel in sr⁻¹, and `sharpness` λⱼ > 0."""

    amplitude: Colour
    sharpness: float


@dataclass(frozen=True)
class SphericalGaussians(AnalyticModel):
    """The model of the module docstring; values in sr⁻¹, `reflectance` is F0 in [0, 1]."""

    diffuse: Colour
    gaussians: tuple[Gaussian, ...]
    reflectance: float

    def __post_init__(self) -> None:
        """Refuse colours that do not fit the channels, λ ≤ 0 and F0 outside [0, 1]."""
        self.check_colour("diffuse")
        for lobe in self.gaussians:
            if len(lobe.amplitude) != len(self.channels) or not all(0 <= x < math.inf for x in lobe.amplitude):
                raise BadInput(
                    f"amplitude is {lobe.amplitude}", where="SphericalGaussians", expected="one number >= 0 a channel"
                )
            if not 0 < lobe.sharpness < math.inf:
                raise BadInput(
                    f"sharpness is {lobe.sharpness}", where="SphericalGaussians", expected="a number above 0"
                )
        if not 0 <= self.reflectance <= 1:
            raise BadInput(
                f"reflectance is {self.reflectance}", where="SphericalGaussians", expected="a number from 0 to 1"
            )

    def formula(self, wi: "Tensor", wo: "Tensor") -> "Tensor":
        """Diffuse term and the Gaussians."""
        values = self.diffuse_term(self.diffuse, wi)
        f0 = like(self.reflectance, wi)
        for lobe in self.gaussians:
            sharpness = like(lobe.sharpness, wi)
            values = values + gaussian(sharpness, f0, wi, wo)[..., None] * self.colour(lobe.amplitude, wi)
        return values


def gaussian(sharpness: "Tensor", f0: "Tensor", wi: "Tensor", wo: "Tensor") -> "Tensor":
    """Return F G exp(λ (cosθh − 1))/(4 cosθi cosθo) (N,), of scalars λ and F0."""
    h, cosine = half_vector(wi, wo)
    ni, no = grazing(wi[..., 2]), grazing(wo[..., 2])
    # 1 − cosθh without cancellation: at a highlight it is all there is.
    fallen = (h[..., 0] ** 2 + h[..., 1] ** 2) / (1 + namespace(h).clip(h[..., 2], 0, None))
    facets = namespace(h).exp(-sharpness * fallen) * v_grooves(wi, wo) / (4 * ni * no)
    return schlick(f0, cosine)[..., 0] * facets
