"""Check a whole BRDF for two faults: it is not reciprocal, or it reflects more light than it receives.

Reciprocity is checked with the error of `brdf.symmetry`, computed from the reflectance or only from the samples.

Energy is checked with the albedo ∫ f cosθo dωo at a few angles of incidence. The integral runs over half vectors h: ωo
is ωi mirrored at h and dωo = 4 (ωi·h) dωh. The steps of θh are finer towards the normal, so that narrow highlights are
not missed. For a material that was lit from rings of θi with views all round, each direction ωo counts with the value
of the nearest sample with the same light (`lit_rings`), if no single one decides: an interpolation between rings has
highlights where nobody measured one.

An isotropic material that is lit, or seen, along the normal looks the same from all azimuths: what samples there differ
by is noise, a spot that was not the same, or anisotropy.
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

    The albedo is that of the largest channel, of an anisotropic material the mean over azimuths of the light; from none
    of them may it exceed 1. An interpolation of samples is asked at fewer places, and for light only where there was
    light.
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
    """Return (θi in degrees, light of a reflectance over that of the samples there), by rising θi; all azimuths.

    Of samples that lie on rings (`lit_rings`); empty for others.
    """
    own: dict[float, list[float]] = {}
    for ring in lit_rings(samples):
        light = float(ring.weights @ samples.values[ring.index].mean(1))
        found = float(albedo(reflectance, ring.degrees, ring.azimuth, 24, 32).mean())
        both = own.setdefault(round(ring.degrees, 1), [0.0, 0.0])
        both[0], both[1] = both[0] + found, both[1] + light
    return [(degrees, found / light) for degrees, (found, light) in sorted(own.items()) if light > 0]


def spread_along_the_normal(samples: Samples) -> float | None:
    """Return by how much isotropic samples along the normal differ with the azimuth; None for too few of them.

    Those with one direction within `_ALONG` of the normal are grouped by the other's angle. It is the median of the
    groups' standard deviations over their means, of the mean of the channels.
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
