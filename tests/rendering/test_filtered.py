"""Filtered spheres against sampled ones, furnaces and lamps; and which materials are filtered."""

import math
from dataclasses import dataclass

import pytest
import torch
from torch import Tensor

from homofact.brdf.analytic import Lambert, Ward
from homofact.brdf.analytic.common import AnalyticModel
from homofact.brdf.analytic.ggx import GgxBrdf, GgxLobe
from homofact.brdf.samples import Samples
from homofact.brdf.scattered import Scattered
from homofact.errors import BadInput
from homofact.evaluation.energy import energy_errors
from homofact.figures.compare_picture import lamp_map
from homofact.geometry.directions import from_spherical
from homofact.rendering.filtered import FilteredMaterial, Surroundings, draw_sphere, render_filtered
from homofact.rendering.light import DirectionalLight, EnvironmentMap
from homofact.rendering.lobe_patches import COARSE, DRAFT
from homofact.rendering.sphere import render_sphere
from homofact.rendering.surface import seen_surface


def blocks(rows: int = 16, repeat: int = 4, channels: int = 3, seed: int = 5) -> EnvironmentMap:
    """Random light with a wide range, in blocks."""
    generator = torch.Generator().manual_seed(seed)
    level = torch.rand(rows, 2 * rows, channels, dtype=torch.float64, generator=generator) ** 6
    return EnvironmentMap(level.repeat_interleave(repeat, 0).repeat_interleave(repeat, 1))


@dataclass(frozen=True)
class OneSided(AnalyticModel):
    """Isotropic, not mirrored: brighter where ωo lies to the left of ωi, for a tenth of the diffuse light."""

    def formula(self, wi: Tensor, wo: Tensor) -> Tensor:
        cross = wi[:, 0] * wo[:, 1] - wi[:, 1] * wo[:, 0]
        return (0.3 + 0.29 * cross)[:, None].expand(-1, 3)


def off(found: Tensor, expected: Tensor) -> float:
    """Relative RMS difference."""
    return float((found - expected).norm() / expected.norm())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("model", "samples", "bound"),
    [
        (Lambert((0.8, 0.5, 0.2)), 8192, 0.02),
        (Ward((0.1, 0.1, 0.1), (0.5, 0.4, 0.3), 0.3, 0.3), 8192, 0.02),
        (Ward((0.1, 0.1, 0.1), (0.5, 0.4, 0.3), 0.1, 0.1), 8192, 0.03),
        (Ward((0.0,) * 3, (0.5, 0.4, 0.3), 0.02, 0.02), 8192, 0.06),
        (OneSided(), 8192, 0.02),
    ],
    ids=["lambert", "wide", "satin", "gloss", "one-sided"],
)
def test_filtered_agrees_with_sampled(model: AnalyticModel, samples: int, bound: float) -> None:
    light, view = blocks().turned(0.4), (0.5, 0.3, 1.0)
    expected = render_sphere(model, light, 20, view=view, samples=samples)
    found = render_filtered(model, light, 20, view=view)
    assert torch.equal(found.coverage, expected.coverage)
    inside = found.coverage == 1
    assert off(found.radiance[inside], expected.radiance[inside]) < bound
    mean = found.radiance[inside].mean(0) / expected.radiance[inside].mean(0)
    assert mean.tolist() == pytest.approx([1, 1, 1], abs=0.01)


@pytest.mark.parametrize("slope", [0.005, 0.05, 0.4])
def test_a_furnace_returns_the_albedo(slope: float) -> None:
    model = Ward((0.1,), (0.5,), slope, slope, channels=("Y",))
    image = render_filtered(model, EnvironmentMap.constant(3.0), 64)
    energy = energy_errors(model, model, isotropic=True)
    _, surface = seen_surface(64, (0.0, 0.0, 1.0))
    degrees = surface.wo[:, 2].clamp(-1, 1).acos().rad2deg()
    radiance = image.radiance.reshape(-1)[surface.pixels]
    for angle, (albedo,) in zip(energy.degrees, energy.source_albedo, strict=True):
        near = (degrees - angle).abs().argmin()
        assert float(radiance[near]) == pytest.approx(3 * albedo, rel=0.02)


def test_a_single_bright_pixel_lights_the_whole_sphere_evenly() -> None:
    # The radiance of a matte sphere under one lamp is a cosine, without rings or spokes from patches and cells.
    level = torch.full((64, 128, 1), 1e-6, dtype=torch.float64)
    level[24, 70] = 1000.0
    light = EnvironmentMap(level)
    lamp = light.draw(torch.full((1, 2), 0.5, dtype=torch.float64))[0]
    image = render_filtered(Lambert((0.7,), channels=("Y",)), light, 64)
    _, surface = seen_surface(64, (0.0, 0.0, 1.0))
    cosine = (surface.frame[:, 2] @ lamp).clamp_min(0)
    strength = float((level[..., 0] * solid_angles(64)).sum()) * 0.7 / math.pi
    found = image.radiance.reshape(-1)[surface.pixels]
    # A pixel of 3 degrees blurs where the lamp sets.
    away = (surface.wo[:, 2] > 0.1) & ((surface.frame[:, 2] @ lamp).abs() > 0.1)
    assert float((found / strength - cosine)[away].abs().max()) < 0.02


