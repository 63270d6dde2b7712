"""The picture on the page of a relit scene: its pixels, the sky behind, light below zero, the reference beside it."""

import math
from typing import Any

import numpy as np
import pytest
import relit_scene
import torch
from browser import headless
from relit_page import ANGLE, change, colours_of, seen_pixels, slide, statistics, words
from relit_scene import CAMERA

from homofact.relighting.errors import relative
from homofact.relighting.page.build import PageReference
from homofact.rendering.tonemap import encode_srgb


@pytest.mark.parametrize("interpolation", ["vertex", "pixel"])
@pytest.mark.parametrize("curve", ["filmic", "srgb"])
def test_pixels_at_vertices_are_the_library_s_colours(page: Any, interpolation: str, curve: str) -> None:
    change(page, "light-shown", interpolation=interpolation, curve=curve, stops=-0.5)
    given = relit_scene.scene()
    which, at, picture = seen_pixels(page, given.objects)
    assert len(which) > 60
    colours = np.concatenate(
        [colours_of(o, given.skies[0].cube, CAMERA.eye, o.basis.factors.terms) for o in given.objects]
    )
    x = np.maximum(colours[which] * 2 ** page.execute_script("return homofact.view.stops - 0.5"), 0)
    x = x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14) if curve == "filmic" else x
    expected = encode_srgb(torch.from_numpy(x)).numpy() * 255
    apart = np.abs(picture[at[:, 0], at[:, 1]] - expected).max(1)
    # A pixel's centre lies up to half a pixel from its vertex, and the knot is coarse.
    assert np.median(apart) < 4
    assert np.quantile(apart, 0.9) < 16


@pytest.mark.slow
@pytest.mark.parametrize("turn", [0.0, ANGLE])
def test_the_sky_behind_is_the_light_as_it_is_turned(page: Any, turn: float) -> None:
    page.execute_script("homofact.view.orbit.turn(70, -16)")
    change(page, turn=turn)
    picture = seen_pixels(page, relit_scene.scene().objects)[2]
    height, width, _ = picture.shape
    right, up, forward = (np.array(axis) for axis in page.execute_script("return homofact.view.orbit.axes"))
    half = math.tan(math.radians(CAMERA.field / 2))
    rows, columns = (each.reshape(-1) for each in np.mgrid[2:height:16, 4:20])
    x, y = (2 * (columns + 0.5) / width - 1) * half * width / height, (2 * (rows + 0.5) / height - 1) * half
    w = forward + x[:, None] * right + y[:, None] * up
    w /= np.linalg.norm(w, axis=1, keepdims=True)
    # Above the ground's end.
    above = w[:, 1] > 0.03
    assert above.sum() > 50
    light = relit_scene.scene().skies[0].environment(math.radians(turn))
    radiance = light.look_up(torch.from_numpy(w[above]))[0].numpy()
    x = radiance * 2 ** page.execute_script("return homofact.view.stops")
    expected = encode_srgb(torch.from_numpy(x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14))).numpy() * 255
    # Where the sky is seen it is smooth; its sun is not here, and nothing else may be.
    assert np.median(np.abs(picture[rows[above], columns[above]] - expected)) < 3


@pytest.mark.slow
def test_light_below_zero_is_signalled_and_its_share_said(page: Any) -> None:
    change(page, "picture", stops=3)
    plain = seen_pixels(page, relit_scene.scene().objects)[2]
    change(page, "picture", signal=True)
    marked = seen_pixels(page, relit_scene.scene().objects)[2]
    magenta = (marked == (255, 0, 217)).all(-1)
    assert magenta.sum() > 30
    assert (plain[magenta].min(1) == 0).all()
    assert np.array_equal(plain[~magenta], marked[~magenta])
    light = relit_scene.scene().skies[0].cube
    shown = [colours_of(o, light, CAMERA.eye, o.basis.factors.terms) for o in relit_scene.scene().objects]
    below = sum(np.maximum(-each, 0).sum() for each in shown) / sum(np.abs(each).sum() for each in shown)
    assert statistics(page)["below"] == pytest.approx(below, rel=1e-2)


