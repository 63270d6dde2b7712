"""Suns on the page of a relit scene: their light at vertices, light and shadows at pixels, turned and switched off."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from browser import headless
from relit_page import ANGLE, change, compared, relit, relit_page, statistics, turned, vertex_light, with_own_light

from homofact.relighting.errors import relative
from homofact.relighting.result import RelightResult

pytestmark = pytest.mark.slow

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
    return with_own_light(relit(tmp_path_factory.mktemp("suns"), SCENE))


@pytest.fixture(scope="module")
def opened(scene: RelightResult, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    with relit_page(tmp_path_factory.mktemp("page"), scene, (320, 240)) as driver:
        yield driver


@pytest.fixture
def suns(opened: Any) -> Any:
    """The page as it began; it has settled when the test has changed what it looks at."""
    opened.execute_script(
        "Object.assign(homofact.state, {turn: 0, suns: true, sky: 0, interpolation: 'vertex', show: 'picture'});"
        "homofact.view.orbit.reset(); homofact.changed('light'); homofact.changed('light-shown')"
    )
    return opened


def test_a_disc_wider_than_a_lobe_is_asked_at_several_directions(suns: Any) -> None:
    found = suns.execute_script("return homofact.view.objects.map((each) => each.sunlight.directions)")
    assert found == [[1, 16], [1, 64], [1, 1]]


def test_the_processor_has_the_suns_of_the_library(suns: Any, scene: RelightResult) -> None:
    for on in (True, False):
        change(suns, "light-shown", suns=on)
        expected = scene.shade(scene.sky.environment(), scene.cameras[0].eye, on)
        for one, other in zip(vertex_light(suns), expected, strict=True):
            assert relative(one, other) < 4e-3


@pytest.mark.parametrize(("turn", "across"), [(0.0, 0.0), (ANGLE, 0.0), (-80.0, 40.0)])
def test_pixels_have_light_and_shadow_of_the_suns(suns: Any, scene: RelightResult, turn: float, across: float) -> None:
    suns.execute_script("homofact.state.turn = arguments[0]; homofact.changed('light')", turn)
    suns.execute_script("homofact.view.orbit.turn(arguments[0], 5); homofact.changed('light-shown')", across)
    headless.settled(suns)
    apart = compared(suns, scene, turned(scene.objects, turn))
    assert len(apart) > 11_000
    # Outlines and the edges of shadows, one sample a pixel against four, are a few pixels in a hundred.
    assert np.median(apart) < 1.5
    assert (apart > 25).mean() < 0.06
    # As wide as they are, penumbrae grow with the distance.
    assert apart.mean() < 3.2
    if turn == ANGLE:
        # The suns are most of it: without them, or with the light of another turn, nothing fits.
        assert np.median(compared(suns, scene, turned(scene.objects, turn), suns=False)) > 20
        assert (compared(suns, scene, turned(scene.objects, turn + 60)) > 25).mean() > 0.2


def test_they_are_switched_off(suns: Any, scene: RelightResult) -> None:
    # Else the light that is new for the test brings what the switch has to.
    headless.settled(suns)
    suns.execute_script("document.dispatchEvent(new KeyboardEvent('keydown', { key: 's' }))")
    assert suns.execute_script("return homofact.state.suns") is False
    suns.execute_script("homofact.changed('light-shown')")
    headless.settled(suns)
    assert np.median(compared(suns, scene, list(scene.objects), suns=False)) < 1.5
    assert statistics(suns)["error"] is None


def test_the_reference_has_them(suns: Any) -> None:
    headless.settled(suns)
    assert statistics(suns)["error"] < 0.1
    hidden = suns.execute_script("return document.getElementById('suns').closest('.field').hidden")
    assert hidden is False


def test_a_scene_without_suns_offers_none(page: Any) -> None:
    assert page.execute_script("return document.getElementById('suns').closest('.field').hidden")
    page.execute_script("document.dispatchEvent(new KeyboardEvent('keydown', { key: 's' }))")
    assert page.execute_script("return homofact.state.suns") is True
