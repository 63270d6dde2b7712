"""A sun and a lamp on the page of a small relit scene; test_page_suns and test_page_lamps have larger ones."""

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from browser import headless
from coarse import coarse_shapes, coarse_terms
from relit_page import ANGLE, change, library_picture, relit_page, shown_picture

from homofact.relighting.build import open_relight_scene, relit_objects
from homofact.relighting.errors import relative
from homofact.relighting.result import RelightResult
from homofact.relighting.scene_file import read_relight_scene

# The sun's penumbra is wide. The lamp is far enough from the ball for one shadow map.
SCENE = """
[[object]]
mesh = "shape:sphere"
material = "material:phong-10"
terms = 2
size = 0.5
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
DAY = np.ones((6, 8, 8, 3))


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> RelightResult:
    file = tmp_path_factory.mktemp("lights") / "scene.toml"
    file.write_text(SCENE)
    with coarse_shapes(rings=8), coarse_terms():
        opened = open_relight_scene(read_relight_scene(file))
        return RelightResult.of(opened.file, relit_objects(opened), {})


@pytest.fixture(scope="module")
def opened(scene: RelightResult, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    with relit_page(tmp_path_factory.mktemp("page"), scene, (120, 90)) as driver:
        headless.settled(driver)
        yield driver


def compared(driver: Any, scene: RelightResult, turn: float) -> np.ndarray:
    """The largest difference (N,) of the channels, in 255ths, at the page's pixels that are all surface."""
    a = math.radians(turn)
    rotation = np.array([[math.cos(a), 0, math.sin(a)], [0, 1, 0], [-math.sin(a), 0, math.cos(a)]])
    objects = []
    for each in scene.objects:
        assert each.sunlight is not None
        suns = tuple(replace(sun, direction=rotation @ sun.direction) for sun in each.sunlight.suns)
        objects.append(replace(each, sunlight=replace(each.sunlight, suns=suns)))
    shown = shown_picture(driver)
    expected, cover = library_picture(driver, scene, objects, DAY, (shown.shape[1], shown.shape[0]), True)
    return np.abs(shown - expected).max(-1)[cover]


def test_pixels_have_their_light_and_shadows(opened: Any, scene: RelightResult) -> None:
    for turn in (0.0, ANGLE):
        change(opened, turn=turn)
        opened.execute_script("homofact.changed('light-shown')")
        headless.settled(opened)
        apart = compared(opened, scene, turn)
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
        found = opened.execute_script("return homofact.view.shade().map((each) => Array.from(each))")
        expected = scene.shade(scene.sky.environment(), scene.cameras[0].eye, suns, lamps)
        for one, other in zip(found, expected, strict=True):
            assert relative(np.array(one).reshape(-1, 3), other) < 1e-3
