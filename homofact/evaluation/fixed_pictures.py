"""Pictures of spheres under the two lights that the verdict uses: the fixed sky and that of `evaluation.opinion`.

`PLACES` normals are spread evenly over the disc of the sphere in the picture. At each normal, the light is integrated
with the nodes of `geometry.quadrature` around the mirror direction of the view, so the pictures have no noise. The
reflectance is evaluated once for both lights.
"""

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from homofact.brdf.channels import display_of
from homofact.brdf.reflectance import Reflectance
from homofact.evaluation.image_metrics import ciede2000
from homofact.evaluation.opinion import StudyLight, opinion_table
from homofact.geometry.directions import from_cosine
from homofact.geometry.quadrature import hemisphere_nodes
from homofact.rendering.fixed_lights import sky
from homofact.rendering.sphere import SphereImage
from homofact.rendering.surface import ToRgb, sphere_frames
from homofact.rendering.tonemap import displayed

PLACES = 128
RINGS, SPOKES = 32, 12
_VIEW = (0.0, 0.0, 1.0)


class Nodes(NamedTuple):
    """The quadrature nodes: `wi` and `wo` (K, M, 3) in the surface frames, and ωi in world space, `world` (K, M, 3).

    `weights` (K, M) are solid angle times cosθi, for K normals with M nodes each.
    """

    wi: Tensor
    wo: Tensor
    world: Tensor
    weights: Tensor


class FixedPictures(NamedTuple):
    """The radiance of one sphere at `PLACES` places, as pictures of one row, under each light."""

    sky: SphereImage
    study: SphereImage


def fixed_pictures(reflectance: Reflectance, to_rgb: ToRgb | None) -> FixedPictures:
    """Return the pictures of a reflectance; `to_rgb` as in `rendering.sphere`, or None for one or three channels."""
    nodes = sphere_nodes()
    by_sky, by_study = _lights()
    values = reflectance.evaluate(nodes.wi.reshape(-1, 3), nodes.wo.reshape(-1, 3)).to(torch.float64)
    in_sky = _coloured((values.reshape(*nodes.weights.shape, -1) * by_sky[..., None]).sum(1), to_rgb)
    in_study = (_coloured(values, to_rgb).reshape(*nodes.weights.shape, -1) * by_study).sum(1)
    return FixedPictures(_row(in_sky), _row(in_study))


def study_difference(source: SphereImage, fit: SphereImage) -> float:
    """Return the mean CIEDE2000 of two spheres under the study's light, at the exposure that all materials share."""
    theirs, mine = (displayed(image, _exposure(), curve="srgb") for image in (source, fit))
    return ciede2000(theirs, mine, source.coverage > 0)


def study_picture(reflectance: Reflectance) -> SphereImage:
    """Return the picture of a reflectance under the study's light alone."""
    return fixed_pictures(reflectance, display_of(reflectance.channels)).study


@lru_cache(maxsize=1)
def sphere_nodes() -> Nodes:
    """Return the nodes of every picture; the normals lie on Vogel's spiral: equal areas of the disc, no rows."""
    number = torch.arange(PLACES, dtype=torch.float64)
    height = (1 - (number + 0.5) / PLACES).sqrt()
    normal = from_cosine(height, number * (math.pi * (3 - math.sqrt(5))))
    frames, wo = sphere_frames(normal, torch.tensor(_VIEW, dtype=torch.float64))
    wi, solid = hemisphere_nodes(wo, RINGS, SPOKES)
    return Nodes(wi, wo[:, None].expand_as(wi), wi @ frames, solid * wi[..., 2])


def exposure_for(weighted: Tensor, white: float) -> float:
    """Return the exposure that maps the median of a white diffuse sphere to `white`, from light × weights (K, M, 3)."""
    return white / float(np.median((weighted.sum(1) / math.pi).amax(1).numpy()))


@lru_cache(maxsize=1)
def _lights() -> tuple[Tensor, Tensor]:
    """The sky's radiance (K, M) and the study's (K, M, 3) at the nodes, times the weights."""
    nodes = sphere_nodes()
    return sky(nodes.world) * nodes.weights, _study().radiance(nodes.world) * nodes.weights[..., None]


def _study() -> StudyLight:
    return opinion_table().light


@lru_cache(maxsize=1)
def _exposure() -> float:
    return exposure_for(_lights()[1], _study().white)


def _coloured(values: Tensor, to_rgb: ToRgb | None) -> Tensor:
    if isinstance(to_rgb, Tensor):
        return values @ to_rgb.to(values).T
    return values if to_rgb is None else to_rgb(values)


def _row(radiance: Tensor) -> SphereImage:
    return SphereImage(radiance[None], torch.ones(1, len(radiance), dtype=torch.float64))
