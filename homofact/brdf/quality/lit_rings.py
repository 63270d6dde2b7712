"""Group the samples of a goniometer by light direction, with the solid angle that is nearest to each sample.

A weighted sum over a ring is an integral over the viewer's directions: Σ f w = ∫ f cosθo dωo, where each direction has
the value of the nearest sample of the ring. For isotropic materials, the nearest sample is found in the coordinates of
`brdf.places`, based on the half vector. A highlight measured only in the plane of incidence then has the same width
across this plane; with the nearest viewer direction, its peak would spread across it. Scattered samples form no rings,
and rings with too few samples are left out.
"""

import math
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from homofact.brdf.places import half_places
from homofact.brdf.samples import Samples
from homofact.brdf.symmetry import RING_WIDTH, angles_of_pairs
from homofact.geometry.directions import from_spherical, to_spherical
from homofact.geometry.nearest import tree_of

_STEPS = 90  # of θo, and of the azimuth over half a turn
_LEAST = 100  # samples of a ring
_NEAR, _FAR_PART = math.radians(15.0), 0.1


@dataclass(frozen=True)
class LitRing:
    """The samples with one direction of the light.

    Attributes
    ----------
    degrees, azimuth : angle of incidence in degrees, and azimuth of the light in radians.
    index : (n,) int64, the samples' places.
    weights : (n,) cosθo times the solid angle that is nearest to each, π in all.
    """

    degrees: float
    azimuth: float
    index: Tensor
    weights: Tensor


def lit_rings(samples: Samples) -> tuple[LitRing, ...]:
    """Return the rings by increasing θi; for an anisotropic material, one ring per azimuth of the light.

    A ring is left out if it has fewer than `_LEAST` samples, or if more than `_FAR_PART` of the light that a white
    surface reflects has no sample within `_NEAR`.
    """
    theta, phi = to_spherical(samples.wi)
    keys = (theta / RING_WIDTH).round()[:, None]
    if not samples.isotropic:
        turn = (torch.remainder(phi, 2 * math.pi) / RING_WIDTH).round()
        keys = torch.cat((keys, torch.where(keys[:, 0] > 0, turn, 0.0)[:, None]), 1)
    _, ring, counts = torch.unique(keys, dim=0, return_inverse=True, return_counts=True)
    rings = []
    for number in (counts >= _LEAST).nonzero()[:, 0].tolist():
        index = (ring == number).nonzero()[:, 0]
        weights = _weights(samples.wi[index], samples.wo[index], samples.isotropic)
        if weights is not None:
            rings.append(LitRing(math.degrees(float(theta[index].mean())), float(phi[index[0]]), index, weights))
    return tuple(rings)


def _weights(wi: Tensor, wo: Tensor, isotropic: bool) -> Tensor | None:
    """As `LitRing.weights`; of an isotropic material both sides of the plane of incidence are alike."""
    steps = (torch.arange(_STEPS, dtype=torch.float64) + 0.5) / _STEPS
    spokes, turn = (steps, math.pi) if isotropic else (torch.cat((steps, steps + 1)) / 2, 2 * math.pi)
    theta, phi = (each.ravel() for each in torch.meshgrid(steps * (math.pi / 2), spokes * turn, indexing="ij"))
    views = from_spherical(theta, phi)
    angles = angles_of_pairs(wi, wo)
    places = from_spherical(angles[:, 1], angles[:, 2]) if isotropic else wo.double()
    apart, nearest = (np.asarray(each) for each in tree_of(places.cpu().numpy()).query(views.numpy()))
    cell = (math.pi / 2 / _STEPS) * (math.pi / _STEPS) * (2 if isotropic else 1)
    weight = torch.sin(theta) * torch.cos(theta) * cell
    if float(weight[torch.from_numpy(apart) > _NEAR].sum()) > _FAR_PART * math.pi:
        return None
    if isotropic:
        lit = from_spherical(angles[:, 0].mean(), torch.zeros((), dtype=torch.float64)).expand_as(views)
        tree = tree_of(half_places(wi, wo, True).cpu().numpy())
        nearest = np.asarray(tree.query(half_places(lit, views, True).numpy())[1])
    return torch.zeros(len(wi), dtype=torch.float64).index_add_(0, torch.from_numpy(nearest), weight)
