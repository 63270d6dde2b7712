"""Check a whole BRDF for two faults: it is not reciprocal, or it reflects more light than it receives.

Reciprocity is checked with the error of `brdf.symmetry`, computed from the reflectance or only from the samples.

Energy is checked with the albedo ∫ f cosθo dωo at a few angles of incidence. The integral runs over half vectors h: ωo
is ωi mirrored at h and dωo = 4 (ωi·h) dωh. The steps of θh are finer towards the normal, so that narrow highlights are
not missed. For samples on rings of θi with viewers all round, the value at each direction ωo is that of the nearest
sample with the same light (`lit_rings`), unless one sample dominates the sum. Interpolation is avoided there because it
would invent highlights between rings.

If an isotropic material is lit or seen along the normal, its value is the same at all azimuths. Differences between
such samples come from noise, from different spots on the specimen, or from anisotropy.
"""

import math
from collections.abc import Sequence
from typing import Any

import torch
from torch import Tensor

from homofact.brdf.quality.lit_rings import LitRing, lit_rings
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.samples import Samples
from homofact.brdf.symmetry import (
    light_azimuths,
    reciprocity_of,
    reciprocity_of_samples,
)
from homofact.geometry.directions import from_spherical, to_spherical

ALBEDO_DEGREES = (0.0, 15.0, 30.0, 45.0, 60.0, 75.0)
_MOST_OF_ONE = 0.2  # of the light of a ring, that one sample may hold
_ALONG, _LEAST_IN_A_GROUP = math.radians(0.5), 4  # nearer to the normal a direction has no azimuth; samples of a group


def albedo(reflectance: Reflectance, degrees: float, azimuth: float = 0.0, rings: int = 48, spokes: int = 64) -> Tensor:
    """Return ∫ f cosθo dωo (C,) for light at `degrees` from the normal, from rings × spokes half vectors."""
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
    """Return reciprocity error and albedo, JSON-able; set `own` if the reflectance does not interpolate the samples.

    The albedo is that of the largest channel; for an anisotropic material it is the mean over azimuths of the light.
    "energy_above_one" is true if the albedo exceeds 1 for any channel and azimuth. An interpolation of samples is
    evaluated at fewer half vectors, and only at measured angles of incidence.
    """
    reciprocity = reciprocity_of(reflectance) if own else reciprocity_of_samples(samples)
    angles, fineness = (ALBEDO_DEGREES, {}) if own else (_lit(samples), {"rings": 16, "spokes": 24})
    azimuths = light_azimuths(samples.isotropic)
    rings = () if own else lit_rings(samples)
    found = {}
    for angle in angles:
        there = _ring_albedos(samples, [ring for ring in rings if abs(ring.degrees - angle) <= 0.5])
        if there is None:
            there = torch.stack([albedo(reflectance, angle, a, **fineness) for a in azimuths])
        found[f"{angle:g}"] = there
    return {
        "reciprocity_error": reciprocity,
        "spread_along_the_normal": None if own else spread_along_the_normal(samples),
        "albedo_by_degrees": {angle: round(float(each.mean(0).max()), 4) for angle, each in found.items()},
        "energy_above_one": any(bool((each > 1).any()) for each in found.values()),
    }


def light_over_rings(samples: Samples, reflectance: Reflectance) -> list[tuple[float, float]]:
    """Return (θi in degrees, reflected light of a reflectance over the samples'), by increasing θi.

    All azimuths of the light are added. The list is empty if the samples do not lie on rings (`lit_rings`).
    """
    own: dict[float, list[float]] = {}
    for ring in lit_rings(samples):
        light = float(ring.weights @ samples.values[ring.index].mean(1))
        found = float(albedo(reflectance, ring.degrees, ring.azimuth, 24, 32).mean())
        both = own.setdefault(round(ring.degrees, 1), [0.0, 0.0])
        both[0], both[1] = both[0] + found, both[1] + light
    return [(degrees, found / light) for degrees, (found, light) in sorted(own.items()) if light > 0]


def spread_along_the_normal(samples: Samples) -> float | None:
    """Return the relative spread over azimuths of isotropic samples along the normal; None for too few samples.

    Samples with one direction within `_ALONG` of the normal are grouped by the angle of the other direction. The spread
    of a group is the standard deviation of its channel means divided by their mean. The result is the median over the
    groups.
    """
    if not samples.isotropic:
        return None
    bright, spreads = samples.values.mean(1), list[float]()
    for one, other in ((samples.wi, samples.wo), (samples.wo, samples.wi)):
        along = to_spherical(one)[0] < _ALONG
        rank = (to_spherical(other[along])[0] / _ALONG).round().long()
        for ring in rank.unique():
            values = bright[along][rank == ring]
            if len(values) >= _LEAST_IN_A_GROUP and float(values.mean()) > 0:
                spreads.append(float(values.std() / values.mean()))
    return float(torch.tensor(spreads).median()) if spreads else None


def _ring_albedos(samples: Samples, rings: Sequence[LitRing]) -> Tensor | None:
    """∫ f cosθo dωo (R, C) of rings of samples with one angle of incidence, from R azimuths; None without any.

    None also where one sample holds more than `_MOST_OF_ONE` of a ring: its cell would decide.
    """
    sums = []
    for ring in rings:
        light = samples.values[ring.index] * ring.weights[:, None]
        if bool((light > _MOST_OF_ONE * light.sum(0)).any()):
            return None
        sums.append(light.sum(0))
    return torch.stack(sums) if sums else None


def _lit(samples: Samples) -> list[float]:
    """At most six of the angles from which the samples were lit, in whole degrees, lowest and highest included."""
    degrees = torch.unique((to_spherical(samples.wi)[0] * (180 / math.pi)).round())
    return degrees[torch.linspace(0, len(degrees) - 1, min(6, len(degrees))).round().long()].tolist()
