"""Faults of a BRDF as a whole: laws of reciprocity and energy, on models and on samples."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from goniometer import STEEL, steel_rings

from homofact.brdf.analytic import Lambert, Phong
from homofact.brdf.function import FunctionReflectance
from homofact.brdf.quality.faults import albedo, evaluated_faults, light_over_rings, spread_along_the_normal
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model
from homofact.brdf.source import describe, open_source
from homofact.geometry.directions import from_spherical

GREY = Lambert((0.7,), channels=("Y",))


@pytest.mark.parametrize("degrees", [0, 40, 80])
def test_albedo_of_lambert_is_its_colour(degrees: float) -> None:
    found = albedo(Lambert((0.25, 0.5, 1.0)), degrees)
    assert found.tolist() == pytest.approx([0.25, 0.5, 1.0], rel=0.03)


def test_albedo_finds_narrow_highlights() -> None:
    # A lobe of 5°: at normal incidence its albedo is its weight.
    shiny = Phong((0.0,), (0.8,), 1000, channels=("Y",))
    assert float(albedo(shiny, 0)) == pytest.approx(0.8, rel=0.02)
    assert float(albedo(shiny, 45)) == pytest.approx(0.8 * math.cos(math.radians(45)), rel=0.1)


def test_energy_above_one_is_named() -> None:
    for colour, above in ((0.9, False), (1.2, True)):
        model = Lambert((colour,), channels=("Y",))
        facts = evaluated_faults(sample_model(model, 10), model, own=True)
        assert facts["energy_above_one"] is above
        assert facts["albedo_by_degrees"]["30"] == pytest.approx(colour, rel=0.03)
        assert json.loads(json.dumps(facts)) == facts


def test_description_carries_them(tmp_path: Path) -> None:
    facts = describe(open_source("material:ward-brushed", count=100))["faults"]
    assert facts["reciprocity_error"]["p95"] < 1e-6
    assert facts["energy_above_one"] is False
    path = tmp_path / "one.csv"
    path.write_text("theta_i,phi_i,theta_o,phi_o,Y\n" + "".join(f"0.{k},0,0.{k + 1},2,0.3\n" for k in range(1, 9)))
    facts = describe(open_source(str(path)))["faults"]
    assert facts["reciprocity_error"] is None
    # Light at .1 to .8 radians only: nothing is said of other angles.
    assert list(facts["albedo_by_degrees"]) == ["6", "11", "23", "29", "40", "46"]
    assert facts["exact_zeros"] == 0


def ringed(values: object, steps: tuple[int, int, int] = (15, 5, 10)) -> Samples:
    """An isotropic goniometer's samples on rings of θi; `values` of (θi, θo, Δφ) in radians."""
    i, o, phi = (
        each.reshape(-1)
        for each in torch.meshgrid(
            *(
                torch.arange(0, most, step, dtype=torch.float64).deg2rad()
                for most, step in zip((76, 90, 181), steps, strict=True)
            ),
            indexing="ij",
        )
    )
    found = values(i, o, phi)[:, None]  # type: ignore[operator]
    return Samples(from_spherical(i, 0 * i), from_spherical(o, phi), found, channels=("Y",), isotropic=True)


def test_albedo_of_rings_is_that_of_the_samples() -> None:
    facts = evaluated_faults(ringed(lambda i, o, phi: 0 * i + 0.7 / math.pi), GREY, own=False)
    assert facts["albedo_by_degrees"] == {f"{k}": pytest.approx(0.7, abs=2e-3) for k in (0, 15, 30, 45, 60, 75)}
    # f = cosθo/π reflects 2/3 whatever the azimuth, and twice as much on one side as on the other on average.
    sided = ringed(lambda i, o, phi: torch.cos(o) / math.pi * torch.where(phi > math.pi / 2, 4 / 3, 2 / 3))
    facts = evaluated_faults(sided, GREY, own=False)
    assert facts["albedo_by_degrees"]["45"] == pytest.approx(2 / 3, abs=0.03)


def test_what_lies_around_the_normal_must_not_depend_on_the_azimuth() -> None:
    even = ringed(lambda i, o, phi: 0.2 + 0.1 * torch.cos(o))
    assert spread_along_the_normal(even) == pytest.approx(0, abs=1e-12)
    # f times 1 + 0.4 cos Δφ: over Δφ from 0 to 180° its standard deviation is 0.4 / √2 of the mean.
    turned = ringed(lambda i, o, phi: 0.2 * (1 + 0.4 * torch.cos(phi)))
    assert spread_along_the_normal(turned) == pytest.approx(0.4 / math.sqrt(2), rel=0.1)
    assert spread_along_the_normal(replace(turned, isotropic=False)) is None
    few = turned.select((turned.wi[:, 2] < 0.99) & (turned.wo[:, 2] < 0.99))
    assert spread_along_the_normal(few) is None


def test_the_light_of_the_material_itself_is_that_of_its_rings() -> None:
    rows = light_over_rings(steel_rings(), STEEL)
    assert [angle for angle, _ in rows] == [5, 20, 35, 50, 65]
    assert [ratio for _, ratio in rows] == pytest.approx([1] * 5, abs=0.05)
    # From one azimuth alone an isotropic half counts for both sides.
    even = ringed(lambda i, o, phi: 0 * i + 0.3)
    twice = light_over_rings(even, Lambert((0.6 * math.pi,), channels=("Y",)))
    assert [ratio for _, ratio in twice] == pytest.approx([2] * 6, rel=0.03)
    scattered = steel_rings()
    turned = torch.rand(len(scattered), generator=torch.Generator().manual_seed(1)).double()
    wi = from_spherical(turned, 6 * turned)
    assert light_over_rings(replace(scattered, wi=wi), STEEL) == []
    # 98 samples a ring are too few.
    assert light_over_rings(steel_rings(steps=(12, 27)), STEEL) == []


def test_the_light_of_a_ring_is_that_from_its_own_side() -> None:
    turned = FunctionReflectance(lambda wi, wo: (0.3 + 0.25 * (wi[:, :1] ** 2 - wi[:, 1:2] ** 2)) * np.ones((1, 3)))
    samples = steel_rings((50.0,), (0.0, 90.0, 30.0))
    samples = replace(samples, values=turned.evaluate(samples.wi, samples.wo))
    ((angle, ratio),) = light_over_rings(samples, turned)
    assert (angle, ratio) == (50, pytest.approx(1, abs=0.01))
