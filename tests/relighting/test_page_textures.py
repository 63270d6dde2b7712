"""Base-colour textures on the page of a relit scene: at vertices on processor and card, at pixels, in comparisons."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import torch
from browser import browser, complaints, headless
from relit_page import change, eye_of, statistics
from textured import written

from homofact.relighting.build import open_relight_scene, relit_objects
from homofact.relighting.errors import dense_colours, relative
from homofact.relighting.page import build
from homofact.relighting.page.relit_page import write_relit_page
from homofact.relighting.picture import picture
from homofact.relighting.result import RelightResult
from homofact.relighting.scene_file import read_relight_scene
from homofact.rendering.tonemap import encode_srgb
from homofact.scene.cameras import Camera
from homofact.scene.meshes import MeshGroup
from homofact.scene.tint import SurfaceTint

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
named = "uniform"
[[sun]]
direction = [0.5, 0.8, 0.6]
irradiance = [1.0]
[[camera]]
eye = [0, 0.8, 4]
field = 36
pixels = [64, 48]
[transport]
cube = 8
kept = 200
bounces = 1
"""
SKY = np.ones((6, 8, 8, 3))


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> RelightResult:
    folder = tmp_path_factory.mktemp("textures")
    written(folder / "metal.glb", 1.0, 0.5)
    written(folder / "matt.glb", 0.0, 1.0)
    (folder / "scene.toml").write_text(SCENE)
    opened = open_relight_scene(read_relight_scene(folder / "scene.toml"))
    return RelightResult.of(opened.file, relit_objects(opened), {}, reference=dense_colours(opened, SKY))


@pytest.fixture(scope="module")
def opened(scene: RelightResult, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    folder = tmp_path_factory.mktemp("page")
    write_relit_page(folder / "textures.html", scene)
    with browser(folder) as driver:
        headless.open_page(driver, folder / "textures.html")
        driver.execute_script(
            "const p = document.getElementById('picture'); p.style.width = '420px'; p.style.height = '320px';"
            "homofact.changed('picture');"
        )
        headless.settled(driver)
        yield driver
        assert complaints(driver) == []


@pytest.fixture
def page(opened: Any) -> Any:
    """The page as it began."""
    change(opened, turn=0, suns=True, sky=0, interpolation="vertex", show="picture")
    return opened


def shown(driver: Any, script: str = "homofact.pixels()") -> np.ndarray:
    """The page's picture (H, W, 3) from above, 0 to 255."""
    width, height, data = driver.execute_script(
        f"const p = {script}, c = homofact.view.stage.canvas; return [c.width, c.height, Array.from(p)]"
    )
    return np.array(data, float).reshape(height, width, 4)[::-1, :, :3]


def expected(driver: Any, scene: RelightResult, size: tuple[int, int], suns: bool) -> tuple[np.ndarray, np.ndarray]:
    """(the library's picture as the page would show it, whether a pixel is all surface)."""
    camera = Camera(tuple(eye_of(driver)), scene.cameras[0].target, scene.cameras[0].field, size)
    lit, meshes = [each.lit(SKY, suns) for each in scene.objects], [each.mesh for each in scene.objects]
    colours = [each.terms(camera.eye) for each in lit]
    radiance, cover = picture(meshes, colours, MeshGroup(meshes).occluder, camera, scene.sky.environment(), lit)
    x = np.maximum(radiance * 2 ** driver.execute_script("return homofact.view.stops"), 0)
    x = x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14)
    return encode_srgb(torch.from_numpy(x)).numpy() * 255, cover > 0.999


@pytest.mark.parametrize("interpolation", ["vertex", "pixel"])
@pytest.mark.parametrize("suns", [True, False])
def test_pixels_have_the_colours_of_the_textures(
    page: Any, scene: RelightResult, interpolation: str, suns: bool
) -> None:
    change(page, suns=suns, interpolation=interpolation)
    found = shown(page)
    wanted, cover = expected(page, scene, (found.shape[1], found.shape[0]), suns)
    apart = np.abs(found - wanted).max(-1)[cover]
    assert len(apart) > 15_000
    # The separate lobe is at vertices in this picture, and where colours meet the texture has smaller copies.
    assert np.median(apart) < 2.5
    assert (apart > 25).mean() < 0.06
    # With the balls exchanged nothing fits.
    assert np.abs(found - wanted[:, ::-1]).max(-1)[cover & cover[:, ::-1]].mean() > 20


def test_vertices_have_them_on_processor_and_card(page: Any, scene: RelightResult) -> None:
    for suns in (True, False):
        change(page, "light-shown", suns=suns)
        found = page.execute_script("return homofact.view.shade().map((each) => Array.from(each))")
        wanted = scene.shade(SKY, scene.cameras[0].eye, suns)
        for one, other in zip(found, wanted, strict=True):
            assert relative(np.array(one).reshape(-1, 3), other) < 6e-3
    card = page.execute_script(
        "return homofact.view.stage.objects.map((o) => { o.shade(homofact.view); return Array.from(o.read()); })"
    )
    for one, other in zip(card, found, strict=True):
        facing = np.array(other).reshape(-1, 3).any(1)
        # Near the horizon the card takes a view as one at it.
        assert relative(np.array(one).reshape(-1, 3)[facing], np.array(other).reshape(-1, 3)[facing]) < 0.02


def test_a_reference_is_compared_at_vertices(page: Any) -> None:
    """Beside it the page's own texture is that of the vertices too: what differs is no finer texture."""
    assert statistics(page)["error"] < 0.05
    change(page, "light-shown", show="difference", range=0.5)
    found = shown(page, "(homofact.view.stage.draw(homofact.view, false), homofact.view.stage.pixels())")
    ground = found[0, 0]
    assert (np.abs(found - ground).max(-1) > 60).mean() < 0.03


def test_large_textures_are_made_smaller_for_the_page(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(build, "MOST_TEXELS", 4)
    rows = np.random.default_rng(0).random((9, 2, 3)).astype(np.float32) + 0.5
    packed = build._tint(SurfaceTint(rows, np.array([[-3.0, 0.5], [-2.5, 7.0]])), 3)
    assert (packed["height"], packed["width"], packed["terms"]) == (4, 2, 3)
    assert packed["texels"]["shape"] == [4, 2, 3]
    assert max(packed["scale"]) == pytest.approx(rows[:8].reshape(4, 2, 2, 3).mean(1).max())
