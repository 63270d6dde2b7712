"""Estimate the noise of a measurement from the differences between its neighbouring samples.

For a subset of the samples, a plane over the directions (θi, θo, |Δφ| for an isotropic material, else ωi and ωo) is
fitted to the nearest neighbours of each sample. The residual of the sample, scaled by the degrees of freedom, is its
scatter. The residual includes the curvature of the BRDF between neighbours, so the estimate is an upper bound. The
median over the samples limits the influence of highlights.

`relative` is the scatter of log(f/A + 0.01), with A the mean: the noise relative to the value. `floor` is the scatter
of f itself among the darkest quarter of the samples, in units of A. Values below the floor carry no information, so the
ε of the log transform should be at least as large.
"""

from dataclasses import dataclass

import numpy as np
import torch

from homofact.brdf.log_transform import LogTransform
from homofact.brdf.samples import Samples
from homofact.brdf.symmetry import angles_of_pairs
from homofact.geometry.nearest import tree_of

NEIGHBOURS = 12
_QUERIES = 2000
MOST_SAMPLES = 40_000
_NORMAL_MAD = 1.4826


@dataclass(frozen=True)
class Scatter:
    """`relative` in log units, `floor` in units of the mean value; both of the worst channel."""

    relative: float
    floor: float


def local_scatter(samples: Samples, seed: int = 0) -> Scatter | None:
    """Return the scatter of the module's head; None for fewer samples than two neighbourhoods."""
    some = samples.subset(MOST_SAMPLES, seed).to("cpu")
    if len(some) < 2 * NEIGHBOURS:
        return None
    place = places_of(some).numpy()
    mean = some.values.mean(0).clamp_min(1e-300)
    linear = (some.values / mean).numpy()
    logs = LogTransform(0.01, mean).forward(some.values).numpy()
    chosen = torch.randperm(len(some), generator=torch.Generator().manual_seed(seed))[:_QUERIES].numpy()
    _, near = tree_of(place).query(place[chosen], k=NEIGHBOURS)
    both = np.hstack([logs, linear])
    near = np.asarray(near)
    residuals = _left_out(place[near], both[near])
    channels = logs.shape[1]
    relative = _NORMAL_MAD * np.median(np.abs(residuals[:, :channels]), 0)
    brightness = linear[chosen].mean(1)
    dark = residuals[brightness <= np.quantile(brightness, 0.25), channels:]
    return Scatter(float(relative.max()), float((_NORMAL_MAD * np.median(np.abs(dark), 0)).max()))


def places_of(samples: Samples) -> torch.Tensor:
    """Return the coordinates of direction pairs for a neighbour search: (N, 3) for an isotropic material, else (N, 6).

    The three coordinates in radians are θi, θo and the arc length of |Δφ| at their mean angle, so the azimuth matters
    little near the normal.
    """
    if not samples.isotropic:
        return torch.cat((samples.wi, samples.wo), 1)
    theta_i, theta_o, turn = angles_of_pairs(samples.wi, samples.wo).unbind(1)
    return torch.stack((theta_i, theta_o, turn * torch.sin((theta_i + theta_o) / 2)), 1)


def _left_out(place: np.ndarray, values: np.ndarray) -> np.ndarray:
    """What a plane through all neighbours (Q, K, 3) leaves of the first (Q, C), over the square root of its freedom."""
    design = np.concatenate([np.ones((*place.shape[:2], 1)), place - place[:, :1]], 2)
    basis, sizes, _ = np.linalg.svd(design, full_matrices=False)
    basis = basis * (sizes > 1e-9 * sizes[:, :1])[:, None]
    first = basis[:, 0]
    left = values[:, 0] - np.einsum("qk,qnk,qnc->qc", first, basis, values)
    freedom = 1 - (first**2).sum(1)
    return np.where(freedom > 1e-6, 1 / np.sqrt(freedom.clip(1e-300)), 0.0)[:, None] * left
