"""A quick smooth interpolation of scattered samples from the nearest of them, for pictures of many thousand pairs.

`brdf.scattered` solves a system for every pair of directions. Here a plane meets the logarithms log((f + εA)/A) of the
`NEIGHBOURS` nearest samples by weighted least squares. A sample counts (1 − r²)², r its distance over that of the
farthest neighbour, so that the surface has no steps. A slight ridge holds the plane, since neighbours may lie on one
line, and the result stays within the values of the neighbours.

Isotropic samples stand at (√θh cos 2φd, √θh sin 2φd, θd), scaled to 1: the root spreads the highlight, φd is folded to
[0, π/2], and all of it meets at θh = 0, where φd is undefined. Anisotropic ones stand at the parabolic coordinates of
both directions.

`spread` gives other readings of the same samples, which tell how sure an interpolation is. A pair is `beyond` the
samples where the nearest one is farther off than samples are from each other.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import torch
from scipy.spatial import KDTree
from torch import Tensor

from homofact.brdf.in_kind import answering_in_kind
from homofact.brdf.log_transform import LogTransform
from homofact.brdf.samples import Samples
from homofact.geometry.coordinates import coordinate_system, rusinkiewicz_angles

NEIGHBOURS, MORE = 12, 32
# A pair's nearest sample may be so many times as far as all but a tenth of the samples are from their neighbours.
FARTHEST, OF_SAMPLES = 2.0, 0.9
_RIDGE = 1e-2
_CHUNK = 1 << 15


@dataclass(frozen=True)
class NearestSamples:
    """A `Reflectance` of the samples nearest to a pair of directions.

    `epsilon` > 0 is the ε of the logarithm, `neighbours` how many samples are read.
    """

    samples: Samples
    epsilon: float
    neighbours: int = NEIGHBOURS

    @property
    def channels(self) -> tuple[str, ...]:
        """Those of the samples."""
        return self.samples.channels

    @property
    def nbytes(self) -> int:
        """Bytes of coordinates and logs of all samples in float64."""
        return self._tree.data.nbytes + self._logs.nbytes

    @property
    def fetches(self) -> int:
        """Samples read for one value."""
        return self._read

    @answering_in_kind
    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        """BRDF values (N, C) in sr⁻¹, ≥ 0, without the cosine; 0 where a direction is under the horizon."""
        above = (wi[:, 2] >= 0) & (wo[:, 2] >= 0)
        place = _places(wi[above].double(), wo[above].double(), self.samples.isotropic)
        parts = [self._plane(place[start : start + _CHUNK]) for start in range(0, len(place), _CHUNK)]
        values = torch.zeros(wi.shape[0], len(self.channels), dtype=wi.dtype)
        if parts:
            values[above] = self._transform.inverse(torch.from_numpy(np.concatenate(parts))).to(values)
        return values

    def beyond(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Whether pairs (N,) are farther from any sample than samples are from each other."""
        place = _places(wi.double(), wo.double(), self.samples.isotropic)
        return torch.from_numpy(self._tree.query(place)[0] > FARTHEST * self._spacing)

    def spread(self, seed: int = 0) -> "tuple[NearestSamples, ...]":
        """Other readings of the same samples: of each half of them, drawn by `seed`, and of more neighbours."""
        first, second = self.samples.split(0.5, seed)
        return (
            *(replace(self, samples=half) for half in (first, second)),
            replace(self, neighbours=MORE),
        )

    def _plane(self, place: np.ndarray) -> np.ndarray:
        """The logs (N, C) at places (N, D)."""
        distance, near = (np.reshape(each, (len(place), -1)) for each in self._tree.query(place, k=self._read))
        r = distance / np.maximum(distance[:, -1:] * 1.0001, 1e-12)
        weight = (1 - r**2) ** 2
        weight /= weight.sum(1, keepdims=True)
        logs = self._logs[near]
        mean = np.einsum("nk,nkc->nc", weight, logs)
        offset = self._tree.data[near] - place[:, None]
        middle = np.einsum("nk,nkd->nd", weight, offset)
        offset = offset - middle[:, None]
        moment = np.einsum("nk,nkd,nke->nde", weight, offset, offset)
        size = np.trace(moment, axis1=1, axis2=2)[:, None, None] / moment.shape[1]
        moment = moment + (_RIDGE * size + 1e-15) * np.eye(moment.shape[1])
        slope = np.linalg.solve(moment, np.einsum("nk,nkd,nkc->ndc", weight, offset, logs))
        found = mean - np.einsum("nd,ndc->nc", middle, slope)
        return found.clip(logs.min(1), logs.max(1))

    @property
    def _read(self) -> int:
        return min(self.neighbours, len(self.samples))

    @cached_property
    def _tree(self) -> KDTree:
        return KDTree(_places(self.samples.wi.cpu(), self.samples.wo.cpu(), self.samples.isotropic))

    @cached_property
    def _spacing(self) -> float:
        distance = self._tree.query(self._tree.data, k=min(5, len(self.samples)))[0]
        return float(np.quantile(distance[:, -1], OF_SAMPLES))

    @cached_property
    def _transform(self) -> LogTransform:
        return LogTransform.of_values(self.samples.values.cpu(), self.epsilon)

    @cached_property
    def _logs(self) -> np.ndarray:
        return self._transform.forward(self.samples.values.cpu()).numpy()


def _places(wi: Tensor, wo: Tensor, isotropic: bool) -> np.ndarray:
    """Where pairs of directions stand among the samples, (N, 3) or (N, 4), as the module's head says."""
    if not isotropic:
        return coordinate_system("in-out").evaluate(wi, wo).cpu().numpy()
    theta_h, theta_d, phi_d = rusinkiewicz_angles(wi, wo)
    root = (theta_h / (math.pi / 2)).sqrt()
    scaled = theta_d / (math.pi / 2)
    return torch.stack((root * torch.cos(2 * phi_d), root * torch.sin(2 * phi_d), scaled), 1).cpu().numpy()
