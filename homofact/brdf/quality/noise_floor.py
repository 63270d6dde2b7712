"""The noise floor of a measurement: the scatter of its dark samples in units of the mean A, from which ε follows.

A constant floor cannot be distinguished from a Lambertian base and is not subtracted. The data do show by how much
values that should agree differ among the darkest quarter of the samples. A value below this difference carries no
information, and its logarithm must not influence the fit. Values that should agree are

* repeated: samples of the same two directions;
* swapped: samples within 1° of each other's swapped place. Their difference is the noise or a lack of reciprocity;
* neighbours: the residual of a sample against a plane through its nearest samples (`brdf.quality.scatter`), which
  includes the curvature of the BRDF.

The last two overestimate the noise, so the smallest estimate with at least `FEWEST` pairs is used. σ is 1.4826 times
the median of |difference|/√2.
"""

import numpy as np
import torch

from homofact.brdf.quality.scatter import local_scatter
from homofact.brdf.samples import Samples
from homofact.brdf.symmetry import angles_of_pairs
from homofact.geometry.nearest import tree_of

FEWEST = 30
_DARK_SHARE = 0.25
MOST_SAMPLES = 40_000
NEAR = np.radians(1.0)
_SAME = 1e-6
_NORMAL_MAD = 1.4826


def noise_floor(samples: Samples, seed: int = 0) -> float | None:
    """Return σ, as the module defines it, of the worst channel; None if too few samples can be compared."""
    some = samples.subset(MOST_SAMPLES, seed)
    linear = (some.values / some.values.mean(0).clamp_min(1e-300)).cpu().numpy()
    floors = [_of_pairs(linear, pairs) for pairs in (_repeated(some), _swapped(some))]
    scatter = local_scatter(samples, seed)
    floors.append(None if scatter is None else scatter.floor)
    return min((floor for floor in floors if floor is not None), default=None)


def _of_pairs(linear: np.ndarray, pairs: np.ndarray) -> float | None:
    """σ among the pairs (K, 2) whose mean is among the darkest quarter of all samples'; None for too few."""
    if len(pairs) == 0:
        return None
    one, two = linear[pairs[:, 0]], linear[pairs[:, 1]]
    dark = ((one + two) / 2).mean(1) <= np.quantile(linear.mean(1), _DARK_SHARE)
    if dark.sum() < FEWEST:
        return None
    return float((_NORMAL_MAD * np.median(np.abs(one - two)[dark], 0) / np.sqrt(2)).max())


def _repeated(samples: Samples) -> np.ndarray:
    """The numbers (K, 2) of samples of the same two directions, each beside the next of its like."""
    keys = (torch.cat((samples.wi, samples.wo), 1) / _SAME).round()
    group = torch.unique(keys, dim=0, return_inverse=True)[1].cpu().numpy()
    order = np.argsort(group, kind="stable")
    alike = group[order[1:]] == group[order[:-1]]
    return np.stack((order[:-1][alike], order[1:][alike]), 1)


def _swapped(samples: Samples) -> np.ndarray:
    """The numbers (K, 2) of samples within `NEAR` of each other's swapped place, but not of their own."""
    if samples.isotropic:
        here = angles_of_pairs(samples.wi, samples.wo).cpu().numpy()
        there = here[:, [1, 0, 2]]
    else:
        here = torch.cat((samples.wi, samples.wo), 1).cpu().numpy()
        there = here[:, [3, 4, 5, 0, 1, 2]]
    distance, nearest = tree_of(here).query(there, distance_upper_bound=NEAR)
    rows = np.flatnonzero(np.isfinite(distance) & (np.linalg.norm(here - there, axis=1) > 2 * NEAR))
    return np.stack((rows, np.asarray(nearest)[rows]), 1)