@pytest.mark.slow
def test_the_error_against_the_reference(page: Any, reference: PageReference) -> None:
    given = relit_scene.scene()

    def expected(terms: int) -> float:
        shown = [
            colours_of(o, given.skies[0].cube, CAMERA.eye, min(terms, o.basis.factors.terms)) for o in given.objects
        ]
        seen = [~np.isnan(each[:, 0]) & own.any(1) for each, own in zip(reference.colours, shown, strict=True)]
        pairs = [(own[s], each[s]) for own, each, s in zip(shown, reference.colours, seen, strict=True)]
        return relative(np.concatenate([a for a, _ in pairs]), np.concatenate([b for _, b in pairs]))

    assert statistics(page)["error"] == pytest.approx(expected(3), rel=5e-3)
    assert words(page, "error") == "9.1%"
    assert "(knot 9.1%, ground 9.1%)" in words(page, "error-words")
    slide(page, "terms", 1)
    assert statistics(page)["error"] == pytest.approx(expected(1), rel=5e-3)
    page.execute_script("homofact.view.orbit.turn(5, 0); homofact.changed('moving')")
    headless.settled(page)
    assert words(page, "error") == "–"
    assert words(page, "error-words") == "The reference holds only for one, not turned, seen from the first camera."
    assert page.execute_script("return document.querySelector('#show [data-value=split]').disabled") is True
    page.execute_script("document.getElementById('go-reference').click()")
    headless.settled(page)
    assert words(page, "error") != "–"
    change(page, turn=10)
    assert statistics(page)["error"] is None


@pytest.mark.slow
def test_the_reference_beside_the_picture(page: Any) -> None:
    """A reference that is brighter by a tenth: the left of the split and all of the reference show it."""
    objects = relit_scene.scene().objects
    change(page, "picture", stops=-1)
    which, at, own = seen_pixels(page, objects)
    kept = np.concatenate([np.arange(n := len(o.mesh.positions)) >= n // 7 for o in objects])[which]
    at = at[kept]
    shown = {}
    for show in ("split", "reference", "difference"):
        change(page, "picture", show=show)
        shown[show] = seen_pixels(page, objects)[2]
    left, right = at[:, 1] + 1 < own.shape[1] / 2, at[:, 1] > own.shape[1] / 2
    pixels = {name: picture[at[:, 0], at[:, 1]] for name, picture in {"own": own, **shown}.items()}
    brighter = pixels["reference"].sum(1) > pixels["own"].sum(1)
    # Equal where a corner of the triangle has no reference.
    assert brighter.mean() > 0.5
    assert (pixels["reference"] >= pixels["own"]).all()
    assert np.array_equal(pixels["split"][left], pixels["reference"][left])
    assert np.array_equal(pixels["split"][right], pixels["own"][right])
    assert words(page, "scale").startswith("luminance, |this page − reference|0510% of white")
    # The sky is no part of a difference; where it is seen the ramp's first colour stands.
    assert (shown["difference"][-1, 0] == (0x15, 0x16, 0x1A)).all()


@pytest.mark.slow
def test_a_moving_picture_is_drawn_of_fewer_triangles_and_the_one_at_rest_of_all(page: Any) -> None:
    page.execute_script(
        "const v = homofact.view, draw = v.stage.draw; window.drawn = [];"
        "v.stage.draw = (view, ...how) => { drawn.push(how); draw.call(v.stage, view, ...how); };"
        "v.level = 3; v.last = null; v.orbit.turn(3, 0); v.changed('moving');"
    )
    headless.settled(page)
    drawn = page.execute_script("delete homofact.view.stage.draw; return drawn")
    assert drawn[0] == [False, True]
    assert drawn[-1] == [True, False]


@pytest.mark.slow
def test_the_vertices_of_the_coarse_picture_shine_as_all_do(page: Any) -> None:
    whole_, coarse, triangles = page.execute_script(
        "const v = homofact.view, o = v.stage.objects[0]; o.shade(v); const all = Array.from(o.read());"
        "o.shade(v, true); return [all, Array.from(o.read(true)), Array.from(o.object.coarse)]"
    )
    _, first = np.unique(triangles, return_index=True)
    chosen = np.array(triangles)[np.sort(first)]
    assert len(triangles) // 3 <= 0.25 * len(relit_scene.scene().objects[0].mesh.triangles) + 2
    assert np.array_equal(np.array(coarse).reshape(-1, 3), np.array(whole_).reshape(-1, 3)[chosen])
    assert page.execute_script("return homofact.view.stage.objects[1].coarse") is None


@pytest.mark.slow
@pytest.mark.parametrize("state", [{}, {"interpolation": "pixel"}, {"show": "reference"}])
def test_the_coarse_picture_is_nearly_the_whole_one(page: Any, state: dict[str, str]) -> None:
    change(page, "picture", **state)
    whole_, coarse = page.execute_script(
        "const v = homofact.view; v.fit(1); return [false, true].map((coarse) => {"
        " v.stage.draw(v, false, coarse); return Array.from(v.stage.pixels()); })"
    )
    apart = np.abs(np.array(whole_, float) - np.array(coarse, float))
    # The knot of 768 triangles is an angular one with a quarter of them; sky and ground stay as they are.
    assert 0.5 < apart.mean() < 12
    assert np.median(apart) <= 1
