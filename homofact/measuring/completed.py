"""Evaluate at any pair of directions the material estimated from samples and the prior."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import torch

from homofact.brdf.in_kind import answering_in_kind
from homofact.measuring.half_grid import HalfGrid
from homofact.measuring.posterior import BrdfPosterior

if TYPE_CHECKING:
    from torch import Tensor


@dataclass(frozen=True)
class CompletedBrdf:
    """The mean of a posterior as a `Reflectance`, isotropic and reciprocal."""

    grid: HalfGrid
    posterior: BrdfPosterior
    channels: tuple[str, ...]
    isotropic: bool = True

    @property
    def nbytes(self) -> int:
        """Bytes of L and the ratios at all nodes as float32."""
        return 4 * self.grid.size * (1 + len(self.channels))

    @property
    def fetches(self) -> int:
        """Nodes read for one value: those at the corners of a cell."""
        return 8

    @answering_in_kind
    def evaluate(self, wi: "Tensor", wo: "Tensor") -> "Tensor":
        """Return BRDF values (N, C) in sr⁻¹, without the cosine; 0 where a direction is under the horizon."""
        above = (wi[:, 2] >= 0) & (wo[:, 2] >= 0)
        values = torch.zeros(len(wi), len(self.channels), dtype=wi.dtype)
        if bool(above.any()):
            matrix = self.grid.matrix(wi[above].double(), wo[above].double())
            values[above] = torch.from_numpy(self.posterior.values(matrix)).to(values)
        return values
