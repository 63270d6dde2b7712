"""Evaluate the compared methods. This module defines the pairs of directions, the pictures and the scores, and
caches finished results.

    MALE      mean |log(1 + f cosθi) − log(1 + f̂ cosθi)| over 20,000 pairs under 80°, uniform on both hemispheres
    Cole      mean squared difference of log((f + εA)/A) over the same, ε = 1e-2, A of the reading
    energy    |Σ f̂ cosθi cosθo / Σ f cosθi cosθo − 1|, the worst channel
    pictures  spheres of 96² under three skies (studio, St Peter's, Grace), filtered without noise, each at one exposure
              chosen from the reading, sRGB: mean absolute and root mean square error, SSIM and PSNR of the sphere's
              pixels, mean of the skies (of PSNR too)

The pairs and skies are the same for all; nothing is chosen for a material. Every material and method is one file in the
cache folder, written whole or not at all, so that a run goes on where it was stopped.
"""

import math
import statistics
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from homofact.brdf.reflectance import Reflectance
from homofact.brdf.source import MEASURED_EPSILON
from homofact.evaluation.image_metrics import psnr, ssim
from homofact.files.archive import read_arrays, write_arrays
from homofact.geometry.directions import draw_uniform
from homofact.rendering.environment import read_environment
from homofact.rendering.filtered import FilteredMaterial, Surroundings
from homofact.rendering.lobe_patches import DRAFT
from homofact.rendering.sphere import SphereImage
from homofact.rendering.tonemap import choose_exposure, displayed

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.data.published_fits import plain

SKIES = ("studio_small_03_1k", "stpeters_probe_latlong", "grace_probe_latlong")
PAIRS, PIXELS = 20_000, 96
STEEPEST_DEGREES = 80.0  # of the pairs
SCORES = ("MALE", "Cole", "energy", "MAE", "RMSE", "SSIM", "PSNR")
MORE_IS_BETTER = ("SSIM", "PSNR")
_PARTS = ("values", "pictures", "facts")


@dataclass(frozen=True)
class Shown:
    """What a material becomes by a method: values at `pairs` (N, 3), pictures (S, P, P, 3), and what it costs."""

    values: Tensor
    pictures: Tensor
    nbytes: float
    fetches: float
    seconds: float


@cache
def pairs() -> tuple[Tensor, Tensor]:
    """The pairs of directions, both under 80°."""
    wi, wo = draw_uniform(2 * PAIRS, torch.Generator().manual_seed(20261122))
    least = math.cos(math.radians(STEEPEST_DEGREES))
    under = (wi[:, 2] > least) & (wo[:, 2] > least)
    return wi[under][:PAIRS], wo[under][:PAIRS]


@cache
def surroundings(folder: Path) -> tuple[Surroundings, ...]:
    """The three skies for pictures of this size."""
    lights = (read_environment(folder / "envmaps" / f"{name}.hdr") for name in SKIES)
    return tuple(Surroundings.of(light, PIXELS, fineness=DRAFT) for light in lights)


def shown(reflectance: Reflectance, folder: Path, seconds: float) -> Shown:
    """Ask a reflectance for everything that is scored."""
    wi, wo = pairs()
    material = FilteredMaterial.of(reflectance, fineness=DRAFT)
    pictures = torch.stack([material.under(each).radiance for each in surroundings(folder)])
    values = reflectance.evaluate(wi, wo).to(torch.float64)
    return Shown(values, pictures, reflectance.nbytes, reflectance.fetches, seconds)


def kept(cache_folder: Path, material: str, label: str, make: Callable[[], Shown]) -> Shown:
    """What is in the cache, or made now."""
    place = place_of(cache_folder, material, label)
    if place.is_file():
        found = read_arrays(place, place.read_bytes(), _PARTS, "what this script wrote")
        values, pictures, facts = (torch.from_numpy(found[name]) for name in _PARTS)
        return Shown(values.double(), pictures.double(), *facts.tolist())
    made = make()
    place.parent.mkdir(parents=True, exist_ok=True)
    facts = np.array([made.nbytes, made.fetches, made.seconds])
    write_arrays(
        place, {"values": made.values.float().numpy(), "pictures": made.pictures.float().numpy(), "facts": facts}
    )
    return kept(cache_folder, material, label, make)


def place_of(cache_folder: Path, material: str, label: str) -> Path:
    """Where the cache keeps one method on one material."""
    return cache_folder / plain(material) / f"{plain(label)}.npz"


def male(expected: Tensor, found: Tensor, wi: Tensor) -> float:
    """MALE of values (N, C) in sr⁻¹, as the module's head says, at light directions (N, 3)."""
    cosine = wi[:, 2:]
    return float((torch.log1p(found * cosine) - torch.log1p(expected * cosine)).abs().mean())


def scores(truth: Shown, found: Shown, coverage: Tensor) -> dict[str, float]:
    """`SCORES` of one method on one material."""
    wi, wo = pairs()
    cosine = wi[:, 2:]
    a, b = truth.values, found.values
    mean = a.mean(0).clamp_min(1e-12)
    logs = [torch.log((x + MEASURED_EPSILON * mean) / mean) for x in (a, b)]
    light = [(x * cosine * wo[:, 2:]).sum(0) for x in (a, b)]
    pictures: list[tuple[float, ...]] = []
    for theirs, mine in zip(truth.pictures, found.pictures, strict=True):
        exposure = choose_exposure(SphereImage(theirs, coverage))
        p, q = (displayed(SphereImage(x, coverage), exposure) for x in (theirs, mine))
        inside = coverage > 0
        off = (p - q)[inside]
        rmse = float(off.square().mean().sqrt())
        pictures.append((float(off.abs().mean()), rmse, ssim(p, q, inside), min(psnr(p, q, inside), 100.0)))
    means = [statistics.fmean(column) for column in zip(*pictures, strict=True)]
    return {
        "MALE": male(a, b, wi),
        "Cole": float((logs[1] - logs[0]).square().mean()),
        "energy": float((light[1] / light[0].clamp_min(1e-12) - 1).abs().max()),
    } | dict(zip(SCORES[3:], means, strict=True))
