"""Interpolate scattered samples at any pair of directions, fast enough for a matrix of millions of entries.

Isotropic samples are interpolated by `brdf.scattered`, whose coordinates are invariant to azimuth, mirroring and
exchange of light and viewer. Anisotropic samples are resampled by `LocalPlanes`, which is several times as fast.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

from homofact.brdf.log_transform import LogTransform
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.samples import Samples
from homofact.brdf.scattered import Scattered
from homofact.errors import BadInput
from homofact.geometry.coordinates import coordinate_system
from homofact.geometry.nearest import tree_of

if TYPE_CHECKING:
    from scipy.spatial import KDTree

EPSILON = 1e-2
NEIGHBOURS = 20
RIDGE = 1e-3
_CHUNK = 100_000
# Where the stretch of |h| turns from linear to logarithmic, and how much longer h's axes are than d's.
_BEND = 0.1
_HALF_OVER_DIFFERENCE = 1.5


def resampled(samples: Samples, reciprocal: bool) -> Reflectance:
    """Return an interpolation of `samples`; `reciprocal` also uses anisotropic samples with exchanged directions.

    Raises BadInput for too few samples.
    """
    # A model's highlight beyond the measured angles would be what a truncated sum spends its terms on.
    return Scattered(samples, lobes=0) if samples.isotropic else LocalPlanes(samples, reciprocal)


@dataclass(frozen=True)
class LocalPlanes:
    """A `Reflectance` of `samples` by moving least squares of degree 1 over four coordinates.

    At each place, a plane is fitted to log(f/A + ε) of the nearest samples, with weights that fall to zero at the
    farthest sample and a small ridge on the slope. The value is clipped to the range of these logs, so the
    interpolation does not extrapolate. The coordinates are half and difference vector in their parabolic discs; the
    radius of the half vector is stretched near the normal to spread out a highlight. With `reciprocal`, every sample
    also occurs with exchanged directions. A is the mean and ε = 1e-2, as in `brdf.scattered`. Raises BadInput for too
    few samples.
    """

    samples: Samples
    reciprocal: bool = True

    def __post_init__(self) -> None:
        """Refuse too few samples."""
        if len(self.samples) < self.fetches:
            raise BadInput(
                f"{len(self.samples)} are too few to resample", where="samples", expected=f"at least {self.fetches}"
            )

    @property
    def channels(self) -> tuple[str, ...]:
        """The channels of the samples."""
        return self.samples.channels

    @property
    def nbytes(self) -> int:
        """Bytes of coordinates and logs of all samples in float64."""
        return len(self.samples) * (4 + len(self.channels)) * 8

    @property
    def fetches(self) -> int:
        """Samples read for one value."""
        return NEIGHBOURS

    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Return BRDF values (N, C) in sr⁻¹, ≥ 0, without the cosine; 0 where a direction is under the horizon."""
        values = torch.zeros(wi.shape[0], len(self.channels), dtype=torch.float64)
        rows = ((wi[:, 2] >= 0) & (wo[:, 2] >= 0)).nonzero()[:, 0]
        for part in rows.split(_CHUNK):
            values[part] = self._at(self._place(wi[part].double(), wo[part].double()))
        return values.to(wi)

    def _place(self, wi: Tensor, wo: Tensor) -> np.ndarray:
        place = coordinate_system("half-diff").evaluate(wi, wo)
        radius = place[:, :2].norm(dim=1, keepdim=True).clamp_min(1e-12)
        stretch = torch.asinh(radius / _BEND) / math.asinh(1 / _BEND)
        return torch.cat((place[:, :2] * (_HALF_OVER_DIFFERENCE * stretch / radius), place[:, 2:]), 1).numpy()

    @cached_property
    def _transform(self) -> LogTransform:
        return LogTransform.of_values(self.samples.values, EPSILON)

    @cached_property
    def _data(self) -> "tuple[KDTree, Tensor, Tensor]":
        """(tree, places (N, k), logs (N, C))."""
        logs = self._transform.forward(self.samples.values)
        place = self._place(self.samples.wi, self.samples.wo)
        if self.reciprocal:
            place = np.concatenate((place, self._place(self.samples.wo, self.samples.wi)))
            logs = torch.cat((logs, logs))
        return tree_of(place), torch.from_numpy(place), logs

    def _at(self, place: np.ndarray) -> Tensor:
        tree, places, logs = self._data
        distance, index = tree.query(place, k=NEIGHBOURS)
        near = torch.from_numpy(index)
        reach = torch.from_numpy(distance)[:, -1:].clamp_min(1e-9) * 1.05
        offset = (places[near] - torch.from_numpy(place)[:, None]) / reach[..., None]
        weight = (1 - (offset**2).sum(-1)).clamp_min(0) ** 2
        rows = torch.cat((torch.ones_like(offset[..., :1]), offset), -1)
        weighted = rows * weight[..., None]
        gram = weighted.transpose(1, 2) @ rows
        ridge = torch.full((rows.shape[2],), RIDGE, dtype=torch.float64)
        ridge[0] = 1e-12
        gram = gram + torch.diag(ridge) * weight.sum(1)[:, None, None]
        found = logs[near]
        plane = torch.linalg.solve(gram, weighted.transpose(1, 2) @ found)[:, 0]
        plane = plane.clamp(found.amin(1), found.amax(1))
        return self._transform.inverse(plane)
