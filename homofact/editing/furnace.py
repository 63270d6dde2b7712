"""White furnace test: the share of the light that an edited material reflects, for each direction.

a(θi) = ∫ f cosθo dωo is integrated at the nodes of `geometry.quadrature` and averaged over `AZIMUTHS` of ωi. No surface
reflects more light than it receives. Curves drawn by hand may break this law, and pictures do not reveal it.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import torch
from torch import Tensor

from homofact.brdf.reflectance import Reflectance
from homofact.geometry.directions import from_spherical
from homofact.geometry.quadrature import hemisphere_nodes

DEGREES = (0.0, 15.0, 30.0, 45.0, 60.0, 75.0, 85.0)
AZIMUTHS = (0.0, 45.0, 90.0, 135.0)
# What the nodes are good for: 1% of narrow anisotropic peaks.
SLACK = 0.01
_RINGS, _SPOKES = 64, 48


@dataclass(frozen=True)
class Albedo:
    """`values`: a row for each of the angles `degrees` of ωi, with one number per channel."""

    channels: tuple[str, ...]
    degrees: tuple[float, ...]
    values: tuple[tuple[float, ...], ...]

    @property
    def largest(self) -> float:
        """Over all angles and channels."""
        return max(max(row) for row in self.values)

    def warning(self) -> str | None:
        """Return one line if the albedo exceeds 1 by more than the error of the quadrature, else None."""
        if self.largest <= 1 + SLACK:
            return None
        angle, row = max(zip(self.degrees, self.values, strict=True), key=lambda pair: max(pair[1]))
        channel = self.channels[row.index(max(row))]
        return f"albedo {max(row):.2f} at {angle:.0f} degrees in {channel}: more light comes back than falls in"


def furnace_nodes(degrees: float) -> Iterator[tuple[Tensor, Tensor, Tensor]]:
    """Return (wi, wo) (N, 3) and weights (N,), cosθo dωo/azimuths, for all azimuths of ωi at an angle."""
    for azimuth in AZIMUTHS:
        angles = (torch.tensor([math.radians(each)], dtype=torch.float64) for each in (degrees, azimuth))
        wi = from_spherical(*angles)
        wo, weights = hemisphere_nodes(wi, _RINGS, _SPOKES)
        yield wi.expand(wo.shape[1], 3).contiguous(), wo[0], weights[0] * wo[0, :, 2] / len(AZIMUTHS)


def albedo_of(reflectance: Reflectance) -> Albedo:
    """Return the furnace's albedo of a reflectance."""
    rows = []
    for degrees in DEGREES:
        total = torch.zeros(len(reflectance.channels), dtype=torch.float64)
        for wi, wo, weights in furnace_nodes(degrees):
            total += (torch.as_tensor(reflectance.evaluate(wi, wo)) * weights[:, None]).sum(0)
        rows.append(tuple(total.tolist()))
    return Albedo(tuple(reflectance.channels), DEGREES, tuple(rows))
