"""Normal maps on the page of a relit scene: at pixels at rest, at vertices on the processor, beside a reference."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from browser import headless
from bumpy import waves, written
from relit_page import (
    change,
    library_picture,
    pixels_of,
    relit,
    relit_page,
    shown_picture,
    statistics,
    vertex_light,
    with_own_light,
)

from homofact.relighting.errors import relative
from homofact.relighting.result import RelightResult

pytestmark = pytest.mark.slow

SCENE = """
[[object]]
mesh = "metal.glb"
lobe = "separate"
terms = 2
size = 0.8
at = [-0.9, 0, 0]
[[object]]
mesh = "matt.glb"
lobe = "factored"
terms = 2
size = 0.8
at = [0.9, 0, 0]
[lighting]
named = "studio"
[[sun]]
direction = [0.5, 0.8, 0.6]
irradiance = [1.0]
[[camera]]
eye = [0, 0.8, 4]
field = 36
pixels = [64, 48]
[transport]
cube = 8
kept = 384
bounces = 1
"""


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> RelightResult:
    folder = tmp_path_factory.mktemp("normals")
    written(folder / "metal.glb", waves(), 1.0, 0.5, coloured=True)
    written(folder / "matt.glb", waves(0.8), 0.0, 1.0)
    made = relit(folder, SCENE)
    return with_own_light(made, made.sky.cube)


@pytest.fixture(scope="module")
def opened(scene: RelightResult, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    with relit_page(tmp_path_factory.mktemp("page"), scene, (280, 210)) as driver:
        yield driver


@pytest.fixture
def page(opened: Any) -> Any:
    """The page as it began; it has settled when the test has changed what it looks at."""
    opened.execute_script(
        "Object.assign(homofact.state, {turn: 0, suns: true, sky: 0, interpolation: 'vertex', show: 'picture'});"
        "homofact.changed('light'); homofact.changed('light-shown')"
    )
    return opened


def at_rest(driver: Any) -> np.ndarray:
    headless.settled(driver)
    return pixels_of(driver, "(homofact.view.stage.show(), homofact.view.stage.pixels())")[::-1]


@pytest.mark.parametrize("suns", [True, False])
def test_pixels_at_rest_have_their_mapped_normals(page: Any, scene: RelightResult, suns: bool) -> None:
    # Where pixels are to have the terms, those of a normal map are not mixed from vertices all the same.
    change(page, suns=suns, interpolation="vertex" if suns else "pixel")
    found = at_rest(page)
    size, light = (found.shape[1], found.shape[0]), scene.sky.cube.astype(float)
    wanted, cover = library_picture(page, scene, scene.objects, light, size, suns)
    apart = np.abs(found - wanted).max(-1)[cover]
    assert len(apart) > 6_000
    assert np.median(apart) < 3
    assert (apart > 25).mean() < 0.05
    # Without the map, and with the balls exchanged, it is another picture.
    assert np.median(np.abs(found - shown_picture(page)).max(-1)[cover]) > (1 if suns else 6)
    assert np.median(np.abs(found - wanted[:, ::-1]).max(-1)[cover & cover[:, ::-1]]) > 15


def test_vertices_have_them_on_the_processor(page: Any, scene: RelightResult) -> None:
    for suns in (True, False):
        change(page, "light-shown", suns=suns)
        wanted = scene.shade(scene.sky.cube, scene.cameras[0].eye, suns)
        for one, other in zip(vertex_light(page), wanted, strict=True):
            assert relative(one, other) < 0.01


def test_a_reference_is_compared_with_the_normals_of_the_vertices(page: Any) -> None:
    change(page)
    assert statistics(page)["error"] < 0.02
    change(page, "light-shown", show="difference", range=0.5)
    found = shown_picture(page, "(homofact.view.stage.draw(homofact.view, false), homofact.view.stage.pixels())")
    assert (np.abs(found - found[0, 0]).max(-1) > 60).mean() < 0.03
