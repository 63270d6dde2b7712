"""The sun of an environment map, taken out of it: its light, place and size, and maps that have none."""

import math
from pathlib import Path

import numpy as np
import pytest
import torch
from refusals import refused

from homofact.relighting.map_sun import separate_sun
from homofact.relighting.scene_file import read_relight_scene
from homofact.rendering.environment import read_environment
from homofact.rendering.light import EnvironmentMap
from homofact.scene.lighting import named_environment, solid_angles, texel_directions

ROOT = Path(__file__).resolve().parents[2]
AXIS = np.array([0.48, 0.6, 0.64])


def map_with(radius: float, level: tuple[float, float, float], rows: int = 512) -> EnvironmentMap:
    """A sky that brightens upwards, with a disc of a radius in degrees."""
    w = texel_directions(rows, 2 * rows).numpy()
    values = (0.5 + 0.4 * w[:, 1:2]) * np.array([[0.6, 0.8, 1.0]])
    values[w @ AXIS > math.cos(math.radians(radius))] += level
    return EnvironmentMap(torch.from_numpy(values.reshape(rows, 2 * rows, 3)), name="sky")


def flux(light: EnvironmentMap) -> np.ndarray:
    """All light (3,) of a map."""
    rows, columns, channels = light.radiance.shape
    return (light.radiance.reshape(-1, channels) * solid_angles(rows, columns)[:, None]).sum(0).numpy()


@pytest.mark.parametrize("radius", [1.5, 4.0])
def test_the_sun_has_the_disc_s_light_place_and_size(radius: float) -> None:
    light = map_with(radius, (300.0, 250.0, 200.0))
    rest, sun = separate_sun(light)
    assert sun is not None
    solid = 2 * math.pi * (1 - math.cos(math.radians(radius)))
    assert sun.irradiance == pytest.approx(solid * np.array([300, 250, 200]), rel=0.05)
    assert sun.direction @ AXIS > math.cos(math.radians(0.15))
    assert math.degrees(sun.radius) == pytest.approx(radius, rel=0.03)
    # Nothing is lost, and what is left is the sky.
    assert flux(rest) + sun.irradiance == pytest.approx(flux(light), rel=1e-9)
    plain = map_with(0.0, (0.0, 0.0, 0.0)).radiance
    assert float((rest.radiance - plain).abs().max()) < 0.1


def test_a_turned_map_has_a_turned_sun() -> None:
    light = map_with(1.5, (300.0, 250.0, 200.0)).turned(math.radians(50))
    _, sun = separate_sun(light)
    assert sun is not None
    found, density = light.look_up(torch.from_numpy(sun.direction))
    assert float(found.mean()) > 200
    assert float(density) > 1


def test_the_radius_may_be_another() -> None:
    light = map_with(4.0, (300.0, 250.0, 200.0))
    (_, own), (_, other) = separate_sun(light), separate_sun(light, 0.01)
    assert own is not None
    assert other is not None
    assert other.radius == 0.01
    assert other.irradiance == pytest.approx(own.irradiance)


@pytest.mark.parametrize(
    "light",
    [
        named_environment("overcast"),
        named_environment("studio"),
        named_environment("uniform"),
        # Wider than a sun, no brighter than clouds, of too little light.
        map_with(8.0, (300.0, 250.0, 200.0)),
        map_with(1.5, (3.0, 3.0, 3.0)),
        map_with(0.6, (100.0, 100.0, 100.0)),
    ],
)
def test_other_maps_stay_as_they_are(light: EnvironmentMap) -> None:
    rest, sun = separate_sun(light)
    assert sun is None
    assert rest is light


def test_a_map_of_a_sun_alone_stays_as_it_is() -> None:
    values = torch.zeros(64, 128, 3, dtype=torch.float64)
    values[20, 30] = 1000.0
    light = EnvironmentMap(values)
    assert separate_sun(light) == (light, None)


def scene(folder: Path, lighting: str) -> Path:
    file = folder / "scene.toml"
    sky = ROOT / "data_synthetic" / "sky.hdr"
    file.write_text(
        f'[[object]]\nmesh = "shape:sphere"\nalbedo = [0.5]\n[lighting]\nenvironment = "{sky}"\n{lighting}\n'
        "[[camera]]\neye = [0, 1, 3]\n"
    )
    return file


def test_a_scene_s_map_gives_its_sun(tmp_path: Path) -> None:
    whole = read_environment(ROOT / "data_synthetic" / "sky.hdr")
    found = read_relight_scene(scene(tmp_path, "turn = 30"))
    (sun,) = found.suns
    assert flux(found.light) + sun.irradiance == pytest.approx(flux(whole), rel=1e-9)
    assert found.light.turn == pytest.approx(math.radians(30))
    assert len(found.notes) == 1
    (sharp,) = read_relight_scene(scene(tmp_path, "sun_radius = 0.5")).suns
    assert sharp.radius == pytest.approx(math.radians(0.5))
    kept = read_relight_scene(scene(tmp_path, 'sun = "texels"'))
    assert kept.suns == ()
    assert kept.notes == ()
    assert float(kept.light.radiance.max()) == float(whole.radiance.max())


@pytest.mark.parametrize(
    ("lighting", "where"),
    [
        ('sun = "moon"', "scene.toml: lighting.sun"),
        ("sun_radius = 0", "scene.toml: lighting.sun_radius"),
        ('sun = "texels"\nsun_radius = 1', "scene.toml: lighting.sun_radius"),
        ("[[sun]]\ndirection = [0, 1, 0]\nirradiance = [1]\n" * 8, "scene.toml: sun"),
    ],
)
def test_what_cannot_be_is_refused(lighting: str, where: str, tmp_path: Path) -> None:
    with refused(where=where):
        read_relight_scene(scene(tmp_path, lighting))
