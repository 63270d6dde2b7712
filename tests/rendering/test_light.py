"""Environment maps: the lat-long convention, the density of draws, and what is refused."""

import math

import pytest
import torch
from refusals import refused

from homofact.errors import BadInput
from homofact.rendering.light import DEFAULT_LIGHT, DirectionalLight, EnvironmentMap


def spot(row, column, rows=8):
    level = torch.zeros(rows, 2 * rows, 1, dtype=torch.float64)
    level[row, column] = 1
    return EnvironmentMap(level)


def seen(sky, direction):
    return float(sky.look_up(torch.tensor([direction], dtype=torch.float64))[0])


def test_the_map_lies_round_the_viewer_as_stated():
    # 16 columns: the middle (8) looks along −z, a quarter to the right (12) along +x, the seam along +z.
    tilt = 1e-3
    assert seen(spot(4, 8), (tilt, -tilt, -1)) == 1
    assert seen(spot(4, 7), (-tilt, -tilt, -1)) == 1
    assert seen(spot(4, 12), (1, -tilt, tilt)) == 1
    assert seen(spot(4, 0), (-tilt, -tilt, 1)) == 1
    assert seen(spot(4, 15), (tilt, -tilt, 1)) == 1
    assert seen(spot(0, 8), (tilt / 9, 1, -tilt)) == 1
    assert seen(spot(7, 8), (tilt / 9, -1, -tilt)) == 1
    assert seen(spot(7, 8), (tilt / 9, 1, -tilt)) == 0


def test_turning_moves_the_surroundings_from_z_to_x():
    sky = spot(4, 0).turned(math.pi / 2)
    assert seen(sky, (1, -1e-3, 1e-3)) == 1


def test_draws_have_the_density_that_look_up_tells():
    level = torch.rand(6, 12, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(3))
    sky = EnvironmentMap(level, 0.4)
    points = torch.rand(200_000, 2, dtype=torch.float64, generator=torch.Generator().manual_seed(4))
    drawn = sky.draw(points)
    torch.testing.assert_close(drawn.norm(dim=1), torch.ones(len(drawn), dtype=torch.float64))
    radiance, density = sky.look_up(drawn)
    # Radiance over density is its integral times the colour's share: constant in the mean of the channels.
    ratio = radiance.mean(1) / density
    torch.testing.assert_close(ratio, ratio[:1].expand_as(ratio))
    # ∫ g dω by importance equals the sum over uniform directions, for g = (1 + y)².
    weighted = ((1 + drawn[:, 1]) ** 2 / density).mean()
    assert float(weighted) == pytest.approx(16 * math.pi / 3, rel=0.02)


def test_density_integrates_to_one():
    level = torch.rand(6, 12, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(3))
    z = torch.rand(200_000, 2, dtype=torch.float64, generator=torch.Generator().manual_seed(4))
    y, azimuth = 2 * z[:, 0] - 1, 2 * torch.pi * z[:, 1]
    around = (1 - y**2).sqrt()
    uniform = torch.stack((around * torch.cos(azimuth), y, around * torch.sin(azimuth)), 1)
    _, density = EnvironmentMap(level).look_up(uniform)
    assert float(density.mean() * 4 * math.pi) == pytest.approx(1, rel=0.01)


def test_black_texels_are_never_drawn():
    points = torch.rand(5000, 2, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    sky = spot(3, 5)
    radiance, _ = sky.look_up(sky.draw(points))
    assert (radiance > 0).double().mean() > 0.99


def test_default_light_comes_from_the_upper_right_in_front():
    x, y, z = DEFAULT_LIGHT.unit().tolist()
    assert min(x, y) > 0
    assert z > 0.5
    assert "irradiance 3.14" in DEFAULT_LIGHT.describe()


@pytest.mark.parametrize("value", [math.nan, math.inf, -0.5])
def test_bad_radiance_names_its_pixel(value):
    level = torch.ones(4, 8, 3, dtype=torch.float64)
    level[2, 5, 1] = value
    with pytest.raises(BadInput, match="row 2, column 5"):
        EnvironmentMap(level, name="sky.hdr")


@pytest.mark.parametrize("value", [1.7e38, 1e13, 1e-13, 5e-324])
def test_light_of_which_no_float32_can_be_made_is_refused(value):
    with refused(where="sky.hdr"):
        EnvironmentMap(torch.full((4, 8, 3), value, dtype=torch.float64), name="sky.hdr")
    if value > 1:
        with refused(where="light radiance"):
            DirectionalLight((0, 0, 1), value)


def test_other_bad_light():
    with pytest.raises(BadInput, match="shape"):
        EnvironmentMap(torch.ones(4, 8, 2, dtype=torch.float64))
    with pytest.raises(BadInput, match="every pixel is 0"):
        EnvironmentMap(torch.zeros(4, 8, 3, dtype=torch.float64))
    with pytest.raises(BadInput, match="direction"):
        DirectionalLight((0, 0, 0))
    with pytest.raises(BadInput, match="direction"):
        DirectionalLight((0, math.nan, 1))
    with pytest.raises(BadInput, match="radiance"):
        DirectionalLight((0, 0, 1), -1.0)


def test_between_centres_radiance_is_mixed_and_at_them_it_is_the_texel() -> None:
    level = torch.rand((6, 12, 3), generator=torch.Generator().manual_seed(3), dtype=torch.float64)
    sky = EnvironmentMap(level, turn=0.7)
    row, column = torch.meshgrid(torch.arange(6), torch.arange(12), indexing="ij")

    def towards(rows: torch.Tensor, columns: torch.Tensor) -> torch.Tensor:
        """The direction at a place counted in texels from the map's corner."""
        polar, azimuth = rows.double() / 6 * math.pi, (columns.double() / 12 - 0.5) * 2 * math.pi - sky.turn
        return torch.stack((polar.sin() * azimuth.sin(), polar.cos(), -polar.sin() * azimuth.cos()), -1)

    centres = towards(row + 0.5, column + 0.5)
    assert torch.allclose(sky.between(centres), level)
    assert torch.allclose(sky.look_up(centres)[0], level)
    # Halfway to the next column, around the seam of the map too, and to the next row.
    assert torch.allclose(sky.between(towards(row + 0.5, column + 1.0)), (level + level.roll(-1, 1)) / 2)
    down = (level[:-1] + level[1:]) / 2
    assert torch.allclose(sky.between(towards(row[:-1] + 1.0, column[:-1] + 0.5)), down)
    # Over a pole the nearest row stays.
    assert torch.allclose(sky.between(towards(row[:1] + 0.1, column[:1] + 0.5)), level[:1])
