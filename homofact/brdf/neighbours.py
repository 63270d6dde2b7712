"""A quick smooth interpolation of scattered samples from the nearest of them, for pictures of many thousand pairs.

`brdf.scattered` solves a system for every pair of directions. Here a plane meets the logarithms log((f + εA)/A) of the
`NEAREST` samples by weighted least squares. A sample counts (1 − r²)², r its distance over that of the farthest of
them, so that the surface has no steps. A slight ridge holds the plane, since neighbours may lie on one line, and the
result stays within the values of the neighbours.

Isotropic samples stand at (√θh cos 2φd, √θh sin 2φd, θd), scaled to 1: the root spreads the highlight, φd is folded to
[0, π/2], and all of it meets at θh = 0, where φd is undefined. Anisotropic ones stand at their `brdf.places`.

Three further readings of the same samples tell how sure the first one is: by each half of the samples, and by `MORE` of
them. A gonioreflectometer often scans a highlight finely in the plane of incidence (φd = 0) and coarsely elsewhere, so
beside this plane no reading knows the highlight. There, the values of a `round_lobe` are as likely: those of the
nearest samples if φd counts only by `_LIGHT_TURN`. A pair is beyond the samples where the nearest one is farther off
than samples are from each other.
"""

import math
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from homofact.brdf.log_transform import LogTransform
from homofact.brdf.places import half_places
from homofact.brdf.samples import Samples
from homofact.geometry.coordinates import rusinkiewicz_angles
from homofact.geometry.nearest import tree_of
from homofact.linear.kernels import kernel

NEAREST, MORE = 12, 24
# A pair's nearest sample may be so many times as far as all but a tenth of the samples are from their neighbours.
FARTHEST, MOST_SAMPLES, THEIR_NEIGHBOURS = 1.5, 0.9, 4
_RIDGE = 1e-2
_LIGHT_TURN, _NEARER = 0.1, 0.7
_SEED = 20261124


@dataclass(frozen=True)
class Interpolated:
    """Values of scattered samples between them.

    Attributes
    ----------
    readings : (N, C) BRDF values in sr⁻¹ each, the best first; 0 where a direction is under the horizon.
    round_lobe : (N, C) the same of a lobe round the normal, equal to the first reading where samples of the pair's own
        φd are near; None of anisotropic samples.
    beyond : (N,) whether no sample is near.
    """

    readings: tuple[Tensor, ...]
    round_lobe: Tensor | None
    beyond: Tensor


def interpolated(samples: Samples, epsilon: float, wi: Tensor, wo: Tensor) -> Interpolated:
    """Return the values of `samples` at pairs of directions (N, 3), by the ε of the logarithm."""
    transform = LogTransform.of_values(samples.values.cpu(), epsilon)
    logs = transform.forward(samples.values.cpu()).numpy()
    tree = tree_of(_places(samples.wi.cpu(), samples.wo.cpu(), samples.isotropic))
    spacing = np.asarray(tree.query(tree.data, k=min(1 + THEIR_NEIGHBOURS, len(samples)))[0])[:, -1]
    above = ((wi[:, 2] >= 0) & (wo[:, 2] >= 0))[:, None]
    place = _places(wi.double(), wo.double(), samples.isotropic)
    distance, near = (
        each.reshape(len(place), -1) for each in map(np.asarray, tree.query(place, k=min(MORE, len(samples))))
    )
    half = torch.rand(len(samples), generator=torch.Generator().manual_seed(_SEED)).numpy() < 0.5
    everything = np.ones(len(samples), dtype=bool)
    readings = [
        _planes(place, np.ascontiguousarray(tree.data), logs, distance, near, kept, number, _RIDGE)
        for kept, number in ((everything, NEAREST), (half, NEAREST), (~half, NEAREST), (everything, MORE))
    ]
    if samples.isotropic:
        turned = tree_of(_places(samples.wi.cpu(), samples.wo.cpu(), True, _LIGHT_TURN))
        place = _places(wi.double(), wo.double(), True, _LIGHT_TURN)
        nearer, others = (
            each.reshape(len(place), -1) for each in map(np.asarray, turned.query(place, k=min(MORE, len(samples))))
        )
        points = np.ascontiguousarray(turned.data)
        found = _planes(place, points, logs, nearer, others, everything, NEAREST, _RIDGE)
        elsewhere = (nearer[:, 0] < _NEARER * distance[:, 0])[:, None]
        readings.append(np.where(elsewhere, found, readings[0]))
    values = [torch.where(above, transform.inverse(torch.from_numpy(each)), 0.0) for each in readings]
    round_lobe = values.pop() if samples.isotropic else None
    beyond = distance[:, 0] > FARTHEST * np.quantile(spacing, MOST_SAMPLES)
    return Interpolated(tuple(values), round_lobe, torch.from_numpy(beyond))


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


def _places(wi: Tensor, wo: Tensor, isotropic: bool, turn: float = 1.0) -> np.ndarray:
    """Where pairs of directions stand among the samples, (N, 3) or (N, 5), as the module's head defines it.

    `turn` multiplies the folded φd of isotropic samples.
    """
    if not isotropic:
        return half_places(wi, wo, False).cpu().numpy()
    theta_h, theta_d, phi_d = rusinkiewicz_angles(wi, wo)
    root = (theta_h / (math.pi / 2)).sqrt()
    angle = turn * torch.acos(torch.cos(2 * phi_d).clamp(-1, 1)) if turn != 1 else 2 * phi_d
    scaled = theta_d / (math.pi / 2)
    return torch.stack((root * torch.cos(angle), root * torch.sin(angle), scaled), 1).cpu().numpy()
