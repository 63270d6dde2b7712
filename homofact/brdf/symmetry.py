"""Detect the symmetries of a BRDF: of a reflectance, of samples, and of the layout of the samples.

Symmetries of a reflectance. f may be unchanged if both directions are rotated about the normal (isotropic), swapped
(reciprocal), mirrored at the xz-plane (mirrored), or rotated by π (half turn). Each is tested at random pairs, half of
them near the mirror direction, where highlights are. A symmetry holds if 95% of the values differ by less than a
thousandth.

Reciprocity error. For a reflectance, f(ωi, ωo) and f(ωo, ωi) are compared at cosine-distributed pairs. For samples,
each sample is compared with the sample nearest to its swapped directions, within 1°. An interpolation would hide the
asymmetry, since its coordinates treat swapped pairs as equal. The error is |a − b|/((a + b)/2), with a and b means over
the channels.

Layout of the samples. Isotropic materials are measured with light from one azimuth; a goniometer's directions lie on
rings of θ.
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

from homofact.brdf.reflectance import Reflectance
from homofact.brdf.samples import Samples
from homofact.geometry.directions import draw_cosine_weighted, draw_uniform, from_spherical, normalize, to_spherical
from homofact.geometry.nearest import tree_of

if TYPE_CHECKING:
    from scipy.spatial import KDTree

_ALIKE = 1e-3
_PAIRS = 512
_NEAR = math.radians(1.0)
_MOST_SAMPLES = 20_000
RING_WIDTH = 1e-3  # radians: angles this close are one ring
_SAMPLES_ON_A_RING = 8


@dataclass(frozen=True)
class Symmetry:
    """Whether f stays the same if both directions are rotated, swapped, mirrored at the xz-plane, or rotated by π."""

    isotropic: bool
    reciprocal: bool
    mirrored: bool
    half_turn: bool

    @property
    def period_d(self) -> float:
        """The period of φd in radians."""
        return math.pi if self.reciprocal else 2 * math.pi

    @property
    def period_h(self) -> float:
        """The period of φh in radians, for an anisotropic source."""
        return math.pi if self.half_turn else 2 * math.pi


def find_symmetry(reflectance: Reflectance, limit: float = math.pi / 2, seed: int = 0) -> Symmetry:
    """Return which symmetries a reflectance has, at pairs drawn by `seed` within `limit` ≤ π/2 of the normal."""
    generator = torch.Generator().manual_seed(seed)
    squeeze = min(limit / (math.pi / 2), 1.0)
    polar = [to_spherical(w) for w in draw_uniform(_PAIRS, generator)]
    wi, wo = (from_spherical(theta * squeeze, phi) for theta, phi in polar)
    tilt = 10 ** (-3 * torch.rand(_PAIRS, 1, dtype=torch.float64, generator=generator))
    near = normalize(wi * wi.new_tensor((-1, -1, 1)) + tilt * wo * wo.new_tensor((1, 1, 0)))
    half = torch.arange(_PAIRS)[:, None] < _PAIRS // 2
    wo = torch.where(half & (near[:, 2:] >= math.cos(min(limit, math.pi / 2))), near, wo)
    here = reflectance.evaluate(wi, wo)
    tiny = 1e-6 * float(here.abs().mean()) + 1e-30

    def same(a: Tensor, b: Tensor) -> bool:
        there = reflectance.evaluate(a, b)
        off = (there - here).abs() / (there.abs() + here.abs() + tiny)
        return float(off.double().reshape(-1).quantile(0.95)) < _ALIKE

    angle = torch.rand(_PAIRS, dtype=torch.float64, generator=generator) * (2 * math.pi)
    mirror, opposite = wi.new_tensor((1, -1, 1)), wi.new_tensor((-1, -1, 1))
    return Symmetry(
        same(_turned(wi, angle), _turned(wo, angle)),
        same(wo, wi),
        same(wi * mirror, wo * mirror),
        same(wi * opposite, wo * opposite),
    )


def reciprocity_of(reflectance: Reflectance) -> dict[str, float]:
    """Return median and 95th percentile of the reciprocity error (see the module docstring) at 2000 pairs."""
    wi, wo = draw_cosine_weighted(2000, torch.Generator().manual_seed(0))
    one, two = (reflectance.evaluate(*pair).double().mean(1) for pair in ((wi, wo), (wo, wi)))
    return _spread(one, two)


@dataclass(frozen=True)
class Swapped:
    """N samples (rows `chosen`) and, for each of them, the sample nearest to its swapped directions.

    `tree` contains the coordinates `here` (N, k) of the samples, and `nearest` (N,) their indices in it. `paired` (N,)
    is true if the nearest sample is within the limit and the swapped pair differs from the sample itself.
    """

    chosen: Tensor
    tree: "KDTree"
    here: Tensor
    nearest: Tensor
    paired: Tensor


def swapped_neighbours(samples: Samples, seed: int = 0, near: float = _NEAR) -> Swapped:
    """Find the sample within `near` (1°) of each sample's swapped directions, for at most 20 000 drawn by `seed`.

    Pairs that swapping hardly changes (θi = θo within 1°) carry no information and count as not found.
    """
    chosen = torch.randperm(len(samples), generator=torch.Generator().manual_seed(seed))[:_MOST_SAMPLES]
    wi, wo = samples.wi[chosen], samples.wo[chosen]
    if samples.isotropic:
        here = angles_of_pairs(wi, wo)
        there = here[:, [1, 0, 2]]
    else:
        here, there = torch.cat((wi, wo), 1), torch.cat((wo, wi), 1)
    tree = tree_of(here.numpy())
    distance, nearest = tree.query(there.numpy(), distance_upper_bound=near)
    paired = torch.from_numpy(np.isfinite(distance)) & ((here - there).norm(dim=1) > 2 * _NEAR)
    return Swapped(chosen, tree, here, torch.from_numpy(np.asarray(nearest)), paired)


def reciprocity_of_samples(samples: Samples) -> dict[str, float] | None:
    """Return the reciprocity error of samples (see the module docstring); None for fewer than ten swapped pairs."""
    swapped = swapped_neighbours(samples)
    paired = swapped.paired
    if int(paired.sum()) < 10:
        return None
    values = samples.values[swapped.chosen].mean(1)
    return _spread(values[paired], values[swapped.nearest[paired]]) | {"pairs": int(paired.sum())}


def light_azimuths(isotropic: bool) -> tuple[float, ...]:
    """Return azimuths of the light in radians to test: one for an isotropic material, else along x and along y."""
    return (0.0,) if isotropic else (0.0, math.pi / 2)


def ring_numbers(directions: Tensor) -> tuple[Tensor, int] | None:
    """Return (ring (N,) of each direction from the normal outwards, number of rings); None without rings of θ.

    There are no rings if fewer than four are found, or if they have fewer than eight samples on average.
    """
    theta = to_spherical(directions)[0]
    angles, rank = torch.unique((theta / RING_WIDTH).round(), return_inverse=True)
    if not 4 <= len(angles) <= len(theta) // _SAMPLES_ON_A_RING:
        return None
    return rank, len(angles)


def angles_of_pairs(wi: Tensor, wo: Tensor) -> Tensor:
    """Return (θi, θo, |Δφ|) (N, 3) in radians, on which an isotropic, mirrored BRDF depends; |Δφ| in [0, π]."""
    (theta_i, phi_i), (theta_o, phi_o) = to_spherical(wi), to_spherical(wo)
    return torch.stack((theta_i, theta_o, torch.cos(phi_i - phi_o).clamp(-1, 1).acos()), 1)


def _turned(w: Tensor, angle: Tensor) -> Tensor:
    cos, sin = torch.cos(angle), torch.sin(angle)
    return torch.stack((cos * w[:, 0] - sin * w[:, 1], sin * w[:, 0] + cos * w[:, 1], w[:, 2]), -1)


def _spread(one: Tensor, two: Tensor) -> dict[str, float]:
    mean = (one + two) / 2
    error = torch.where(mean > 0, (one - two).abs() / mean.clamp_min(torch.finfo(mean.dtype).tiny), 0.0)
    return {"median": round(float(error.median()), 6), "p95": round(float(error.quantile(0.95)), 6)}
