"""The lamp and the sky that no file holds: what light they give, in closed form, and how small the lamp is."""

import math

import pytest
import torch

from homofact.brdf.analytic import Lambert
from homofact.errors import BadInput
from homofact.rendering.filtered import FilteredMaterial, Surroundings, render_filtered
from homofact.rendering.fixed_lights import lamp_map, sky, sky_map
from homofact.rendering.light import DEFAULT_LIGHT
from homofact.rendering.lobe_patches import DRAFT
from homofact.rendering.surface import seen_surface


@pytest.mark.parametrize("radius", [5.0, 20.0])
def test_a_matte_sphere_under_the_lamp_is_a_cosine(radius: float) -> None:
    # A disc of even radiance that is wholly above the horizon gives the irradiance of its middle, E cosθ.
    image = render_filtered(Lambert((0.6,), channels=("Y",)), lamp_map(radius=radius, irradiance=2.0), 64)
    _, surface = seen_surface(64, (0.0, 0.0, 1.0))
    cosine = surface.frame[:, 2] @ DEFAULT_LIGHT.unit()
    found = image.radiance.reshape(-1)[surface.pixels]
    limit = math.sin(math.radians(radius + 2))
    whole, away = (cosine > limit) & (surface.wo[:, 2] > 0.2), cosine < -limit
    assert float((found - 0.6 / math.pi * 2.0 * cosine)[whole].abs().max()) < 0.01 * 0.6 / math.pi * 2.0
    assert float(found[away].abs().max()) < 1e-7


def test_the_lamp_is_as_wide_as_it_says() -> None:
    lamp = lamp_map((0.0, 2.0, 0.0), radius=10.0, irradiance=1.0)
    assert lamp is lamp_map((0.0, 2.0, 0.0), radius=10.0, irradiance=1.0)
    towards = [(math.sin(math.radians(angle)), math.cos(math.radians(angle)), 0.0) for angle in (0, 8, 12, 180)]
    level, _ = lamp.look_up(torch.tensor(towards, dtype=torch.float64))
    # π sin²α L = E.
    assert level[:2, 0].tolist() == pytest.approx([1 / (math.pi * math.sin(math.radians(10.0)) ** 2)] * 2, rel=0.06)
    assert level[2:, 0].tolist() == [0, 0]


def test_the_sky_map_is_the_sky() -> None:
    directions = torch.nn.functional.normalize(torch.tensor([[0.5, 0.6, 0.6245], [0.0, 1, 0], [0.1, -1, 0.3]]).double())
    assert sky_map(256).look_up(directions)[0][:, 0].tolist() == pytest.approx(sky(directions).tolist(), rel=0.03)


def test_a_draft_is_the_picture_within_a_percent() -> None:
    model, light = Lambert((0.8, 0.5, 0.2)), sky_map()
    full = render_filtered(model, light, 48).radiance
    draft = FilteredMaterial.of(model, fineness=DRAFT).under(Surroundings.of(light, 48, fineness=DRAFT)).radiance
    assert 0 < float((draft - full).norm() / full.norm()) < 0.01


@pytest.mark.parametrize(
    "wrong", [{"direction": (0.0, 0.0, 0.0)}, {"radius": 0.0}, {"radius": 90.0}, {"irradiance": 0.0}, {"radius": 0.01}]
)
def test_impossible_lamps_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(BadInput, match=r"^lamp: "):
        lamp_map(**wrong)
