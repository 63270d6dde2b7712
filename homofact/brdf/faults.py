"""What can be wrong with a BRDF as a whole: not reciprocal, or giving back more light than it gets.

Reciprocity. Of a reflectance: f(ωi, ωo) and f(ωo, ωi) at pairs drawn by cosine. Of samples alone: each sample
against the nearest to its swapped place within 1°, since an interpolation over coordinates that fold the swap
would hide what the data say. The error is |a − b|/((a + b)/2), a and b means over the channels.

Energy. The albedo ∫ f cosθo dωo at a few angles of the light, over half vectors: ωo is ωi mirrored at h and
dωo = 4 (ωi·h) dωh, with θh finer towards the normal, so that narrow highlights are not missed.
"""

import math
from typing import Any

import numpy as np
import torch
from scipy.spatial import KDTree
from torch import Tensor

from homofact.brdf.reflectance import Reflectance
from homofact.brdf.samples import Samples
from homofact.geometry.coordinates import axes_of
from homofact.geometry.directions import draw_cosine_weighted, from_spherical, to_spherical

ALBEDO_DEGREES = (0.0, 15.0, 30.0, 45.0, 60.0, 75.0)
_NEAR = math.radians(1.0)
_MOST_SAMPLES = 20_000


def reciprocity_of(reflectance: Reflectance, count: int = 2000, seed: int = 0) -> dict[str, float]:
    """Median and 95th percentile of the reciprocity error of the module's head, at `count` pairs."""
    wi, wo = draw_cosine_weighted(count, torch.Generator().manual_seed(seed))
    one, two = (reflectance.evaluate(*pair).double().mean(1) for pair in ((wi, wo), (wo, wi)))
    return _spread(one, two)


def reciprocity_of_samples(samples: Samples, seed: int = 0) -> dict[str, float] | None:
    """The same of samples against those near their swapped places; None where fewer than ten have one.

    Pairs whose swapped place is their own (θi = θo within 1°) say nothing and are left out.
    """
    some = samples.subset(_MOST_SAMPLES, seed)
    if samples.isotropic:
        theta_i, theta_o, turn = axes_of(("theta_i", "theta_o", "delta_phi"), some.wi, some.wo).unbind(1)
        here, there = (torch.stack(x, 1) for x in ((theta_i, theta_o, turn), (theta_o, theta_i, turn)))
    else:
        here, there = torch.cat((some.wi, some.wo), 1), torch.cat((some.wo, some.wi), 1)
    distance, nearest = KDTree(here.numpy()).query(there.numpy(), distance_upper_bound=_NEAR)
    found = torch.from_numpy(np.isfinite(distance)) & ((here - there).norm(dim=1) > 2 * _NEAR)
    if int(found.sum()) < 10:
        return None
    values = some.values.mean(1)
    return _spread(values[found], values[torch.from_numpy(nearest)[found]]) | {"pairs": int(found.sum())}


def albedo(reflectance: Reflectance, degrees: float, azimuth: float = 0.0, rings: int = 48, spokes: int = 64) -> Tensor:
    """∫ f cosθo dωo (C,) for light at `degrees` from the normal, by rings × spokes half vectors."""
    edge = (torch.arange(rings + 1, dtype=torch.float64) / rings) ** 2 * (math.pi / 2)
    middle = ((torch.arange(rings, dtype=torch.float64) + 0.5) / rings) ** 2 * (math.pi / 2)
    solid = (torch.cos(edge[:-1]) - torch.cos(edge[1:])) * (2 * math.pi / spokes)
    theta = middle.repeat_interleave(spokes)
    phi = ((torch.arange(spokes, dtype=torch.float64) + 0.5) * (2 * math.pi / spokes)).repeat(rings)
    h = from_spherical(theta, phi)
    light = torch.tensor([math.radians(degrees)], dtype=torch.float64)
    wi = from_spherical(light, light * 0 + azimuth).expand_as(h)
    cosine = (wi * h).sum(-1)
    wo = 2 * cosine[:, None] * h - wi
    use = (cosine > 0) & (wo[:, 2] > 0)
    weight = 4 * cosine * wo[:, 2] * solid.repeat_interleave(spokes)
    return (reflectance.evaluate(wi[use], wo[use]).double() * weight[use, None]).sum(0)


def evaluated_faults(samples: Samples, reflectance: Reflectance, own: bool) -> dict[str, Any]:
    """Reciprocity error and albedo, JSON-able; `own` says that the reflectance is not made of the samples.

    An interpolation of samples is asked at fewer places, and for light only where there was light.
    """
    reciprocity = reciprocity_of(reflectance) if own else reciprocity_of_samples(samples)
    angles, fineness = (ALBEDO_DEGREES, {}) if own else (_lit(samples), {"rings": 16, "spokes": 24})
    azimuths = (0.0,) if samples.isotropic else (0.0, math.pi / 2)
    largest = {
        f"{angle:g}": round(max(float(albedo(reflectance, angle, a, **fineness).max()) for a in azimuths), 4)
        for angle in angles
    }
    return {
        "reciprocity_error": reciprocity,
        "albedo_by_degrees": largest,
        "energy_above_one": any(value > 1 for value in largest.values()),
    }


def _lit(samples: Samples) -> list[float]:
    """At most six of the angles from which the samples were lit, in whole degrees, lowest and highest included."""
    degrees = torch.unique((to_spherical(samples.wi)[0] * (180 / math.pi)).round())
    return degrees[torch.linspace(0, len(degrees) - 1, min(6, len(degrees))).round().long()].tolist()


def _spread(one: Tensor, two: Tensor) -> dict[str, float]:
    mean = (one + two) / 2
    error = torch.where(mean > 0, (one - two).abs() / mean.clamp_min(torch.finfo(mean.dtype).tiny), 0.0)
    return {"median": round(float(error.median()), 6), "p95": round(float(error.quantile(0.95)), 6)}
