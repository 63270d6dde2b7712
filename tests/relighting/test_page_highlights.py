"""The page of a relit scene at rest: separate lobes are summed at each pixel, strip by strip."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import relit_lobes
import torch
from browser import browser, complaints, headless
from relit_page import SMALL, change, colours_of, pixels_of
from relit_scene import CAMERA

from homofact.relighting.errors import relative
from homofact.relighting.lit import LitObject
from homofact.relighting.page.build import PageReference, write_page
from homofact.relighting.picture import surface_points
from homofact.rendering.tonemap import encode_srgb
from homofact.scene.cameras import Camera

pytestmark = pytest.mark.slow

WIDTH, HEIGHT = 80, 60
APART = (0, 1)


@pytest.fixture(scope="module")
def opened(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """A page with a small picture and a reference."""
    given, folder = relit_lobes.scene(), tmp_path_factory.mktemp("highlights")
    reference = PageReference([np.ones_like(each.mesh.positions) for each in given.objects])
    write_page(folder / "page.html", given.objects, given.skies, {}, reference, camera=CAMERA)
    with browser(size=SMALL) as driver:
        headless.open_page(driver, folder / "page.html")
        driver.execute_script(
            "const p = document.getElementById('picture'); p.style.width = arguments[0]; p.style.height = arguments[1];"
            "homofact.view.lightBudget = 1e6; homofact.changed('picture')",
            f"{WIDTH}px",
            f"{HEIGHT}px",
        )
        headless.settled(driver)
        yield driver
        assert complaints(driver) == []


@pytest.fixture
def still(opened: Any) -> Any:
    """The page as it began, in plain tones."""
    opened.execute_script("homofact.view.orbit.reset()")
    change(opened, "light-shown", interpolation="vertex", show="picture", curve="srgb", stops=-1)
    return opened


def shown(driver: Any) -> np.ndarray:
    """The picture (H, W, 3) 0 … 255 that stands, row 0 on top."""
    found = pixels_of(driver, "(homofact.view.stage.show(), homofact.view.stage.pixels())")[::-1]
    assert found.shape == (HEIGHT, WIDTH, 3)
    return found


def linear(pixels: np.ndarray) -> np.ndarray:
    """Light of sRGB 0 … 255."""
    levels = np.linspace(0, 1, 65536)
    return np.interp(pixels / 255, encode_srgb(torch.from_numpy(levels)).numpy(), levels)


def expected(number: int) -> tuple[np.ndarray, np.ndarray]:
    """(pixels (S, 2) that a triangle of an object fills, what the library says of their centres (S, 3))."""
    given = relit_lobes.scene()
    camera = Camera(CAMERA.eye, CAMERA.target, CAMERA.field, (WIDTH, HEIGHT))
    rays = np.concatenate((camera.rays(1), camera.rays(4)), 2)
    hits, shares = given.occluder.first(np.array(camera.eye)[None], rays.reshape(-1, 3))
    hits, shares = hits.reshape(rays.shape[:3]), shares.reshape(*rays.shape[:3], 3)
    first = sum(len(each.mesh.triangles) for each in given.objects[:number])
    each = given.objects[number]
    whole = (hits == hits[..., :1]).all(2) & (hits[..., 0] >= first) & (hits[..., 0] < first + len(each.mesh.triangles))
    # A corner that is seen from behind has no terms in the library, on the page those of the horizon.
    facing = ((np.array(camera.eye) - each.mesh.positions) * each.mesh.normals).sum(1) > 0.05
    whole[whole] = facing[each.mesh.triangles[hits[..., 0][whole] - first]].all(1)
    at = np.argwhere(whole)
    own = (at[:, 0], at[:, 1], np.zeros(len(at), int))
    points = surface_points(each.mesh, hits[own] - first, shares[own], -rays[own])
    terms = colours_of(each, given.skies[0].cube, CAMERA.eye, each.basis.factors.terms)
    assert each.lobe is not None
    lit = LitObject(each.basis, np.zeros(0), each.lobe, each.lobe.cells(given.skies[0].cube))
    return at, points.mixed(terms.astype(np.float64)) + lit.lobe_at(points)


@pytest.mark.parametrize("number", APART)
def test_pixels_at_rest_have_the_lobe_of_their_own(still: Any, number: int) -> None:
    at, light = expected(number)
    found = shown(still)[at[:, 0], at[:, 1]]
    light = light * 2 ** still.execute_script("return homofact.view.stops - 1")
    # Neither white nor so dark that 8 bits are few.
    fit = (found.max(1) < 250) & (found.min(1) > 20)
    assert fit.sum() > 40
    own = relative(linear(found[fit]), light[fit])
    assert own < 0.02
    still.execute_script("homofact.view.highlights.wanted = false")
    change(still, "picture")
    coarse = shown(still)[at[:, 0], at[:, 1]]
    still.execute_script("homofact.view.highlights.wanted = true")
    assert relative(linear(coarse[fit]), light[fit]) > 1.4 * own


def test_where_pixels_have_the_terms_they_have_the_lobe_too(still: Any) -> None:
    by_vertex = shown(still)
    change(still, "picture", interpolation="pixel")
    at, _ = expected(0)
    close = np.abs(shown(still) - by_vertex)[at[:, 0], at[:, 1]]
    # The terms differ, which are smooth; the meshes are coarse.
    assert np.median(close) < 8


def test_a_picture_that_moves_has_the_lobe_at_vertices_at_once(still: Any) -> None:
    before, after, found, again = still.execute_script(
        "const v = homofact.view, h = v.highlights; h.pace = 1e9; v.frame(0); const before = h.pending;"
        "const s = v.stage, draw = s.draw; let drawn;"
        "s.draw = (view, ...how) => { drawn = how; draw.call(s, view, ...how); };"
        "v.orbit.turn(5, 0); v.changed('moving'); v.frame(0); const after = h.pending; delete s.draw;"
        "const found = Array.from(s.pixels()); s.draw(v, ...drawn);"
        "return [before, after, found, Array.from(s.pixels())]"
    )
    assert (before, after) == (True, False)
    assert found == again
    still.execute_script("homofact.view.highlights.pace = 0.03")
    headless.settled(still)
    assert still.execute_script("return homofact.view.highlights.pending") is False


def test_strips_are_as_high_as_the_last_one_s_time_allows(still: Any) -> None:
    few, many = still.execute_script(
        "const h = homofact.view.highlights, pace = h.pace; h.from = 0; h.pace = 1e9; const few = h.strip();"
        "h.pace = 1e-9; const many = h.strip(); h.pace = pace; h.from = h.covered.length; return [few, many]"
    )
    assert few[0] > 0
    assert many[0] == HEIGHT
    covered = sum(len(expected(number)[0]) for number in APART)
    assert covered < many[1] < WIDTH * HEIGHT / 2


def test_beside_a_reference_the_lobe_stays_at_vertices(still: Any) -> None:
    still.execute_script(
        "const s = homofact.view.stage, draw = s.drawBetween; window.strips = 0;"
        "s.drawBetween = (...how) => { strips += 1; draw.call(s, ...how); }"
    )
    for show, drawn in (("split", False), ("difference", False), ("picture", True)):
        still.execute_script("window.strips = 0")
        change(still, "picture", show=show)
        assert still.execute_script("return strips > 0") is drawn
    still.execute_script("delete homofact.view.stage.drawBetween")


def test_only_an_object_with_a_lobe_has_such_programs(still: Any) -> None:
    for interpolation in ("vertex", "pixel"):
        change(still, "picture", interpolation=interpolation)
    keys = still.execute_script("return homofact.view.stage.objects.map((o) => [...o.programs.keys()])")
    for number, own in enumerate(keys):
        extra = {"SHADES,TERMS,CHOSEN", "COLOURED,BETWEEN", "BY_PIXEL,CHOSEN,BETWEEN"} if number in APART else set()
        assert {key for key in own if "BETWEEN" in key or "TERMS" in key} == extra
    assert still.execute_script("return homofact.view.stage.objects.map((o) => Boolean(o.apart))") == [
        number in APART for number in range(len(keys))
    ]


def test_the_page_says_how_much_of_the_highlights_is_refined_until_all_are(still: Any) -> None:
    place = "const place = document.getElementById('drawing');"
    assert still.execute_script(f"{place} return [place.hidden, place.textContent]") == [True, ""]
    # A card so slow that a frame has two rows.
    said = still.execute_async_script(
        f"{place} const done = arguments[0], v = homofact.view, h = v.highlights, said = [];"
        "const strip = h.strip; h.strip = () => { h.pace = 1e9; return strip.call(h); };"
        "v.changed('picture');"
        "(function look() { said.push(place.hidden ? '' : place.textContent);"
        " if (homofact.idle) { delete h.strip; h.pace = 0.03; done(said); } else requestAnimationFrame(look); })();"
    )
    shown = [words for words in said if words]
    assert len(shown) > 5
    shares = [int(words.removeprefix("Refining highlights … ").removesuffix("%")) for words in shown]
    assert shares == sorted(shares)
    assert shares[0] < 30
    assert 70 < shares[-1] <= 100
    assert said[-1] == ""
    # What moves is not refined.
    assert still.execute_script(
        f"{place} const v = homofact.view; v.highlights.pace = 1e9; v.frame(0); v.highlights.advance();"
        "const before = place.hidden; v.orbit.turn(5, 0); v.changed('moving'); v.frame(0);"
        "v.highlights.pace = 0.03; return [before, place.hidden]"
    ) == [False, True]
    headless.settled(still)
