"""Suns on the page of a relit scene: their light at vertices, light and shadows at pixels, turned and switched off."""

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch
from browser import browser, complaints, headless
from relit_page import ANGLE, change, eye_of, statistics

from homofact.relighting.build import RelitObject, open_relight_scene, relit_objects
from homofact.relighting.errors import dense_colours, relative
from homofact.relighting.page.relit_page import write_relit_page
from homofact.relighting.picture import picture
from homofact.relighting.result import RelightResult
from homofact.relighting.scene_file import read_relight_scene
from homofact.rendering.tonemap import encode_srgb
from homofact.scene.cameras import Camera
from homofact.scene.meshes import MeshGroup

SCENE = """
[[object]]
mesh = "shape:knot"
material = "material:phong-30"
terms = 4
lobe = "factored"
size = 0.8
[[object]]
mesh = "shape:sphere"
material = "material:car-paint-red"
terms = 1
lobe = "separate"
size = 0.3
at = [0.9, -0.4, 0.7]
[ground]
albedo = [0.4, 0.3, 0.2]
half = 2
steps = 12
[lighting]
named = "uniform"
[[sun]]
direction = [0.5, 0.8, 0.4]
irradiance = [4.0, 3.0, 2.0]
[[sun]]
direction = [-0.7, 0.6, 0.3]
irradiance = [4.0, 5.0, 6.0]
radius = 6
[[camera]]
eye = [0, 1.2, 3]
field = 36
pixels = [64, 48]
[transport]
cube = 8
kept = 60
bounces = 1
"""


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> RelightResult:
    file = tmp_path_factory.mktemp("suns") / "scene.toml"
    file.write_text(SCENE)
    opened = open_relight_scene(read_relight_scene(file))
    sums = dense_colours(opened, np.ones((6, 8, 8, 3)))
    return RelightResult.of(opened.file, relit_objects(opened), {}, reference=sums)


@pytest.fixture(scope="module")
def opened(scene: RelightResult, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    folder = tmp_path_factory.mktemp("page")
    write_relit_page(folder / "suns.html", scene)
    with browser(folder) as driver:
        headless.open_page(driver, folder / "suns.html")
        driver.execute_script(
            "const p = document.getElementById('picture'); p.style.width = '420px'; p.style.height = '320px';"
            "homofact.changed('picture');"
        )
        headless.settled(driver)
        yield driver
        assert complaints(driver) == []


@pytest.fixture
def suns(opened: Any) -> Any:
    """The page as it began."""
    change(opened, turn=0, suns=True, sky=0, interpolation="vertex", show="picture")
    opened.execute_script("homofact.view.orbit.reset(); homofact.changed('light-shown')")
    headless.settled(opened)
    return opened


def turned(objects: tuple[RelitObject, ...], degrees: float) -> list[RelitObject]:
    """The objects under suns that are turned with the sky, from +z towards +x."""
    a = math.radians(degrees)
    turn = np.array([[math.cos(a), 0, math.sin(a)], [0, 1, 0], [-math.sin(a), 0, math.cos(a)]])
    found = []
    for each in objects:
        assert each.sunlight is not None
        moved = tuple(replace(sun, direction=turn @ sun.direction) for sun in each.sunlight.suns)
        found.append(replace(each, sunlight=replace(each.sunlight, suns=moved)))
    return found


def compared(driver: Any, scene: RelightResult, objects: list[RelitObject], suns: bool = True) -> np.ndarray:
    """The largest difference (N,) of the channels, in 255ths, at the page's pixels that are all surface."""
    width, height, data = driver.execute_script(
        "const p = homofact.pixels(), c = homofact.view.stage.canvas; return [c.width, c.height, Array.from(p)]"
    )
    shown = np.array(data, float).reshape(height, width, 4)[::-1, :, :3]
    camera = Camera(tuple(eye_of(driver)), scene.cameras[0].target, scene.cameras[0].field, (width, height))
    lit = [each.lit(np.ones((6, 8, 8, 3)), suns) for each in objects]
    meshes = [each.mesh for each in objects]
    colours = [each.terms(camera.eye) for each in lit]
    radiance, cover = picture(meshes, colours, MeshGroup(meshes).occluder, camera, scene.sky.environment(), lit)
    x = np.maximum(radiance * 2 ** driver.execute_script("return homofact.view.stops"), 0)
    x = x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14)
    expected = encode_srgb(torch.from_numpy(x)).numpy() * 255
    return np.abs(shown - expected).max(-1)[cover > 0.999]


def test_a_disc_wider_than_a_lobe_is_asked_at_several_directions(suns: Any) -> None:
    found = suns.execute_script("return homofact.view.objects.map((each) => each.sunlight.directions)")
    assert found == [[1, 1], [1, 32], [1, 1]]


def test_the_processor_has_the_suns_of_the_library(suns: Any, scene: RelightResult) -> None:
    for on in (True, False):
        change(suns, "light-shown", suns=on)
        found = suns.execute_script("return homofact.view.shade().map((each) => Array.from(each))")
        expected = scene.shade(scene.sky.environment(), scene.cameras[0].eye, on)
        for one, other in zip(found, expected, strict=True):
            assert relative(np.array(one).reshape(-1, 3), other) < 4e-3


@pytest.mark.parametrize(("turn", "across"), [(0.0, 0.0), (ANGLE, 0.0), (-80.0, 40.0)])
def test_pixels_have_light_and_shadow_of_the_suns(suns: Any, scene: RelightResult, turn: float, across: float) -> None:
    change(suns, turn=turn)
    suns.execute_script("homofact.view.orbit.turn(arguments[0], 5); homofact.changed('light-shown')", across)
    headless.settled(suns)
    apart = compared(suns, scene, turned(scene.objects, turn))
    assert len(apart) > 20_000
    # Outlines and the edges of shadows, one sample a pixel against four, are a few pixels in a hundred.
    assert np.median(apart) < 1.5
    assert (apart > 25).mean() < 0.06
    # As wide as they are, penumbrae grow with the distance.
    assert apart.mean() < 3.2
    # The suns are most of it: without them, or with the light of another turn, nothing fits.
    assert np.median(compared(suns, scene, turned(scene.objects, turn), suns=False)) > 20
    assert (compared(suns, scene, turned(scene.objects, turn + 60)) > 25).mean() > 0.2


def test_they_are_switched_off(suns: Any, scene: RelightResult) -> None:
    suns.execute_script("document.dispatchEvent(new KeyboardEvent('keydown', { key: 's' }))")
    headless.settled(suns)
    assert suns.execute_script("return homofact.state.suns") is False
    suns.execute_script("homofact.changed('light-shown')")
    headless.settled(suns)
    assert np.median(compared(suns, scene, list(scene.objects), suns=False)) < 1.5
    assert statistics(suns)["error"] is None


def test_the_reference_has_them(suns: Any) -> None:
    assert statistics(suns)["error"] < 0.1
    hidden = suns.execute_script("return document.getElementById('suns').closest('.field').hidden")
    assert hidden is False


def test_a_scene_without_suns_offers_none(page: Any) -> None:
    assert page.execute_script("return document.getElementById('suns').closest('.field').hidden")
    page.execute_script("document.dispatchEvent(new KeyboardEvent('keydown', { key: 's' }))")
    assert page.execute_script("return homofact.state.suns") is True