def solid_angles(rows: int) -> Tensor:
    edges = torch.cos(torch.arange(rows + 1, dtype=torch.float64) * (math.pi / rows))
    return ((edges[:-1] - edges[1:]) * (math.pi / rows))[:, None]


def test_a_mirror_shows_the_surroundings() -> None:
    light = blocks(8, 16)
    mirror = Ward((0.0,), (1.0,), 0.001, 0.001, channels=("Y",))
    image = render_filtered(mirror, light, 64)
    _, surface = seen_surface(64, (0.0, 0.0, 1.0))
    forward, normal = surface.axes[2], surface.frame[:, 2]
    height = surface.wo[:, 2:]
    seen, _ = light.look_up(2 * height * normal - forward)
    found = image.radiance.reshape(-1, 3)[surface.pixels]
    # Ward's lobe is normalised for light from the normal; his cosines leave exactly 1 over cosθd² … 1.
    middle = height[:, 0] > 0.8
    assert off(found[middle] / height[middle] ** 2, seen[middle]) < 0.35
    assert float(torch.corrcoef(torch.stack((found[middle].reshape(-1), seen[middle].reshape(-1))))[0, 1]) > 0.95


@pytest.mark.slow
def test_channels_of_light_and_material() -> None:
    grey, red = Lambert((0.5,), channels=("Y",)), EnvironmentMap(torch.tensor([[[1.0, 0.0, 0.0]]]).double())
    image = render_filtered(grey, red, 16)
    assert image.radiance.shape == (16, 16, 3)
    assert image.radiance[8, 8].tolist() == pytest.approx([0.5, 0, 0], abs=0.01)
    assert render_filtered(grey, EnvironmentMap.constant(), 16).radiance.shape == (16, 16, 1)
    matrix = torch.tensor([[1.0], [2.0], [0.0]], dtype=torch.float64)
    coloured = render_filtered(grey, EnvironmentMap.constant(), 16, to_rgb=matrix)
    assert coloured.radiance[8, 8].tolist() == pytest.approx([0.5, 1, 0], abs=0.01)


@pytest.mark.slow
@pytest.mark.parametrize(("x", "y", "bound"), [(0.3, 0.3, 0.02), (0.15, 0.3, 0.03), (0.3, 0.1, 0.05)])
def test_brushed_materials_agree_with_sampled_ones(x: float, y: float, bound: float) -> None:
    brushed = Ward((0.1,) * 3, (0.3, 0.2, 0.1), x, y)
    light, view = blocks(8, 8).turned(0.4), (0.5, 0.3, 1.0)
    expected = render_sphere(brushed, light, 20, view=view, samples=8192)
    found = render_filtered(brushed, light, 20, view=view)
    inside = found.coverage == 1
    assert off(found.radiance[inside], expected.radiance[inside]) < bound
    # Brushed the other way it is another picture.
    other = render_filtered(Ward((0.1,) * 3, (0.3, 0.2, 0.1), y, x), light, 20, view=view)
    assert (off(other.radiance[inside], expected.radiance[inside]) > 2 * bound) is (x != y)


def test_a_highlight_under_a_lamp_is_as_bright_of_samples_as_of_what_they_sample() -> None:
    """At the middle of a narrow highlight the grids err by some percent: both are drawn on the same."""
    model = GgxBrdf((0.08, 0.03, 0.01), (GgxLobe((1.0, 1.0, 1.0), 0.07, 0.04),))
    angles = [(x, y, z) for x in range(0, 71, 10) for y in range(0, 81, 5) for z in range(0, 181, 15)]
    theta_i, theta_o, turn = torch.deg2rad(torch.tensor(angles, dtype=torch.float64)).T
    wi, wo = from_spherical(theta_i, 0 * theta_i), from_spherical(theta_o, turn)
    interpolated = Scattered(Samples(wi, wo, model.evaluate(wi, wo), isotropic=True))
    for fineness in (DRAFT, COARSE):
        lamp = Surroundings.of(lamp_map(), 64, fineness=fineness)
        found, expected = (
            FilteredMaterial.of(each, fineness=fineness).under(lamp).radiance for each in (interpolated, model)
        )
        assert float(found.max()) == pytest.approx(float(expected.max()), rel=0.01)


@pytest.mark.slow
def test_environments_are_filtered_and_lamps_are_not() -> None:
    light, model = blocks(), Ward((0.1,) * 3, (0.3,) * 3, 0.1, 0.1)
    assert torch.equal(draw_sphere(model, light, 16).radiance, render_filtered(model, light, 16).radiance)
    lamp = DirectionalLight((1.0, 0.0, 1.0))
    assert torch.equal(draw_sphere(model, lamp, 16).radiance, render_sphere(model, lamp, 16).radiance)


def test_what_cannot_be_drawn_is_refused() -> None:
    with pytest.raises(BadInput, match="view: found"):
        render_filtered(Lambert((0.5,) * 3), blocks(), 16, view=(0.0, 0.0, 0.0))
    with pytest.raises(BadInput, match="found 2 channels"):
        render_filtered(Lambert((0.5,) * 2, channels=("a", "b")), blocks(), 16)
    with pytest.raises(BadInput, match="size: found 7"):
        render_filtered(Lambert((0.5,) * 3), blocks(), 7)
