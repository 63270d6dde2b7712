"""The page of a relit scene in a headless Chromium: its sums, views and pixels are the library's."""

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import relit_scene
import torch
from browser import browser, complaints, headless, requests
from relit_scene import CAMERA, SIZE, largest, tuples, whole

from homofact.render.light import EnvironmentMap
from homofact.render.tonemap import encode_srgb
from homofact.scene.transport import cube
from homofact.scene.transport.ledger import relative
from homofact.scene.transport.page.build import PageObject, PageReference, write_page
from homofact.scene.transport.relight import Relit, light_coefficients, shaded

ANGLE = 37.0


@pytest.fixture(scope="module")
def chromium(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    with browser(tmp_path_factory.mktemp("chromium")) as driver:
        yield driver


def colours_of(given: PageObject, light: Any, eye: Any, terms: int = 3, kept: int | None = None) -> np.ndarray:
    """What the library shades (V, 3)."""
    transport = replace(given.basis, positions=given.transport.positions, frames=given.transport.frames)
    first = transport.factors.first(terms)
    return shaded(replace(transport, factors=first), tuples(given, light, kept)[:, :terms], eye)


@pytest.fixture(scope="module")
def reference() -> PageReference:
    """The library's own colours, a tenth too bright, with none for the first seventh of the vertices."""
    given = relit_scene.scene()
    found = [1.1 * colours_of(each, given.skies[0].cube, CAMERA.eye).astype(float) for each in given.objects]
    for each in found:
        each[: len(each) // 7] = np.nan
    return PageReference(found)


@pytest.fixture(scope="module")
def page(chromium: Any, tmp_path_factory: pytest.TempPathFactory, reference: PageReference) -> Iterator[Any]:
    """The page, opened once; it must stay silent and ask for nothing."""
    given = relit_scene.scene()
    path = tmp_path_factory.mktemp("page") / "relit.html"
    write_page(path, given.objects, given.skies, {"Knot": {"vertices": 384}}, reference, title="A test", camera=CAMERA)
    complaints(chromium)
    requests(chromium)
    headless.open_page(chromium, path)
    shrink(chromium)
    yield chromium
    assert complaints(chromium) == []
    assert set(requests(chromium)) <= {path.as_uri()}


@pytest.fixture(autouse=True)
def fresh(request: pytest.FixtureRequest) -> None:
    """The page as it began, for each test that uses it."""
    if "page" in request.fixturenames:
        driver = request.getfixturevalue("page")
        driver.execute_script(
            "const v = homofact.view; v.orbit.reset(); v.skies.length = 2; v.controls.skies();"
            "Object.assign(v.state, {sky: 0, turn: 0, terms: v.mostTerms, kept: v.mostKept, interpolation: 'vertex',"
            " signal: false, stops: 0, curve: 'filmic', show: 'picture', split: 0.5, range: 0.1, pieces: true,"
            " turning: false}); v.lightBudget = 1e6; v.changed('kept'); v.changed('light');"
        )
        headless.settled(driver)


def shrink(driver: Any) -> None:
    """A picture that software draws in no time."""
    driver.execute_script(
        "const p = document.getElementById('picture'); p.style.width = '420px'; p.style.height = '320px';"
        "homofact.changed('picture');"
    )
    headless.settled(driver)


def change(driver: Any, what: str = "light", **state: Any) -> None:
    driver.execute_script("Object.assign(homofact.state, arguments[0]); homofact.changed(arguments[1])", state, what)
    headless.settled(driver)


def page_tuples(driver: Any, number: int) -> np.ndarray:
    """(V, K, 3) of the page."""
    given = relit_scene.scene().objects[number]
    values = driver.execute_script(f"return Array.from(homofact.view.objects[{number}].tuples)")
    terms = given.basis.factors.terms
    return np.array(values).reshape(len(given.mesh.positions), -1)[:, : 3 * terms].reshape(-1, terms, 3)


def page_colours(driver: Any, number: int) -> tuple[np.ndarray, np.ndarray]:
    """(V, 3) as the page's processor shades, and as its graphics card does."""
    found = driver.execute_script(
        "const v = homofact.view, o = v.stage.objects[arguments[0]]; o.shade(v);"
        "return [Array.from(v.shade()[arguments[0]]), Array.from(o.read())]",
        number,
    )
    processor, card = (np.array(each).reshape(-1, 3) for each in found)
    return processor, card


def eye_of(driver: Any) -> np.ndarray:
    return np.array(driver.execute_script("return homofact.view.orbit.eye"))


def check_colours(driver: Any, light: Any, terms: int = 3, kept: int | None = None) -> None:
    """The page's colours are the library's; positions and frames are rounded in it."""
    for number, given in enumerate(relit_scene.scene().objects):
        expected = colours_of(given, light, eye_of(driver), min(terms, given.basis.factors.terms), kept)
        facing = np.flatnonzero(expected.any(1))
        assert len(facing) > 20
        for found in page_colours(driver, number):
            assert off(found[facing], expected[facing]) < 2e-3


def off(found: np.ndarray, expected: np.ndarray) -> float:
    """The largest difference, as a part of the largest value."""
    return float(np.abs(found - expected).max() / np.abs(expected).max())


def check_tuples(driver: Any, light: Any, kept: int | None = None) -> None:
    for number, given in enumerate(relit_scene.scene().objects):
        expected = tuples(given, light, kept)
        assert off(page_tuples(driver, number), expected) < 2e-6


def test_light_and_view_are_the_library_s(page: Any) -> None:
    check_tuples(page, relit_scene.scene().skies[0].cube)
    check_colours(page, relit_scene.scene().skies[0].cube)


def test_another_sky_and_a_turned_one(page: Any) -> None:
    sky = relit_scene.scene().skies[1]
    change(page, sky=1)
    check_tuples(page, sky.cube)
    for angle in (ANGLE, -150.0):
        change(page, turn=angle)
        check_tuples(page, cube.environment_cube(sky.environment(math.radians(angle)), SIZE))
    # The light at once is the same as piece by piece.
    change(page, pieces=False, turn=ANGLE)
    check_tuples(page, cube.environment_cube(sky.environment(math.radians(ANGLE)), SIZE))


def test_a_coarse_sky_is_asked_at_points(page: Any) -> None:
    picture = relit_scene.sky_picture(3, rows=16).astype(np.float32)
    found = page.execute_script(
        "const picture = {values: Float32Array.from(arguments[0]), rows: 16, columns: 32};"
        "return Array.from(homofact.environmentCube(picture, 16, 0.4))",
        picture.reshape(-1).tolist(),
    )
    expected = cube.environment_cube(EnvironmentMap(torch.from_numpy(picture.astype(float)), 0.4), SIZE)
    assert off(np.array(found).reshape(expected.shape), expected) < 1e-6


def test_another_view(page: Any) -> None:
    for across, up in ((40, 12), (110, -22)):
        page.execute_script("homofact.view.orbit.turn(...arguments); homofact.changed('moving')", across, up)
        headless.settled(page)
        check_colours(page, relit_scene.scene().skies[0].cube)


def test_terms_and_coefficients_by_their_sliders(page: Any) -> None:
    light = relit_scene.scene().skies[0].cube
    for terms in (1, 2):
        slide(page, "terms", terms)
        check_colours(page, light, terms=terms)
    steps = page.execute_script("return homofact.view.keptSteps")
    place = next(k for k, step in enumerate(steps) if step >= 20)
    slide(page, "kept", place)
    check_tuples(page, light, steps[place])
    # More coefficients come back, and a change of light uses as many as are kept.
    slide(page, "kept", place + 2)
    change(page, sky=1)
    check_tuples(page, relit_scene.scene().skies[1].cube, steps[place + 2])


def slide(driver: Any, name: str, value: float) -> None:
    driver.execute_script(
        "const s = document.getElementById(arguments[0]); s.value = arguments[1]; s.dispatchEvent(new Event('input'))",
        name,
        value,
    )
    headless.settled(driver)


def test_a_change_in_pieces_is_the_library_s_at_every_step(page: Any) -> None:
    """On the ground, whose vectors are its own: Overbeck's order is the library's then."""
    given, skies = relit_scene.scene().objects[1], relit_scene.scene().skies
    relit = Relit(given.basis)
    relit.relight(skies[0].cube)
    relit.ask(skies[1].cube)
    page.execute_script(
        "const v = homofact.view; window.alone = new v.relit.constructor([v.objects[1]], v.relit.coefficients);"
        "alone.relight(v.skies[0].coefficients(0)); alone.ask(v.skies[1].coefficients(0));"
    )
    left, found = 1, np.zeros(0)
    while left:
        left = relit.step(64)
        pending, found = page.execute_script(
            "alone.step(64); const o = homofact.view.objects[1]; o.mix(); return [alone.pending, Array.from(o.tuples)]"
        )
        assert pending == left
        found = np.array(found).reshape(-1, 4)[:, :3]
        assert off(found, relit.tuples[:, 0]) < 2e-4
    assert off(found, tuples(given, skies[1].cube)[:, 0]) < 2e-6


def test_clusters_converge_in_pieces_to_the_exact_sum(page: Any) -> None:
    """The largest changes first: half of the error is gone after an eighth of the coefficients."""
    knot, sky = relit_scene.scene().objects[0], relit_scene.scene().skies[1]
    expected = tuples(knot, sky.cube)
    errors = [relative(page_tuples(page, 0), expected)]
    page.execute_script("homofact.view.relit.ask(homofact.view.skies[1].coefficients(0))")
    for _ in range(8):
        page.execute_script("homofact.view.relit.step(192); homofact.view.bring()")
        errors.append(relative(page_tuples(page, 0), expected))
    assert errors[1] < errors[0] / 2
    assert errors[-1] < 1e-6
    assert page.execute_script("return homofact.view.relit.pending") == 0


def test_pending_coefficients_are_counted_on_the_page(page: Any) -> None:
    # A machine that no budget suits: a chunk a frame, and the picture is exact in the end all the same.
    # What the line said is noted as it changes: a look now and then may miss all of it.
    counts = page.execute_async_script(
        "const done = arguments[0], counts = [], line = document.getElementById('status'), v = homofact.view;"
        "const note = () => {"
        " counts.push(line.textContent.split(' ')[0]);"
        " if (counts.length > 3 && !v.relit.pending && counts.at(-1) === '0') { watch.disconnect(); done(counts); } };"
        "const watch = new MutationObserver(note);"
        "watch.observe(line, {childList: true, characterData: true, subtree: true});"
        "v.lightBudget = 0; v.state.sky = 1; v.changed('light');"
    )
    assert counts[-1] == "0"
    assert any(int(each.replace(",", "")) > 100 for each in counts)
    headless.settled(page)
    check_tuples(page, relit_scene.scene().skies[1].cube)


def hdr(picture: np.ndarray) -> tuple[bytes, np.ndarray]:
    """A Radiance file of new run lengths with its decoded radiance."""
    exponent = np.ceil(np.log2(picture.max(-1)) + 1e-9).astype(int)
    mantissa = np.floor(picture / np.exp2(exponent)[..., None] * 256).astype(np.uint8)
    rows, columns, _ = picture.shape
    data = bytearray(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\nEXPOSURE=2\n\n" + f"-Y {rows} +X {columns}\n".encode())
    for row in range(rows):
        data += bytes((2, 2, columns >> 8, columns & 255))
        for component in (*mantissa[row].T, (exponent[row] + 128).astype(np.uint8)):
            # Half of a scanline as it is, the rest run by run.
            data += bytes((100, *component[:100]))
            for value in component[100:]:
                data += bytes((129, value))
    return bytes(data), mantissa * np.exp2(exponent - 8)[..., None] / 2


def drop(driver: Any, name: str, data: bytes) -> str:
    """Drop a file on the page; what is said beside the skies."""
    return driver.execute_async_script(
        "const [name, bytes, done] = arguments, transfer = new DataTransfer();"
        "transfer.items.add(new File([Uint8Array.from(bytes)], name));"
        "const note = document.getElementById('light-note'); note.textContent = '';"
        "document.dispatchEvent(new DragEvent('drop', {dataTransfer: transfer, bubbles: true, cancelable: true}));"
        "(function wait() { note.textContent ? done(note.textContent) : setTimeout(wait, 20); })();",
        name,
        list(data),
    )


def test_a_dropped_hdr_lights_the_scene(page: Any) -> None:
    data, radiance = hdr(relit_scene.sky_picture(5))
    light = EnvironmentMap(torch.from_numpy(radiance))
    assert drop(page, "new sky.hdr", data) == "new sky.hdr lights the scene."
    headless.settled(page)
    check_tuples(page, light)
    change(page, turn=ANGLE)
    check_tuples(page, light.turned(math.radians(ANGLE)))
    names = page.execute_script("return Array.from(document.querySelectorAll('#skies button'), b => b.innerText)")
    assert names == ["one", "two", "new sky", "Open .hdr …"]


@pytest.mark.parametrize(
    ("name", "damage", "said"),
    [
        ("a.hdr", lambda data: data[:-9], "a.hdr: it ends within scanline 63."),
        ("b.png", lambda data: b"\x89PNG" + data, "b.png: it does not start with #?RADIANCE."),
        ("c.hdr", lambda data: data.replace(b"-Y 64", b"+Y 64"), "c.hdr: its size is not given as -Y rows +X columns."),
        ("d.hdr", lambda data: data.replace(b"rgbe", b"xyze"), "d.hdr: its format is 32-bit_rle_xyze"),
        ("e.hdr", lambda data: data.replace(b"EXPOSURE=2", b"EXPOSURE=0"), "e.hdr: its EXPOSURE is not above 0."),
    ],
)
def test_a_bad_file_is_named_and_the_light_stays(page: Any, name: str, damage: Any, said: str) -> None:
    data, _ = hdr(relit_scene.sky_picture(5))
    assert drop(page, name, damage(data)).startswith(said)
    check_tuples(page, relit_scene.scene().skies[0].cube)


def test_flat_pixels_and_old_runs_are_read(page: Any) -> None:
    head = b"#?RADIANCE\n\n-Y 2 +X 4\n"
    pixels = bytes((10, 20, 30, 129, 1, 1, 1, 3, 40, 50, 60, 130, 1, 1, 1, 3))
    values = page.execute_script(
        "return Array.from(homofact.readHdr(Uint8Array.from(arguments[0]), 'x').values)", list(head + pixels)
    )
    expected = [10 / 128, 20 / 128, 30 / 128] * 4 + [40 / 64, 50 / 64, 60 / 64] * 4
    assert values == pytest.approx(expected)


def seen_pixels(driver: Any, given: tuple[PageObject, ...]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(which vertices of all the camera sees well, their (row from below, column), pixels (H, W, 3) 0 … 255)."""
    width, height, data = driver.execute_script(
        "const p = homofact.pixels(), c = homofact.view.stage.canvas; return [c.width, c.height, Array.from(p)]"
    )
    mesh, eye = whole(given), eye_of(driver)
    towards = eye - mesh.positions
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    occluder = relit_scene.scene().occluder
    seen = (towards * mesh.normals).sum(1) > 0.4
    seen &= ~occluder.blocked(mesh.positions + occluder.offset * 20 * mesh.normals, towards)
    # On the ground, where it is not fading yet.
    seen &= np.linalg.norm(mesh.positions[:, ::2], axis=1) < 1.4
    forward = np.array(CAMERA.target) - eye
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, (0, 1, 0))
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    relative_to = mesh.positions - eye
    scale = height / 2 / math.tan(math.radians(CAMERA.field / 2)) / (relative_to @ forward)
    columns, rows = width / 2 + scale * (relative_to @ right), height / 2 + scale * (relative_to @ up)
    seen &= (columns > 1) & (columns < width - 1) & (rows > 1) & (rows < height - 1)
    which = np.flatnonzero(seen)
    picture = np.array(data, float).reshape(height, width, 4)[..., :3]
    return which, np.stack((rows[which], columns[which]), 1).astype(int), picture


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


def statistics(driver: Any) -> dict[str, Any]:
    return driver.execute_script("return homofact.view.statistics()")


def words(driver: Any, place: str) -> str:
    """An element's text, after the page has had the time to read its figures."""
    return driver.execute_async_script(
        "const [id, done] = arguments; setTimeout(() => done(document.getElementById(id).textContent), 300)", place
    )


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


def press(driver: Any, keys: str, *, shift: bool = False) -> dict[str, Any]:
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.keys import Keys

    actions = ActionChains(driver)
    if shift:
        actions.key_down(Keys.SHIFT)
    actions.send_keys(keys)
    if shift:
        actions.key_up(Keys.SHIFT)
    actions.perform()
    return headless.settled(driver)


def test_keys_do_everything(page: Any) -> None:
    from selenium.webdriver.common.keys import Keys

    page.execute_script("document.getElementById('canvas').focus()")
    azimuth = "return homofact.view.orbit.azimuth"
    before = page.execute_script(azimuth)
    press(page, Keys.ARROW_RIGHT)
    assert page.execute_script(azimuth) - before == pytest.approx(5)
    press(page, "r")
    assert page.execute_script("return homofact.view.atReference") is True
    assert press(page, Keys.ARROW_LEFT, shift=True)["turn"] == -5
    assert press(page, "2")["sky"] == 1
    assert press(page, "l")["sky"] == 0
    press(page, "k")
    assert headless.settled(page)["terms"] == 2
    assert press(page, "K", shift=True)["terms"] == 3
    most = headless.settled(page)["kept"]
    assert press(page, "n")["kept"] < most
    assert press(page, "p")["interpolation"] == "pixel"
    assert press(page, "b")["signal"] is True
    assert press(page, "t")["curve"] == "srgb"
    assert press(page, "e")["stops"] == pytest.approx(-0.3)
    # The reference holds for the sky as it stands alone.
    assert press(page, "v")["show"] == "picture"
    change(page, turn=0)
    assert press(page, "v")["show"] == "split"
    assert press(page, "]")["split"] == pytest.approx(0.55)
    press(page, "?")
    assert page.execute_script("return document.getElementById('help').open") is True
    assert press(page, "b")["signal"] is True
    press(page, Keys.ESCAPE)
    page.execute_script("document.getElementById('turn').focus()")
    assert press(page, Keys.ARROW_RIGHT)["turn"] == 1
    names = (
        "return Array.from(document.querySelectorAll('button, input:not([type=file]), canvas[role]'), e => e.tabIndex)"
    )
    assert min(page.execute_script(names)) == 0


def test_space_lets_the_sky_turn_and_dragging_turns_camera_and_sky(page: Any) -> None:
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.keys import Keys

    page.execute_script("document.getElementById('canvas').focus()")
    ActionChains(page).send_keys(" ").perform()
    page.execute_async_script(
        "const done = arguments[0]; (function wait() { homofact.state.turn > 2 ? done() : setTimeout(wait, 30); })();"
    )
    assert page.execute_script("return document.getElementById('play-button').getAttribute('aria-pressed')") == "true"
    page.execute_script("document.getElementById('play-button').click()")
    headless.settled(page)
    turn = page.execute_script("return homofact.state.turn")
    check_tuples(page, cube.environment_cube(relit_scene.scene().skies[0].environment(math.radians(turn)), SIZE))
    canvas = page.find_element("id", "canvas")
    before = page.execute_script("return [homofact.view.orbit.azimuth, homofact.state.turn]")
    ActionChains(page).drag_and_drop_by_offset(canvas, 32, 0).perform()
    headless.settled(page)
    after = page.execute_script("return [homofact.view.orbit.azimuth, homofact.state.turn]")
    # The picture's height is 180°.
    assert after == pytest.approx([before[0] - 18, before[1]], abs=1)
    ActionChains(page).key_down(Keys.SHIFT).drag_and_drop_by_offset(canvas, 32, 0).key_up(Keys.SHIFT).perform()
    headless.settled(page)
    last = page.execute_script("return [homofact.view.orbit.azimuth, homofact.state.turn]")
    assert last == pytest.approx([after[0], after[1] + 18], abs=1)


def test_numbers_and_names_stand_on_the_page(page: Any) -> None:
    assert page.execute_script("return document.getElementById('numbers').innerText").split("\n")[1:] == [
        "Knot", "vertices\t384",
    ]  # fmt: skip
    assert words(page, "objects") == "knot, coloured lobes · ground, grey"
    assert page.title == "A test"


def test_a_page_without_a_reference_says_so(chromium: Any, page: Any, tmp_path: Path) -> None:
    given = relit_scene.plain(relit_scene.scene())
    write_page(tmp_path / "p.html", given.objects, given.skies, {}, title="t")
    chromium.switch_to.new_window("tab")
    try:
        headless.open_page(chromium, tmp_path / "p.html")
        headless.settled(chromium)
        assert words(chromium, "error-words") == "This page holds no reference."
        assert chromium.execute_script("return document.getElementById('show-field').hidden") is True
    finally:
        requests(chromium)
        chromium.close()
        chromium.switch_to.window(chromium.window_handles[0])


def trouble(driver: Any, page: Path) -> str:
    given = relit_scene.plain(relit_scene.scene())
    write_page(page, given.objects, given.skies, {})
    headless.open_page(driver, page)
    return driver.execute_script("return document.getElementById('trouble')?.innerText ?? ''")


def test_without_webgl_or_unpacking_the_page_says_so(tmp_path: Path) -> None:
    with browser(tmp_path, webgl=False) as driver:
        said = trouble(driver, tmp_path / "page.html")
        assert said.startswith("This page draws with WebGL 2, which is not available here.")
        assert driver.execute_script("return document.querySelectorAll('.actions button:not([hidden])').length") == 0


def test_without_unpacking_the_page_says_so(chromium: Any, page: Any, tmp_path: Path) -> None:
    chromium.switch_to.new_window("tab")
    script = {"source": "delete window.DecompressionStream"}
    found = chromium.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", script)
    try:
        said = trouble(chromium, tmp_path / "page.html")
    finally:
        chromium.execute_cdp_cmd("Page.removeScriptToEvaluateOnNewDocument", found)
        requests(chromium)
        complaints(chromium)
        chromium.close()
        chromium.switch_to.window(chromium.window_handles[0])
    assert said.startswith("This browser cannot unpack the page's data.")


def test_the_largest_numbers_are_the_largest() -> None:
    basis = relit_scene.scene().objects[1].basis
    kept = largest(basis, 5)
    assert (np.diff(kept.start) == np.minimum(np.diff(basis.start), 5)).all()
    light = light_coefficients(relit_scene.scene().skies[0].cube, SIZE)
    assert light.shape == (6 * SIZE * SIZE, 3)
    first = np.abs(basis.number[: basis.start[1]].astype(int))
    assert sorted(np.abs(kept.number[: kept.start[1]].astype(int))) == sorted(first)[-5:]
