"""Environment maps as spherical triangles: they tile the sphere, keep the energy, and go where the light is."""

import math

import numpy as np
import pytest
import torch

from homofact.editing.lights import LARGEST, SUN, triangle_lights, triangle_solid_angles
from homofact.errors import BadInput
from homofact.rendering.light import DirectionalLight, EnvironmentMap
from homofact.scene.lighting import Lighting, named_lighting, solid_angles


def sky_with_sun(rows: int = 32) -> EnvironmentMap:
    values = torch.full((rows, 2 * rows, 3), 0.2, dtype=torch.float64)
    values[rows // 4, rows // 3] = torch.tensor([900.0, 800.0, 600.0])
    values[rows // 2 :] *= torch.tensor([1.0, 0.8, 0.5])
    return EnvironmentMap(values, turn=0.3)


def energy_of(light: EnvironmentMap) -> np.ndarray:
    rows, columns, channels = light.radiance.shape
    return (solid_angles(rows, columns) @ light.radiance.reshape(-1, channels)).numpy()


@pytest.mark.parametrize("number", [50, 400])
def test_triangles_tile_the_sphere_and_keep_the_energy(number: int) -> None:
    light = sky_with_sun()
    lights = triangle_lights(Lighting("sky", (light,)), number)
    assert number - 3 <= lights.count <= number
    assert lights.solid_angles.sum() == pytest.approx(4 * math.pi, rel=1e-12)
    np.testing.assert_allclose(lights.energy, energy_of(light), rtol=1e-12)
    assert np.abs(np.linalg.norm(lights.vertices, axis=1) - 1).max() < 1e-12
    # Middles are on the edges opposite to their corners.
    for k in range(3):
        a, b = (lights.vertices[lights.triangles[:, (k + j) % 3]] for j in (1, 2))
        middle = (a + b) / np.linalg.norm(a + b, axis=1, keepdims=True)
        np.testing.assert_allclose(lights.vertices[lights.middles[:, k]], middle, atol=1e-12)


def test_an_octant_has_an_eighth_of_the_sphere() -> None:
    assert triangle_solid_angles(np.eye(3)[None])[0] == pytest.approx(math.pi / 2, rel=1e-14)


def test_even_light_stays_even() -> None:
    lights = triangle_lights(named_lighting("uniform"), 512)
    assert lights.count == 512
    np.testing.assert_allclose(lights.radiance, 1, rtol=1e-9)
    assert lights.solid_angles.max() / lights.solid_angles.min() < 6


def test_triangles_are_small_where_the_light_is() -> None:
    light = sky_with_sun()
    lights = triangle_lights(Lighting("sky", (light,)), 400)
    sun = lights.radiance.mean(1).argmax()
    assert lights.solid_angles[sun] < np.median(lights.solid_angles) / 4
    rows, columns, _ = light.radiance.shape
    row, column = rows // 4, rows // 3
    azimuth = ((column + 0.5) / columns - 0.5) * 2 * math.pi - light.turn
    polar = (row + 0.5) * math.pi / rows
    at = (math.sin(polar) * math.sin(azimuth), math.cos(polar), -math.sin(polar) * math.cos(azimuth))
    assert math.acos(min(1, lights.centres[sun] @ at)) < 0.05


def test_the_next_to_divide_is_the_most_important() -> None:
    """No triangle that could be divided is more important than the parent of one that was."""
    lights = triangle_lights(Lighting("sky", (sky_with_sun(16),)), 200)
    energy = (lights.radiance.mean(1) * lights.solid_angles) * np.minimum(lights.solid_angles, LARGEST) ** 0.25
    smallest = float(solid_angles(16, 32).max()) / 4
    divisible = energy[lights.solid_angles > smallest]
    # A parent has four times the energy of its mean child and at least its Ω.
    assert divisible.max() < 6 * np.quantile(energy, 0.9)


def test_a_directional_light_is_a_triangle_of_the_suns_size() -> None:
    sun = DirectionalLight((0.0, 1.0, 1.0), (3.0, 2.0, 1.0))
    lights = triangle_lights(Lighting("both", (EnvironmentMap.constant(), sun)), 100)
    small = lights.solid_angles.argmin()
    assert lights.solid_angles[small] == pytest.approx(SUN, rel=1e-3)
    np.testing.assert_allclose(lights.centres[small], (0, math.sqrt(0.5), math.sqrt(0.5)), atol=1e-9)
    np.testing.assert_allclose(lights.solid_angles[small] * lights.radiance[small], (3, 2, 1), rtol=1e-3)
    assert triangle_lights(Lighting("sun", (sun,)), 100).count == 1


def test_dark_parts_are_left_out() -> None:
    lights = triangle_lights(named_lighting("studio"), 400)
    assert lights.count <= 400
    values = torch.zeros(16, 32, 1, dtype=torch.float64)
    values[2, 5] = 1
    lights = triangle_lights(Lighting("spot", (EnvironmentMap(values),)), 400)
    assert bool((lights.radiance > 0).any(1).all())
    np.testing.assert_allclose(lights.energy, energy_of(EnvironmentMap(values)), rtol=1e-12)


def test_light_that_is_none_is_refused() -> None:
    with pytest.raises(BadInput, match="every pixel is 0, expected some light"):
        EnvironmentMap.constant(0.0)
    with pytest.raises(BadInput, match="lighting: found only lights of radiance 0, expected some light"):
        Lighting("dark", (DirectionalLight((0.0, 1.0, 0.0), 0.0),))
    with pytest.raises(BadInput, match="triangles: found 3, expected at least 8"):
        triangle_lights(named_lighting("uniform"), 3)
    with pytest.raises(BadInput, match="found light of 3 channels, expected 1"):
        triangle_lights(Lighting("sky", (sky_with_sun(),)), 100, channels=1)
