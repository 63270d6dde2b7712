"""Separate lobes on the page of a relit scene: their tables, the sky's cells, the sum, the picture."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import relit_lobes
import torch
from browser import browser, complaints, headless
from relit_lobes import SIZE
from relit_page import ANGLE, SMALL, change, colours_of, eye_of, page_colours, seen_pixels, shrink, statistics
from relit_scene import CAMERA, sky_picture
from unpacked import unpack, written

from homofact.relighting import cube
from homofact.relighting.errors import relative
from homofact.relighting.lobe_light import LightCells
from homofact.relighting.page import coarse
from homofact.relighting.page.build import PageObject, PageReference, write_page
from homofact.rendering.environment import read_environment
from homofact.rendering.light import EnvironmentMap
from homofact.rendering.sphere import SphereImage
from homofact.rendering.tonemap import automatic_exposure, encode_srgb

SKY = Path(__file__).parents[2] / "data_synthetic" / "sky.hdr"
APART = (0, 1)


def lobe_of(given: PageObject, radiance: np.ndarray, eye: Any) -> np.ndarray:
    """What the library sums of an object's lobe (V, 3)."""
    if given.lobe is None:
        return np.zeros((len(given.mesh.positions), 3), np.float32)
    made = given.transport
    return given.lobe.at_vertices(made.positions, made.frames, eye, given.lobe.cells(radiance))


def all_of(given: PageObject, radiance: np.ndarray, eye: Any) -> np.ndarray:
    """What the library shades with the lobe (V, 3)."""
    return colours_of(given, radiance, eye, given.basis.factors.terms) + lobe_of(given, radiance, eye)


def page_lobe(driver: Any, number: int) -> np.ndarray:
    """The lobe's light (V, 3) as the page's processor sums it."""
    found = driver.execute_script(
        "const v = homofact.view;"
        "return Array.from(homofact.lobeRadiance(v.objects[arguments[0]], v.orbit.eye, v.cells))",
        number,
    )
    return np.array(found).reshape(-1, 3)


