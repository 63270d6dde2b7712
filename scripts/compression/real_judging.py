"""Evaluate fits of real measurements. The measurements are tables, which can be evaluated anywhere, or lists of
samples.

A measurement that can be evaluated anywhere gives, with f the measurement and f̂ the fit,

    MALE       mean |log(1 + f cosθi) − log(1 + f̂ cosθi)| over 20,000 pairs under 80°, uniform on both hemispheres
    RMS        relative RMS of f cosθi cosθo over both hemispheres; the floor is that of the measurement's own
               reciprocal mean (`evaluation.energy`)
    albedo     ∫ f̂ cosθo dωo over the measurement's, of the channel and θi (0, 10 … 80°) where it is farthest from 1
    energy     the same of both integrals, of the channel that is farthest from 1
    highlight  flux of the fit over that of the measurement where the measurement's brightest 1% is
    pictures   spheres of 128² under three skies, filtered without noise, and under a small lamp; each at one exposure
               chosen from the measurement, sRGB: PSNR, SSIM and FLIP of the sphere's pixels

Scattered samples give MALE and RMS at samples that the fit has not seen, turned to random azimuths. The RMS is then
√(Σ ((f̂ − f) cosθi cosθo)²/Σ (f cosθi cosθo)²).
"""

import math
import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from homofact.brdf.reflectance import Reflectance
from homofact.brdf.samples import Samples
from homofact.evaluation.energy import SourceLight
from homofact.evaluation.image_metrics import flip, psnr, ssim
from homofact.geometry.directions import from_spherical
from homofact.geometry.quadrature import hemisphere_nodes
from homofact.rendering.environment import read_environment
from homofact.rendering.filtered import FilteredMaterial, Surroundings
from homofact.rendering.light import DEFAULT_LIGHT
from homofact.rendering.lobe_patches import DRAFT
from homofact.rendering.sphere import SphereImage, render_sphere
from homofact.rendering.tonemap import choose_exposure, displayed

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.compression.compression_protocol import SKIES, male, pairs

PIXELS = 128
LAMP = "lamp"
LIGHTS = {"studio": SKIES[0], "St Peter's": SKIES[1], "Grace": SKIES[2], LAMP: ""}
ALBEDO_DEGREES = tuple(range(0, 81, 10))
_NODES = (112, 56)  # (rings, spokes) round the mirror direction, as `evaluation.energy` takes them
MOST_DB = 100.0


@cache
def surroundings(folder: Path, pixels: int) -> dict[str, Surroundings]:
    """The skies for pictures of a size."""
    return {
        name: Surroundings.of(read_environment(folder / "envmaps" / f"{file}.hdr"), pixels, fineness=DRAFT)
        for name, file in LIGHTS.items()
        if file
    }


def pictures(reflectance: Reflectance, folder: Path, pixels: int) -> dict[str, SphereImage]:
    """The spheres under `LIGHTS`, by name."""
    material = FilteredMaterial.of(reflectance, fineness=DRAFT)
    drawn = {name: material.under(sky) for name, sky in surroundings(folder, pixels).items()}
    return drawn | {LAMP: render_sphere(reflectance, DEFAULT_LIGHT, pixels)}


def albedos(reflectance: Reflectance) -> Tensor:
    """∫ f cosθo dωo at `ALBEDO_DEGREES`, (K, C), the light at azimuth 0."""
    theta = torch.tensor(ALBEDO_DEGREES, dtype=torch.float64).deg2rad()
    lit = from_spherical(theta, torch.zeros_like(theta))
    views, solid = hemisphere_nodes(lit, *_NODES)
    wi = lit[:, None].expand_as(views)
    values = reflectance.evaluate(wi.reshape(-1, 3), views.reshape(-1, 3)).to(torch.float64)
    return (values.reshape(*views.shape[:2], -1) * (solid * views[..., 2])[..., None]).sum(1)


def farthest(ratios: Tensor) -> tuple[float, tuple[int, ...]]:
    """(the ratio that is farthest from 1, as a factor; where it is)."""
    flat = int(ratios.clamp_min(1e-12).log().abs().argmax())
    where = tuple(int(k) for k in torch.unravel_index(torch.tensor(flat), ratios.shape))
    return float(ratios[where]), where


@dataclass(frozen=True)
class Asked:
    """A measurement that can be evaluated anywhere, and all that a fit is held against."""

    folder: Path
    pixels: int
    values: Tensor
    light: SourceLight
    albedo: Tensor
    spheres: dict[str, SphereImage]

    @classmethod
    def of(cls, reflectance: Reflectance, folder: Path, pixels: int = PIXELS) -> "Asked":
        """Ask a measurement for everything; `folder` is that of the real data, with the skies."""
        values = reflectance.evaluate(*pairs()).to(torch.float64)
        light = SourceLight.of(reflectance, True)
        return cls(folder, pixels, values, light, albedos(reflectance), pictures(reflectance, folder, pixels))

    def numbers(self, fit: Reflectance) -> dict[str, Any]:
        """The figures that need no picture, of the module's head."""
        wi, wo = pairs()
        light = self.light.errors(fit)
        ratios = albedos(fit) / self.albedo.clamp_min(1e-12)
        worst, (angle, channel) = farthest(ratios)
        return {
            "MALE": male(self.values, fit.evaluate(wi, wo).to(torch.float64), wi),
            "RMS": light.rms_cosine,
            "floor": light.floor_cosine,
            "albedo": worst,
            "albedo at": f"{ALBEDO_DEGREES[angle]}°, {'RGB'[channel] if ratios.shape[1] == 3 else 'Y'}",
            "energy": farthest(torch.tensor(light.energy))[0],
            "highlight": light.highlight,
        }

    def judged(self, fit: Reflectance) -> dict[str, Any]:
        """All figures of the module's head; those of pictures by the light's name."""
        found = self.numbers(fit)
        for name, image in pictures(fit, self.folder, self.pixels).items():
            own = self.spheres[name]
            exposure, inside = choose_exposure(own), own.coverage > 0
            theirs, mine = (displayed(each, exposure) for each in (own, image))
            found[f"PSNR, {name}"] = min(psnr(theirs, mine, inside), MOST_DB)
            found[f"SSIM, {name}"] = ssim(theirs, mine, inside)
            found[f"FLIP, {name}"] = flip(theirs, mine, inside)
        return found


def judged_at(test: Samples, fit: Reflectance) -> dict[str, float]:
    """MALE and relative RMS at samples that the fit has not seen."""
    found = fit.evaluate(test.wi, test.wo).to(torch.float64)
    cosines = (test.wi[:, 2] * test.wo[:, 2])[:, None]
    missed, whole = (float(((part * cosines) ** 2).sum()) for part in (found - test.values, test.values))
    return {"MALE": male(test.values, found, test.wi), "RMS": math.sqrt(missed / whole)}
