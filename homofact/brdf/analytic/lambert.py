"""Lambert's ideal diffuse reflection (Lambert 1760): f = ρd/π."""

from dataclasses import dataclass

from torch import Tensor

from homofact.brdf.analytic.common import AnalyticModel, Colour


@dataclass(frozen=True)
class Lambert(AnalyticModel):
    """f = ρd/π in sr⁻¹. `diffuse` is the albedo ρd, one number per channel, at most 1 to conserve energy."""

    diffuse: Colour

    def __post_init__(self) -> None:
        """Refuse an albedo that does not fit the channels."""
        self.check_colour("diffuse")

    def formula(self, wi: Tensor, wo: Tensor) -> Tensor:
        """ρd/π, the same for every pair."""
        return self.diffuse_term(self.diffuse, wi).clone()