def check_lobes(driver: Any, radiance: np.ndarray) -> None:
    for number in APART:
        expected = lobe_of(relit_lobes.scene().objects[number], radiance, eye_of(driver))
        assert expected.any(1).sum() > 20
        found = page_lobe(driver, number)
        # A cell on the verge of being divided may be divided in one of the two, which have different precisions: at few
        # vertices, and by the difference between a cell and its parts.
        apart = np.linalg.norm(found - expected, axis=1) > 5e-3 * np.linalg.norm(expected, axis=1).max()
        assert apart.sum() <= 2
        assert relative(found[~apart], expected[~apart]) < 1e-3
        assert np.allclose(found[apart], expected[apart], rtol=0.05)


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page, with a reference that has the lobes."""
    given, path = relit_lobes.scene(), tmp_path_factory.mktemp("lobes") / "lobes.html"
    reference = PageReference([all_of(each, given.skies[0].cube, CAMERA.eye) for each in given.objects])
    with pytest.MonkeyPatch.context() as patch:
        # The knot has few triangles: it gets a coarse form all the same.
        patch.setattr(coarse, "FEW", 400)
        write_page(path, given.objects, given.skies, {}, reference, camera=CAMERA)
    return path


@pytest.fixture(scope="module")
def opened(file: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    with browser(size=SMALL) as driver:
        headless.open_page(driver, file)
        # What is drawn at rest at each pixel has tests of its own.
        driver.execute_script("homofact.view.highlights.wanted = false; homofact.view.highlights.stop()")
        shrink(driver)
        yield driver
        assert complaints(driver) == []


@pytest.fixture
def lobes(opened: Any) -> Any:
    """The page as it began."""
    opened.execute_script(
        "const v = homofact.view; v.orbit.reset();"
        "Object.assign(v.state, {sky: 0, turn: 0, interpolation: 'vertex', stops: 0, show: 'picture'});"
        "v.lightBudget = 1e6; v.changed('light');"
    )
    headless.settled(opened)
    return opened


def test_tables_and_sight_are_in_the_page(file: Path) -> None:
    for packed, each in zip(written(file)["objects"], relit_lobes.scene().objects, strict=True):
        if each.lobe is None:
            assert packed["lobe"] is None
            assert packed["bytes"] == each.transport.nbytes
            continue
        assert packed["bytes"] == each.transport.nbytes + each.lobe.nbytes
        own, table = packed["lobe"], each.lobe.table
        assert (own["width"], own["period"], own["turns"]) == (table.width, table.period, table.turns)
        assert (own["levels"], own["turns"], own["along"], own["around"]) == table.values.shape[:4]
        values = unpack(own["values"]["values"]).astype(float) * own["values"]["scale"]
        size = np.abs(table.values)
        assert (np.abs(values - table.values) <= 2.0**-10 * size + 1e-9 * size.max()).all()
        words = unpack(own["sight"])
        assert words.dtype == np.uint8
        assert np.array_equal(words.view("<u8"), each.lobe.sight.plain)


@pytest.mark.slow
def test_they_are_the_same_in_the_browser(lobes: Any) -> None:
    for number in APART:
        given = relit_lobes.scene().objects[number].lobe
        assert given is not None
        values, words = lobes.execute_script(
            "const { values, sight } = homofact.view.objects[arguments[0]].lobe;"
            "return [Array.from(values.filter((_, k) => k % 97 === 0)), Array.from(sight)]",
            number,
        )
        assert relative(np.array(values), given.table.values.reshape(-1)[::97]) < 1e-3
        bits = np.array(words, np.uint32).reshape(len(given.sight.plain), -1).view(np.uint8)
        assert np.array_equal(bits, given.sight.plain.astype("<u8").view(np.uint8))


@pytest.mark.slow
@pytest.mark.parametrize("size", cube.SIZES)
def test_cells_are_the_library_s(lobes: Any, size: int) -> None:
    radiance = cube.environment_cube(EnvironmentMap(torch.from_numpy(sky_picture(4))), size).astype(np.float32)
    found, starts = lobes.execute_script(
        "const { values, starts } = homofact.lightCells(Float32Array.from(arguments[0]), arguments[1]);"
        "return [Array.from(values), starts]",
        radiance.reshape(-1).tolist(),
        size,
    )
    expected = LightCells.of(radiance)
    cells = np.array(found).reshape(-1, 8)
    assert starts == expected.starts.tolist()
    assert np.abs(cells[:, :4] - expected.places).max() < 1e-6
    assert (expected.places[:, 3] < 0).any()
    assert np.array_equal(cells[:, 3] < 0, expected.places[:, 3] < 0)
    assert cells[:, 4:7] == pytest.approx(expected.light, rel=1e-5)


@pytest.mark.slow
def test_the_processor_s_sum_is_the_library_s(lobes: Any) -> None:
    check_lobes(lobes, relit_lobes.scene().skies[0].cube)
    for across, up in ((60, 20), (150, -30)):
        lobes.execute_script("homofact.view.orbit.turn(...arguments); homofact.changed('moving')", across, up)
        headless.settled(lobes)
        check_lobes(lobes, relit_lobes.scene().skies[0].cube)


@pytest.mark.slow
def test_another_sky_a_turned_one_and_a_file_light_the_lobes(lobes: Any) -> None:
    sky = relit_lobes.scene().skies[1]
    change(lobes, sky=1)
    check_lobes(lobes, sky.cube)
    change(lobes, turn=ANGLE)
    check_lobes(lobes, cube.environment_cube(sky.environment(math.radians(ANGLE)), SIZE))
    lobes.execute_script(
        "homofact.state.turn = 0; homofact.view.addSky(Uint8Array.from(arguments[0]), 'sky.hdr')",
        list(SKY.read_bytes()),
    )
    headless.settled(lobes)
    check_lobes(lobes, cube.environment_cube(read_environment(SKY), SIZE))


@pytest.mark.slow
def test_lobes_have_all_of_a_new_light_before_the_terms_do(lobes: Any) -> None:
    pending = lobes.execute_script(
        "const v = homofact.view; v.lightBudget = 0; v.state.sky = 1; v.changed('light'); v.frame(0);"
        "return v.relit.pending"
    )
    assert pending > 0
    lobes.execute_script("homofact.view.turner.forget()")
    check_lobes(lobes, relit_lobes.scene().skies[1].cube)
    lobes.execute_script("homofact.view.lightBudget = 1e6")
    headless.settled(lobes)


@pytest.mark.slow
def test_the_card_s_sum_is_the_processor_s(lobes: Any) -> None:
    for number, given in enumerate(relit_lobes.scene().objects):
        processor, card = page_colours(lobes, number)
        facing = processor.any(1)
        assert relative(card[facing], processor[facing]) < 1e-2
        expected = all_of(given, relit_lobes.scene().skies[0].cube, CAMERA.eye)
        assert relative(processor, expected) < 1e-2


@pytest.mark.slow
def test_the_lobe_alone_is_at_vertices_where_pixels_have_the_terms(lobes: Any) -> None:
    change(lobes, "picture", interpolation="pixel")
    for number in APART:
        card, expected = page_colours(lobes, number)[1], page_lobe(lobes, number)
        facing = expected.any(1)
        assert relative(card[facing], expected[facing]) < 1e-2


@pytest.mark.slow
@pytest.mark.parametrize("interpolation", ["vertex", "pixel"])
def test_the_vertices_of_the_coarse_picture_have_the_lobe_of_all(lobes: Any, interpolation: str) -> None:
    change(lobes, "picture", interpolation=interpolation)
    whole, few, triangles = lobes.execute_script(
        "const v = homofact.view, o = v.stage.objects[0]; v.stage.draw(v, false, false);"
        "const all = Array.from(o.read()); v.stage.draw(v, false, true);"
        "return [all, Array.from(o.read(true)), Array.from(o.object.coarse)]"
    )
    _, first = np.unique(triangles, return_index=True)
    chosen = np.array(triangles)[np.sort(first)]
    assert 20 < len(chosen) < len(whole) / 3
    assert np.array_equal(np.array(few).reshape(-1, 3), np.array(whole).reshape(-1, 3)[chosen])


@pytest.mark.slow
@pytest.mark.parametrize("interpolation", ["vertex", "pixel"])
def test_pixels_at_vertices_have_the_lobes(lobes: Any, interpolation: str) -> None:
    change(lobes, "light-shown", interpolation=interpolation, curve="srgb", stops=-1)
    given = relit_lobes.scene()
    which, at, picture = seen_pixels(lobes, given.objects, given.occluder)
    assert len(which) > 60
    found = picture[at[:, 0], at[:, 1]]
    apart = []
    for shaded in (all_of, lambda each, *how: all_of(each, *how) - lobe_of(each, *how)):
        colours = np.concatenate([shaded(each, given.skies[0].cube, CAMERA.eye) for each in given.objects])
        light = np.maximum(colours[which] * 2 ** lobes.execute_script("return homofact.view.stops - 1"), 0)
        apart.append(np.abs(found - encode_srgb(torch.from_numpy(light)).numpy() * 255).max(1))
    on = which < sum(len(given.objects[number].mesh.positions) for number in APART)
    # A pixel's centre lies up to half a pixel from its vertex, and the objects are coarse.
    assert np.median(apart[0][on]) < 6
    assert np.median(apart[1][on]) > 12


@pytest.mark.slow
def test_the_figures_have_the_lobes(lobes: Any) -> None:
    assert statistics(lobes)["error"] < 2e-3
    given = relit_lobes.scene()
    colours = np.concatenate([all_of(each, given.skies[0].cube, CAMERA.eye) for each in given.objects])
    # The exposure where a card draws no floats: by vertices that shine.
    script = "const m = homofact.view.stage.meter, f = m.frame; m.frame = null; const s = m.stops(homofact.view);"
    stops = lobes.execute_script(f"{script} m.frame = f; return s")
    shining = torch.from_numpy(colours[(colours != 0).any(1)][None])
    exposure = automatic_exposure(SphereImage(shining, torch.ones(shining.shape[:2])))
    assert stops == pytest.approx(math.log2(exposure), abs=5e-3)
    below = np.maximum(-colours, 0).sum() / np.abs(colours).sum()
    assert statistics(lobes)["below"] == pytest.approx(below, rel=1e-2, abs=1e-6)


@pytest.mark.slow
def test_only_an_object_with_a_lobe_has_its_code(lobes: Any) -> None:
    lobes.execute_script("for (const each of homofact.view.stage.objects) each.programs.clear()")
    for interpolation in ("vertex", "pixel"):
        change(lobes, "picture", interpolation=interpolation)
    texts = lobes.execute_script(
        "const { gl, objects } = homofact.view.stage;"
        "return objects.map((o) => [...o.programs].map(([key, { program }]) => "
        "[key, gl.getAttachedShaders(program).map((s) => gl.getShaderSource(s)).join()]))"
    )
    for number, programs in enumerate(texts):
        has = number in APART
        assert {key for key, _ in programs} == (
            {"SHADES", "SHADES,ALONE", "COLOURED", "BY_PIXEL,COLOURED"} if has else {"SHADES", "COLOURED", "BY_PIXEL"}
        )
        for key, text in programs:
            assert ("u_sight" in text) == (has and key.startswith("SHADES"))


@pytest.mark.slow
def test_a_page_without_lobes_has_no_cells(page: Any) -> None:
    assert page.execute_script("return homofact.view.stage.cells") is None
    change(page, turn=ANGLE)
    assert page.execute_script("return homofact.view.cells === undefined") is True
