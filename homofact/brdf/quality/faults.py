"""Check a whole BRDF for two faults: it is not reciprocal, or it reflects more light than it receives.

Reciprocity is checked with the error of `brdf.symmetry`, computed from the reflectance or only from the samples.

Energy is checked with the albedo ∫ f cosθo dωo at a few angles of incidence. The integral runs over half vectors h: ωo
is ωi mirrored at h and dωo = 4 (ωi·h) dωh. The steps of θh are finer towards the normal, so that narrow highlights are
not missed.
"""

import math
from typing import Any

import torch
from torch import Tensor

from homofact.brdf.reflectance import Reflectance
from homofact.brdf.samples import Samples
from homofact.brdf.symmetry import light_azimuths, reciprocity_of, reciprocity_of_samples
from homofact.geometry.directions import from_spherical, to_spherical

ALBEDO_DEGREES = (0.0, 15.0, 30.0, 45.0, 60.0, 75.0)


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
    azimuths = light_azimuths(samples.isotropic)
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
