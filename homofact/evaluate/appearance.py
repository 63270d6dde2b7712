"""What an eye would say of a fit: where its light goes, and how far two pictures of it lie from the source's.

The energy is `evaluate.energy`'s. The pictures are of a sphere, each at one exposure chosen from the source:

* under a small lamp: `PIXELS`² under the default directional light;
* under a sky made for the purpose, which no file holds: white from above, dark from below, a lamp 12° wide and a dimmer
  one behind. Each of `PLACES` normals, spread evenly over the disc that the sphere is seen as, is integrated by the
  nodes of `geometry.quadrature` round the view's mirror direction, so that no noise hides a difference.

PSNR is of the pictures' sRGB values. A source that merely interpolates samples has no light of its own to be compared:
there is no answer then.
"""

import math
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from homofact.brdf.channels import display_of
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.source import Source, made_of_samples
from homofact.evaluate.energy import EnergyErrors, energy_errors
from homofact.evaluate.image_metrics import psnr
from homofact.geometry.directions import from_cosine
from homofact.geometry.quadrature import hemisphere_nodes
from homofact.render.light import DEFAULT_LIGHT
from homofact.render.sphere import SphereImage, render_sphere
from homofact.render.surface import sphere_frames
from homofact.render.tonemap import choose_exposure, displayed

PIXELS, PLACES = 128, 160
_RINGS, _SPOKES = 32, 16
_VIEW = (0.0, 0.0, 1.0)
# World directions of the sky's lamps, their radiance, and κ of exp(κ (cos − 1)).
_LAMPS = (((0.5, 0.6, 0.6245), 8.0, 120.0), ((-0.8, 0.3, -0.5196), 3.0, 20.0))


@dataclass(frozen=True)
class Appearance:
    """`energy`, and the PSNR in dB of the sphere under a lamp and under the sky; infinite where nothing differs."""

    energy: EnergyErrors
    psnr_light: float
    psnr_sky: float

    def record(self) -> dict[str, Any]:
        """A JSON-able dictionary; what is infinite is None."""
        both = {"psnr_light": self.psnr_light, "psnr_sky": self.psnr_sky}
        return self.energy.record() | {name: value if math.isfinite(value) else None for name, value in both.items()}


def appearance(fit: Reflectance, source: Source) -> Appearance | None:
    """The figures of a fit against its source; None where the source is known at its samples alone.

    Raises BadInput where their channels differ in number.
    """
    if made_of_samples(source.reflectance):
        return None
    energy = energy_errors(fit, source.reflectance, source.samples.isotropic)
    return Appearance(energy, *sphere_psnr(fit, source.reflectance))


def sphere_psnr(fit: Reflectance, source: Reflectance) -> tuple[float, float]:
    """PSNR in dB (under the lamp, under the sky) of the module's head."""
    to_rgb = display_of(source.channels)
    lamp = [render_sphere(each, DEFAULT_LIGHT, PIXELS, to_rgb=to_rgb) for each in (source, fit)]
    return _psnr(*lamp), _psnr(*(_under_the_sky(each, to_rgb) for each in (source, fit)))


def sky(directions: Tensor) -> Tensor:
    """Radiance (...) of the fixed sky from unit world directions (..., 3), y up."""
    height = directions[..., 1]
    level = 0.08 + 0.92 * torch.sigmoid(8 * height)
    for place, radiance, width in _LAMPS:
        level = level + radiance * torch.exp(width * (directions @ directions.new_tensor(place) - 1))
    return level


def _under_the_sky(reflectance: Reflectance, to_rgb: Any) -> SphereImage:
    """The sphere's radiance at `PLACES` places, as a picture of one row."""
    number = torch.arange(PLACES, dtype=torch.float64)
    # Vogel's spiral: equal areas of the disc, no rows.
    height = (1 - (number + 0.5) / PLACES).sqrt()
    normal = from_cosine(height, number * (math.pi * (3 - math.sqrt(5))))
    frames, wo = sphere_frames(normal, torch.tensor(_VIEW, dtype=torch.float64))
    wi, solid = hemisphere_nodes(wo, _RINGS, _SPOKES)
    light = sky(wi @ frames) * solid * wi[..., 2]
    views = wo[:, None].expand_as(wi).reshape(-1, 3)
    values = reflectance.evaluate(wi.reshape(-1, 3), views).to(torch.float64)
    radiance = (values.reshape(*wi.shape[:2], -1) * light[..., None]).sum(1)
    if isinstance(to_rgb, Tensor):
        radiance = radiance @ to_rgb.to(radiance).T
    elif to_rgb is not None:
        radiance = to_rgb(radiance)
    return SphereImage(radiance[None], torch.ones(1, PLACES, dtype=torch.float64))


def _psnr(source: SphereImage, fit: SphereImage) -> float:
    exposure = choose_exposure(source)
    return psnr(displayed(source, exposure), displayed(fit, exposure), source.coverage > 0)
