"""Lamps on the page of a relit scene with lobes; test_page_lights has the faster tests of sliders and exposure."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from browser import headless
from relit_page import (
    ANGLE,
    change,
    compared,
    lit_by,
    relit,
    relit_page,
    shown_picture,
    statistics,
    vertex_light,
    with_own_light,
)

from homofact.relighting.errors import relative
from homofact.relighting.result import RelightResult

# The first lamp is beside the objects and has one shadow map, the second is among them and has six.
SCENE = """
[[object]]
mesh = "shape:sphere"
material = "material:phong-30"
terms = 4
lobe = "factored"
size = 0.5
at = [-0.3, -0.1, 0]
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
irradiance = [1.0, 0.8, 0.6]
[[lamp]]
position = [-1.8, 2.2, 1.6]
radius = 0.2
intensity = [20.0, 24.0, 30.0]
[[lamp]]
position = [0.8, 0.4, 0.9]
radius = 0.08
intensity = [3.0, 2.0, 1.0]
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
    return with_own_light(relit(tmp_path_factory.mktemp("lamps"), SCENE))


@pytest.fixture(scope="module")
def opened(scene: RelightResult, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    with relit_page(tmp_path_factory.mktemp("page"), scene, (120, 90)) as driver:
        headless.settled(driver)
        yield driver


@pytest.fixture
def lamps(opened: Any) -> Any:
    """The page as it began."""
    change(opened, turn=0, suns=True, lamps=True, levels=[1, 1, 1], sky=0, interpolation="vertex", show="picture")
    opened.execute_script("homofact.view.orbit.reset(); homofact.changed('light-shown')")
    headless.settled(opened)
    return opened


@pytest.mark.slow
def test_lamps_have_one_shadow_map_or_those_of_a_cube(lamps: Any) -> None:
    script = "return homofact.view.stage.shadows.maps.map(({ first, layers }) => [first, layers])"
    assert lamps.execute_script(script) == [[0, 1], [1, 1], [2, 6]]


@pytest.mark.slow
@pytest.mark.parametrize("on", [True, False])
def test_the_processor_has_the_lamps_of_the_library(on: bool, lamps: Any, scene: RelightResult) -> None:
    change(lamps, "light-shown", lamps=on)
    expected = scene.shade(scene.sky.environment(), scene.cameras[0].eye, suns=True, lamps=on)
    for one, other in zip(vertex_light(lamps), expected, strict=True):
        assert relative(one, other) < 5e-3


@pytest.mark.slow
def test_pixels_have_light_and_shadow_of_the_lamps(lamps: Any, scene: RelightResult) -> None:
    lamps.execute_script("homofact.view.orbit.turn(30, 5); homofact.changed('light-shown')")
    headless.settled(lamps)
    apart = compared(lamps, scene, list(scene.objects))
    assert len(apart) > 3000
    # Outlines and the edges of shadows, one sample a pixel against four, are a few pixels in a hundred.
    assert np.median(apart) < 1.5
    assert (apart > 25).mean() < 0.04
    assert apart.mean() < 3.2
    # Either lamp is much of it.
    for other in ((0,), (1,)):
        assert compared(lamps, scene, lit_by(scene.objects, *other)).mean() > 8


@pytest.mark.slow
def test_lamps_stay_where_they_are_under_another_sky_and_a_turned_one(lamps: Any, scene: RelightResult) -> None:
    """The sky has the same radiance from everywhere, so that its turn changes the sun alone."""
    change(lamps, turn=ANGLE, suns=False)
    lamps.execute_script("homofact.changed('light-shown')")
    headless.settled(lamps)
    assert np.median(compared(lamps, scene, list(scene.objects), suns=False)) < 1.5
    shining = "return homofact.view.shining"
    change(lamps, turn=0, suns=True, sky=1)
    assert lamps.execute_script(shining) == [0, 1, 1]
    change(lamps, sky=0)
    assert lamps.execute_script(shining) == [1, 1, 1]


@pytest.mark.slow
def test_they_are_seen_and_switched_off(lamps: Any, scene: RelightResult) -> None:
    # The reference is the library's own light.
    assert statistics(lamps)["error"] < 0.01
    # The second lamp is in the picture, as a bright disc.
    eye, target, lamp = (np.array(each) for each in (scene.cameras[0].eye, scene.cameras[0].target, [0.8, 0.4, 0.9]))
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, (0, 1, 0))
    right /= np.linalg.norm(right)
    shown = shown_picture(lamps)
    height, width = shown.shape[:2]
    scale = height / 2 / np.tan(np.radians(18)) / ((lamp - eye) @ forward)
    at = (
        round(height / 2 - scale * float((lamp - eye) @ np.cross(right, forward))),
        round(width / 2 + scale * float((lamp - eye) @ right)),
    )
    assert (shown[at] > 250).all()
    lamps.execute_script("document.dispatchEvent(new KeyboardEvent('keydown', { key: 'm' }))")
    headless.settled(lamps)
    assert lamps.execute_script("return homofact.state.lamps") is False
    lamps.execute_script("homofact.changed('light-shown')")
    headless.settled(lamps)
    dark = [replace(each, sunlight=each.sunlight.only(True, False)) for each in scene.objects if each.sunlight]
    assert np.median(compared(lamps, scene, dark)) < 1.5
    assert statistics(lamps)["error"] is None


@pytest.mark.slow
def test_a_scene_without_lamps_offers_none(page: Any) -> None:
    assert page.execute_script("return document.getElementById('lamps').closest('.field').hidden")
    page.execute_script("document.dispatchEvent(new KeyboardEvent('keydown', { key: 'm' }))")
    assert page.execute_script("return homofact.state.lamps") is True
