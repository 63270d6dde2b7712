"""Base-colour textures on the page of a relit scene: at vertices on processor and card, at pixels, in comparisons."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from relit_page import (
    DAY,
    change,
    library_picture,
    relit,
    relit_page,
    shown_picture,
    shrink,
    statistics,
    vertex_light,
    with_own_light,
)
from textured import written

from homofact.relighting.errors import relative
from homofact.relighting.page import build
from homofact.relighting.result import RelightResult
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


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> RelightResult:
    folder = tmp_path_factory.mktemp("textures")
    written(folder / "metal.glb", 1.0, 0.5)
    written(folder / "matt.glb", 0.0, 1.0)
    return with_own_light(relit(folder, SCENE))


@pytest.fixture(scope="module")
def opened(scene: RelightResult, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    with relit_page(tmp_path_factory.mktemp("page"), scene, (24, 18)) as driver:
        yield driver


@pytest.fixture
def page(opened: Any) -> Any:
    """The page as it began, its picture tiny; it has settled when the test has changed what it looks at."""
    opened.execute_script(
        "Object.assign(homofact.state, {turn: 0, suns: true, sky: 0, interpolation: 'vertex', show: 'picture'});"
        "homofact.changed('light'); homofact.changed('light-shown')"
    )
    return opened


@pytest.mark.slow
@pytest.mark.parametrize(("interpolation", "suns"), [("vertex", True), ("pixel", False), ("pixel", True)])
def test_pixels_have_the_colours_of_the_textures(
    page: Any, scene: RelightResult, interpolation: str, suns: bool
) -> None:
    shrink(page, 140, 105)
    change(page, suns=suns, interpolation=interpolation)
    found = shown_picture(page)
    size = (found.shape[1], found.shape[0])
    wanted, cover = library_picture(page, scene, scene.objects, DAY, size, suns)
    apart = np.abs(found - wanted).max(-1)[cover]
    assert len(apart) > 6_500
    # The separate lobe is at vertices in this picture, and where colours meet the texture has smaller copies.
    assert np.median(apart) < 2.5
    assert (apart > 25).mean() < 0.06
    # With the balls exchanged nothing fits.
    assert np.abs(found - wanted[:, ::-1]).max(-1)[cover & cover[:, ::-1]].mean() > 20


def test_vertices_have_them_on_processor_and_card(page: Any, scene: RelightResult) -> None:
    for suns in (True, False):
        change(page, "light-shown", suns=suns)
        found = vertex_light(page)
        wanted = scene.shade(DAY, scene.cameras[0].eye, suns)
        for one, other in zip(found, wanted, strict=True):
            assert relative(one, other) < 6e-3
    card = page.execute_script(
        "return homofact.view.stage.objects.map((o) => { o.shade(homofact.view); return Array.from(o.read()); })"
    )
    for one, other, each in zip(card, found, scene.objects, strict=True):
        towards = np.array(scene.cameras[0].eye) - each.mesh.positions
        cosines = (towards * each.mesh.normals).sum(1) / np.linalg.norm(towards, axis=1)
        # Below it the card takes a view as one at the horizon.
        facing = other.any(1) & (cosines > 0.01)
        assert facing.sum() > 100
        assert relative(np.array(one).reshape(-1, 3)[facing], other[facing]) < 1e-3


@pytest.mark.slow
def test_a_reference_is_compared_at_vertices(page: Any) -> None:
    """Beside it the page's own texture is that of the vertices too: what differs is no finer texture."""
    shrink(page, 140, 105)
    assert statistics(page)["error"] < 0.05
    change(page, "light-shown", show="difference", range=0.5)
    found = shown_picture(page, "(homofact.view.stage.draw(homofact.view, false), homofact.view.stage.pixels())")
    ground = found[0, 0]
    assert (np.abs(found - ground).max(-1) > 60).mean() < 0.03


def test_large_textures_are_made_smaller_for_the_page(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(build, "MOST_TEXELS", 4)
    rows = np.random.default_rng(0).random((9, 2, 3)).astype(np.float32) + 0.5
    packed = build._tint(SurfaceTint(rows, np.array([[-3.0, 0.5], [-2.5, 7.0]])), 3)
    assert (packed["height"], packed["width"], packed["terms"]) == (4, 2, 3)
    assert packed["texels"]["shape"] == [4, 2, 3]
    assert max(packed["scale"]) == pytest.approx(rows[:8].reshape(4, 2, 2, 3).mean(1).max())
