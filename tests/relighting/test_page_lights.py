"""A sun and a lamp on the page of a small relit scene; test_page_suns and test_page_lamps have larger ones."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import torch
from browser import headless
from relit_page import (
    ANGLE,
    DAY,
    change,
    compared,
    lit_at,
    lit_by,
    relit,
    relit_page,
    slide,
    statistics,
    turned,
    vertex_light,
    with_own_light,
    words,
)

from homofact.relighting.errors import relative
from homofact.relighting.picture import picture
from homofact.relighting.result import RelightResult
from homofact.rendering.sphere import SphereImage
from homofact.rendering.tonemap import automatic_exposure
from homofact.scene.meshes import MeshGroup

# The sun's penumbra is wide: where the sun is low, a ball lies in its own. The first lamp has one shadow map, the other
# is among the balls and has six.
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
radius = 20
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
    return with_own_light(relit(tmp_path_factory.mktemp("lights"), SCENE, rings=12))


@pytest.fixture(scope="module")
def opened(scene: RelightResult, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    with relit_page(tmp_path_factory.mktemp("page"), scene, (120, 90)) as driver:
        headless.settled(driver)
        yield driver


@pytest.fixture
def lights(opened: Any) -> Any:
    """The page as it began."""
    change(opened, turn=0, suns=True, lamps=True, levels=[1, 1, 1])
    opened.execute_script("homofact.changed('light-shown')")
    headless.settled(opened)
    return opened


def test_pixels_have_their_light_and_shadows(lights: Any, scene: RelightResult) -> None:
    for turn in (0.0, ANGLE):
        change(lights, turn=turn)
        lights.execute_script("homofact.changed('light-shown')")
        headless.settled(lights)
        apart = compared(lights, scene, turned(scene.objects, turn))
        assert len(apart) > 4000
        # Outlines and the edges of shadows, one sample a pixel against four, are a few pixels in a thousand.
        assert np.median(apart) < 0.6
        assert (apart > 25).mean() < 0.01
        assert apart.mean() < 2.6


def test_vertices_have_them_where_they_are_switched_on(lights: Any, scene: RelightResult) -> None:
    """The suns' light by way of other surfaces too."""
    for suns, lamps in ((False, True), (True, False)):
        change(lights, "light-shown", suns=suns, lamps=lamps)
        expected = scene.shade(scene.sky.environment(), scene.cameras[0].eye, suns, lamps)
        for one, other in zip(vertex_light(lights), expected, strict=True):
            assert relative(one, other) < 1e-3


def test_a_slider_makes_each_lamp_brighter_or_darker(lights: Any, scene: RelightResult) -> None:
    """At pixels and on the processor, light that surfaces send on included; the exposure stays."""
    stops = lights.execute_script("return homofact.view.stops")
    # A slider's place is the level's square root.
    slide(lights, "level-1", 0.5)
    slide(lights, "level-2", 2)
    assert lights.execute_script("return homofact.view.shining") == [1, 0.25, 4]
    assert lights.execute_script("return homofact.view.stops") == stops
    assert words(lights, "levels") == "Sun level100%100%Lamp 125%100%Lamp 2400%100%"
    expected = lit_at(scene.objects, 0.25, 4)
    apart = compared(lights, scene, expected)
    assert np.median(apart) < 1.5
    assert apart.mean() < 3.2
    assert compared(lights, scene, list(scene.objects)).mean() > 8
    for one, each in zip(vertex_light(lights), expected, strict=True):
        assert relative(one, each.lit(DAY, True).shade(scene.cameras[0].eye)) < 5e-3
    # The reference is of lamps as they were.
    assert statistics(lights)["error"] is None
    assert "as bright as in the scene’s file" in words(lights, "error-words")
    lights.execute_script("document.querySelectorAll('#levels button').forEach((each) => each.click())")
    assert words(lights, "levels") == "Sun level100%100%Lamp 1100%100%Lamp 2100%100%"
    assert statistics(lights)["error"] < 0.01


def test_a_lamp_or_sun_at_nothing_is_not_there(lights: Any, scene: RelightResult) -> None:
    slide(lights, "level-0", 0)
    slide(lights, "level-2", 0)
    assert np.median(compared(lights, scene, lit_by(scene.objects, 0), suns=False)) < 1.5
    # The lamp itself is no longer seen either.
    drawn = (
        "const { gl, lamps } = homofact.view.stage, draw = gl.drawElements; let count = 0;"
        "gl.drawElements = (...given) => { count += 1; draw.apply(gl, given); };"
        "lamps.draw(homofact.view.stage, homofact.view, 1); delete gl.drawElements; return count"
    )
    assert lights.execute_script(drawn) == 1


def test_the_page_s_exposure_is_that_of_the_library_s_picture(lights: Any, scene: RelightResult) -> None:
    lit, meshes = [each.lit(DAY, True) for each in scene.objects], [each.mesh for each in scene.objects]
    eye = scene.cameras[0].eye
    given = meshes, [each.terms(eye) for each in lit], MeshGroup(meshes).occluder, scene.cameras[0]
    radiance, cover = picture(*given, scene.sky.environment(), lit)
    shown = SphereImage(torch.from_numpy(radiance), torch.from_numpy(cover))
    stops = lights.execute_script("return homofact.view.stops")
    assert stops == pytest.approx(math.log2(automatic_exposure(shown)), abs=0.06)
    # Far from it the picture is measured again, as half floats would need.
    script = (
        "const v = homofact.view, own = v.stage.meter.pixels(v, 0);"
        "return [0, 20, -20].map((by) => { const p = v.stage.meter.pixels;"
        " v.stage.meter.pixels = (view, stops) => own.map((x) => Math.min(x * 2 ** (stops + by), 6e4));"
        " const found = v.stage.meter.stops(v) + by; v.stage.meter.pixels = p; return found; })"
    )
    assert lights.execute_script(script) == pytest.approx([stops] * 3, abs=0.01)
    # Without pictures of floats, by vertices.
    script = "const m = homofact.view.stage.meter, f = m.frame; m.frame = null; const s = m.stops(homofact.view);"
    assert lights.execute_script(f"{script} m.frame = f; return s") == pytest.approx(stops, abs=1)
