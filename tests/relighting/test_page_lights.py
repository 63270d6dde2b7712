"""A sun and a lamp on the page of a small relit scene; test_page_suns and test_page_lamps have larger ones."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from browser import headless
from relit_page import ANGLE, change, compared, relit, relit_page, turned, vertex_light

from homofact.relighting.errors import relative
from homofact.relighting.result import RelightResult

# The sun's penumbra is wide. The first lamp has one shadow map, the second is among the balls and has six.
SCENE = """
[[object]]
mesh = "shape:sphere"
material = "material:phong-10"
terms = 2
size = 0.5
at = [-0.3, -0.1, 0]
[[object]]
mesh = "shape:sphere"
albedo = [0.2, 0.4, 0.6]
size = 0.3
at = [0.9, -0.4, 0.7]
[ground]
albedo = [0.4, 0.3, 0.2]
half = 2
steps = 8
[lighting]
named = "uniform"
[[sun]]
direction = [0.5, 0.8, 0.4]
irradiance = [4.0, 3.0, 2.0]
radius = 6
[[lamp]]
position = [-1.8, 2.2, 1.6]
radius = 0.2
intensity = [5.0, 6.0, 8.0]
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
    return relit(tmp_path_factory.mktemp("lights"), SCENE, rings=8)


@pytest.fixture(scope="module")
def opened(scene: RelightResult, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    with relit_page(tmp_path_factory.mktemp("page"), scene, (120, 90)) as driver:
        headless.settled(driver)
        yield driver


def test_pixels_have_their_light_and_shadows(opened: Any, scene: RelightResult) -> None:
    for turn in (0.0, ANGLE):
        change(opened, turn=turn)
        opened.execute_script("homofact.changed('light-shown')")
        headless.settled(opened)
        apart = compared(opened, scene, turned(scene.objects, turn))
        assert len(apart) > 4000
        # Outlines and the edges of shadows, one sample a pixel against four, are a few pixels in a thousand.
        assert np.median(apart) < 0.6
        assert (apart > 25).mean() < 0.01
        assert apart.mean() < 1.6


def test_vertices_have_them_where_they_are_switched_on(opened: Any, scene: RelightResult) -> None:
    """The suns' light by way of other surfaces too."""
    change(opened, turn=0)
    for suns, lamps in ((False, True), (True, False)):
        change(opened, "light-shown", suns=suns, lamps=lamps)
        expected = scene.shade(scene.sky.environment(), scene.cameras[0].eye, suns, lamps)
        for one, other in zip(vertex_light(opened), expected, strict=True):
            assert relative(one, other) < 1e-3
