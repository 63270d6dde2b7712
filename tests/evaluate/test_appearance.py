"""Spheres of fits and sources under a lamp and a sky, and which sources can be asked."""

import json
import math
from pathlib import Path

import pytest
import torch

from homofact.brdf.analytic import Lambert, Ward
from homofact.brdf.materials import material
from homofact.brdf.source import open_source
from homofact.evaluate.appearance import appearance, sky, sphere_psnr
from homofact.evaluate.image_metrics import psnr
from homofact.render.light import EnvironmentMap
from homofact.render.sphere import render_sphere
from homofact.render.tonemap import choose_exposure, displayed

SYNTHETIC = Path(__file__).parents[2] / "data_synthetic" / "synthetic_cornell.brdf"


def sky_map(rows: int = 128) -> EnvironmentMap:
    """The sky at the centres of a lat-long map's texels, laid out as `render.light` says."""
    theta = (torch.arange(rows, dtype=torch.float64) + 0.5) * (math.pi / rows)
    phi = ((torch.arange(2 * rows, dtype=torch.float64) + 0.5) / (2 * rows) - 0.5) * (2 * math.pi)
    theta, phi = torch.meshgrid(theta, phi, indexing="ij")
    sine = torch.sin(theta)
    directions = torch.stack((sine * torch.sin(phi), torch.cos(theta), -sine * torch.cos(phi)), -1)
    return EnvironmentMap(sky(directions)[..., None])


def test_a_fit_that_is_its_source_differs_nowhere() -> None:
    source = open_source("material:cook-torrance-plastic", count=200)
    found = appearance(source.reflectance, source)
    assert found is not None
    assert found.psnr_light == found.psnr_sky == math.inf
    assert found.energy.albedo_worst == 1
    record = json.loads(json.dumps(found.record(), allow_nan=False))
    assert record["psnr_sky"] is None
    assert record["highlight"] == 1


def test_more_fault_is_less_psnr() -> None:
    source = Ward((0.2, 0.1, 0.05), (0.1,) * 3, 0.1, 0.1)
    fits = [Ward((0.2, 0.1, 0.05), (0.1 * loss,) * 3, 0.1, 0.1) for loss in (0.99, 0.9, 0.6, 0.0)]
    found = [sphere_psnr(fit, source) for fit in fits]
    for each in zip(*found, strict=True):
        assert list(each) == sorted(each, reverse=True)
        assert each[0] > 35
        assert each[-1] < 25


@pytest.mark.parametrize("name", ["cook-torrance-plastic", "ward-brushed"])
def test_psnr_under_the_sky_is_that_of_a_rendered_picture(name: str) -> None:
    source, fit = material(name).model, Lambert((0.3, 0.2, 0.15))
    theirs, mine = (render_sphere(each, sky_map(), 48, samples=512) for each in (source, fit))
    exposure = choose_exposure(theirs)
    expected = psnr(displayed(theirs, exposure), displayed(mine, exposure), theirs.coverage == 1)
    assert sphere_psnr(fit, source)[1] == pytest.approx(expected, abs=0.6)


def test_samples_alone_have_no_appearance() -> None:
    source = open_source(str(SYNTHETIC))
    assert appearance(Lambert((0.3, 0.2, 0.1)), source) is None
    single = open_source(str(SYNTHETIC), channels="luminance")
    assert appearance(Lambert((0.3,), channels=("Y",)), single) is None
