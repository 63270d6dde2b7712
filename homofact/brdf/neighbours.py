"""Interpolate scattered samples smoothly and fast from the nearest samples, for pictures of many thousand pairs.

`brdf.scattered` solves a linear system for every pair of directions. This module instead fits a plane to the logarithms
log((f + εA)/A) of the `NEAREST` samples by weighted least squares. A sample has the weight (1 − r²)², where r is its
distance divided by the distance of the farthest of these samples; so the result is continuous. A small ridge term
regularises the plane, since the neighbours may lie on one line. The result stays within the range of the neighbours'
values.

Distances are measured in the coordinates of `brdf.places`, where φd of isotropic samples has the weight `READ_AZIMUTH`.

Three further interpolations show how reliable the first one is: one from each half of the samples, and one from the
`MORE` nearest samples. A pair is beyond the samples if its nearest sample is farther away than the samples usually are
from each other (times `FARTHEST`).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor

from homofact.brdf.log_transform import LogTransform
from homofact.brdf.places import READ_AZIMUTH, half_places
from homofact.brdf.samples import Samples
from homofact.geometry.nearest import tree_of
from homofact.linear.kernels import kernel

NEAREST, MORE = 12, 24
# A pair's nearest sample may be so many times as far as all but a tenth of the samples are from their neighbours.
FARTHEST, MOST_SAMPLES, THEIR_NEIGHBOURS = 1.5, 0.9, 4
_RIDGE = 1e-2
_SEED = 20261124


@dataclass(frozen=True)
class Interpolated:
    """Values interpolated between scattered samples.

    Attributes
    ----------
    readings : (N, C) BRDF values in sr⁻¹ each, the best first; 0 where a direction is under the horizon.
    beyond : (N,) whether no sample is near.
    """

    readings: tuple[Tensor, ...]
    beyond: Tensor


def interpolated(samples: Samples, epsilon: float, wi: Tensor, wo: Tensor) -> Interpolated:
    """Interpolate `samples` at pairs of directions (N, 3), with `epsilon` as the ε of the logarithm."""
    transform = LogTransform.of_values(samples.values.cpu(), epsilon)
    logs = transform.forward(samples.values.cpu()).numpy()
    above = ((wi[:, 2] >= 0) & (wo[:, 2] >= 0))[:, None]
    tree, place = _placed(samples, wi, wo, 1.0)
    spacing = np.asarray(tree.query(tree.data, k=min(1 + THEIR_NEIGHBOURS, len(samples)))[0])[:, -1]
    # Whether a sample is near is asked with φd in full: what was measured in one plane is unknown beside it.
    beyond = np.asarray(tree.query(place, k=1)[0]) > FARTHEST * np.quantile(spacing, MOST_SAMPLES)
    tree, place = _placed(samples, wi, wo, READ_AZIMUTH)
    distance, near = (
        each.reshape(len(place), -1) for each in map(np.asarray, tree.query(place, k=min(MORE, len(samples))))
    )
    half = torch.rand(len(samples), generator=torch.Generator().manual_seed(_SEED)).numpy() < 0.5
    everything = np.ones(len(samples), dtype=bool)
    readings = [
        _planes(place, np.ascontiguousarray(tree.data), logs, distance, near, kept, number, _RIDGE)
        for kept, number in ((everything, NEAREST), (half, NEAREST), (~half, NEAREST), (everything, MORE))
    ]
    values = (transform.inverse(torch.from_numpy(each)) for each in readings)
    return Interpolated(tuple(torch.where(above, each, 0.0) for each in values), torch.from_numpy(beyond))


@kernel()
def _planes(place, points, logs, distance, near, kept, number, ridge):
    """The logs (N, C) at places (N, D) by the first `number` of the neighbours (N, K) that are `kept` (samples,)."""
    count, dimension, channels = place.shape[0], place.shape[1], logs.shape[1]
    found = np.empty((count, channels))
    chosen, weight = np.empty(number, dtype=np.int64), np.empty(number)
    offset, middle = np.empty((number, dimension)), np.empty(dimension)
    moment, against = np.empty((dimension, dimension)), np.empty((dimension, channels))
    for n in range(count):
        used = 0
        reach = 0.0
        for k in range(near.shape[1]):
            if used < number and (kept[near[n, k]] or (used == 0 and k == near.shape[1] - 1)):
                chosen[used] = near[n, k]
                weight[used] = distance[n, k]
                reach = distance[n, k]
                used += 1
        reach = max(reach * 1.0001, 1e-12)
        total = 0.0
        middle[:] = 0.0
        for k in range(used):
            weight[k] = (1 - (weight[k] / reach) ** 2) ** 2
            total += weight[k]
            for d in range(dimension):
                offset[k, d] = points[chosen[k], d] - place[n, d]
                middle[d] += weight[k] * offset[k, d]
        middle /= total
        moment[:] = 0.0
        against[:] = 0.0
        mean = np.zeros(channels)
        low, high = logs[chosen[0]].copy(), logs[chosen[0]].copy()
        for k in range(used):
            share = weight[k] / total
            for c in range(channels):
                value = logs[chosen[k], c]
                mean[c] += share * value
                low[c], high[c] = min(low[c], value), max(high[c], value)
            for d in range(dimension):
                off = share * (offset[k, d] - middle[d])
                for e in range(dimension):
                    moment[d, e] += off * (offset[k, e] - middle[e])
                for c in range(channels):
                    against[d, c] += off * logs[chosen[k], c]
        held = 1e-15
        for d in range(dimension):
            held += ridge * moment[d, d] / dimension
        for d in range(dimension):
            moment[d, d] += held
        # Gauss's elimination without pivots: the matrix is positive definite.
        for d in range(dimension):
            for e in range(d + 1, dimension):
                factor = moment[e, d] / moment[d, d]
                for g in range(d, dimension):
                    moment[e, g] -= factor * moment[d, g]
                for c in range(channels):
                    against[e, c] -= factor * against[d, c]
        for d in range(dimension - 1, -1, -1):
            for c in range(channels):
                for e in range(d + 1, dimension):
                    against[d, c] -= moment[d, e] * against[e, c]
                against[d, c] /= moment[d, d]
        for c in range(channels):
            value = mean[c]
            for d in range(dimension):
                value -= middle[d] * against[d, c]
            found[n, c] = min(max(value, low[c]), high[c])
    return found


def _placed(samples: Samples, wi: Tensor, wo: Tensor, azimuth: float) -> tuple[Any, np.ndarray]:
    """(the tree of the samples' places, the places of pairs of directions (N, 3))."""
    own = half_places(samples.wi.cpu(), samples.wo.cpu(), samples.isotropic, azimuth)
    asked = half_places(wi.double(), wo.double(), samples.isotropic, azimuth)
    return tree_of(own.cpu().numpy()), np.ascontiguousarray(asked.cpu().numpy())
