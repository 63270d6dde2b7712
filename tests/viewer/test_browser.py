"""The page in a headless Chromium: its numbers and pixels are Python's, its keys work, its troubles are said.

WebGL runs in SwiftShader, in software. Shading languages leave acos to the implementation, and SwiftShader's is off by
up to 7e-5 radians: a program that used it would be seen here. All agree to float32.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from browser import browser, complaints, headless, requests
from shading_cases import CASES, SEPARABLE
from torch import Tensor

from homofact.brdf.analytic.lambert import Lambert
from homofact.brdf.analytic.phong import Phong
from homofact.brdf.materials import material
from homofact.factor.factorization import Factorization
from homofact.factor.quantize import rounded
from homofact.geometry.directions import draw_uniform
from homofact.meshes.mesh import Mesh
from homofact.render.light import DEFAULT_LIGHT, EnvironmentMap
from homofact.render.sphere import render_sphere
from homofact.render.tonemap import displayed, encode_srgb
from homofact.separable.separable import Separable
from homofact.viewer.layers import fit_layer
from homofact.viewer.viewer import Layer, source_layer, write_viewer

Open = Callable[..., Any]
PAIRS = draw_uniform(1500, torch.Generator().manual_seed(0))
SIDE = 200
# Distances of pixels from the middle; those whose surroundings the sphere covers wholly.
DISTANCE = np.hypot(*(np.mgrid[:SIDE, :SIDE] - (SIDE - 1) / 2))
INSIDE = DISTANCE < 0.94 * SIDE / 2 - 1.5


@pytest.fixture(scope="module")
def chromium(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    with browser(tmp_path_factory.mktemp("chromium")) as driver:
        yield driver


@pytest.fixture
def show(chromium: Any, tmp_path: Path) -> Iterator[Open]:
    """Opens a page of layers; afterwards the page must have been silent and must have asked for nothing else."""

    def show(*layers: Layer, **more: Any) -> Any:
        path = tmp_path / "page.html"
        write_viewer(path, layers, title="A test", **more)
        headless.open_page(chromium, path)
        shrink(chromium)
        return chromium

    complaints(chromium)
    requests(chromium)
    yield show
    assert complaints(chromium) == []
    assert set(requests(chromium)) <= {(tmp_path / "page.html").as_uri()}


def evaluate(driver: Any, key: str, wi: Tensor, wo: Tensor) -> np.ndarray:
    """(N, 3) of the page's own shader."""
    script = (
        "return Array.from(window.homofact.evaluate(arguments[0], Float32Array.from(arguments[1]),"
        " Float32Array.from(arguments[2])))"
    )
    values = driver.execute_script(script, key, wi.reshape(-1).tolist(), wo.reshape(-1).tolist())
    return np.array(values).reshape(-1, 3)


def gathered(driver: Any, passes: int) -> None:
    """Wait until so many passes of a sky are in the picture."""
    driver.execute_async_script(
        "const [passes, done] = arguments;"
        "(function wait() { window.homofact.passes < passes ? setTimeout(wait, 30) : done(); })();",
        passes,
    )


def change(driver: Any, **state: Any) -> dict[str, Any]:
    driver.execute_script("Object.assign(window.homofact.state, arguments[0]); window.homofact.changed();", state)
    return headless.settled(driver)


def shrink(driver: Any, side: int = SIDE) -> None:
    """Square pictures that software draws in no time."""
    driver.execute_script(
        "for (const p of document.querySelectorAll('.picture')) {"
        " p.style.width = p.style.height = arguments[0] + 'px'; p.style.maxHeight = 'none'; }"
        "window.homofact.changed();",
        side,
    )
    headless.settled(driver)


def picture(driver: Any, number: int = 0) -> np.ndarray:
    """(SIDE, SIDE, 3) in 0 … 255 of a card's canvas."""
    script = (
        "const c = document.querySelectorAll('.picture canvas')[arguments[0]];"
        "const copy = Object.assign(document.createElement('canvas'), {width: c.width, height: c.height});"
        "const context = copy.getContext('2d', {willReadFrequently: true});"
        "context.drawImage(c, 0, 0);"
        "return [c.width, c.height, Array.from(context.getImageData(0, 0, c.width, c.height).data)]"
    )
    width, height, data = driver.execute_script(script, number)
    assert (width, height) == (SIDE, SIDE)
    return np.array(data, float).reshape(SIDE, SIDE, 4)[..., :3]


FLOAT: dict[str, Factorization | Separable] = {
    name: CASES[name]
    for name in (
        "fixed theta_h-theta_d", "fixed theta_i-theta_o", "searched in-out", "warped half-diff",
        "warped isotropic half-diff", "five of all kinds", "McCool, one channel",
    )
} | {
    name: SEPARABLE[name]
    for name in ("in-out, parabolic, shared", "half-diff, polar, two", "half-diff, orthographic, two")
}  # fmt: skip


@pytest.mark.parametrize("start", range(0, len(FLOAT), 3))
def test_shaders_give_what_python_gives(start: int, show: Open) -> None:
    cases = dict(zip("abc", list(FLOAT.items())[start : start + 3], strict=False))
    driver = show(*(fit_layer(fitted, key, name) for key, (name, fitted) in cases.items()))
    wi, wo = (w.clone() for w in PAIRS)
    wi[:20, 2] *= -1
    for key, (name, fitted) in cases.items():
        found, expected = evaluate(driver, key, wi, wo), fitted.evaluate(wi, wo).numpy()
        assert (found[:20] == 0).all(), name
        found, expected = found[20:], np.broadcast_to(expected[20:], (len(wi) - 20, 3))
        error = np.abs(found - expected) / np.maximum(expected, 1e-3 * expected.mean())
        assert np.median(error) < 1e-6, (name, np.median(error))
        # Maps are torn at a meridian; a sum of products is cut at 0, where relative errors are of no use.
        assert np.quantile(error, 0.99) < (1e-4 if isinstance(fitted, Separable) else 1e-5), (
            name,
            np.quantile(error, 0.99),
        )


def bound(fitted: Factorization, wi: Tensor, wo: Tensor) -> np.ndarray:
    """How far the page may be from Python for 8-bit textures, (N, C).

    A sampler may divide the way from texel to texel into 1/256 and round (to nearest or down), and may round what it
    returns to 8 bits (WebGL 2 promises no more of a texture with 8 bits). Along u the logarithm then moves by at most
    Du/256, Du the largest difference of neighbouring texels, likewise along v, and by half a step of the texture's
    scale. Over all lookups that is B, and f = A (exp s − ε) moves by at most (f + εA)(exp B − 1). A hundredth of it is
    added for float32 elsewhere, 7e-4 of the logarithm for acos.
    """
    total = np.zeros(len(fitted.channels))
    for term in fitted.terms:
        texture = term.texture.numpy()
        across, along = (np.abs(np.diff(texture, axis=axis)).max((0, 1), initial=0) for axis in (1, 0))
        assert term.grid is not None
        total += term.projection.lookups * ((across + along) / 256 + term.grid.step.numpy() / 2)
    mean, epsilon = fitted.transform.mean.numpy(), fitted.transform.epsilon
    return (fitted.evaluate(wi, wo).numpy() + epsilon * mean) * np.expm1(1.01 * total + 7e-4)


def test_eight_bits_are_within_the_sampler_s_own_bound(show: Open) -> None:
    cases = {
        key: rounded(CASES[name], "png8")
        for key, name in (("a", "five of all kinds"), ("b", "fixed h"), ("c", "warped half-diff"))
    }
    driver = show(*(fit_layer(fitted, key, key) for key, fitted in cases.items()))
    wi, wo = PAIRS
    for key, fitted in cases.items():
        found, expected = evaluate(driver, key, wi, wo), fitted.evaluate(wi, wo).numpy()
        assert (np.abs(found - expected) <= bound(fitted, wi, wo)).all()
        # The bound tells an 8-bit texture from its neighbours: one read half a texel off is outside.
        moved = replace(
            fitted, terms=tuple(replace(t, texture=(t.texture + t.texture.roll(1, 1)) / 2) for t in fitted.terms)
        )
        assert (np.abs(moved.evaluate(wi, wo).numpy() - expected) > bound(fitted, wi, wo)).any()


@pytest.mark.parametrize("name", ["lafortune-blue-paint", "ward-brushed"])
def test_the_source_in_the_page_is_the_table(name: str, show: Open) -> None:
    layer = source_layer(material(name).model)
    driver = show(layer)
    assert layer.table is not None
    wi, wo = (w.clone() for w in PAIRS)
    wi[0] = wo[0] = torch.tensor([0.0, 0.0, 1.0])
    wo[1], wi[1] = wi[1] * torch.tensor([-1.0, -1.0, 1.0]), wi[1]
    wo[2, 2] *= -1
    found, expected = evaluate(driver, "source", wi, wo), layer.table.evaluate(wi, wo).numpy()
    error = np.abs(found - expected) / np.maximum(expected, 1e-3 * expected.mean())
    assert (found[2] == 0).all()
    assert np.median(error) < 2e-4
    assert np.quantile(error, 0.999) < 1e-2


def test_a_picture_is_python_s_render(show: Open) -> None:
    fitted = CASES["five of all kinds"]
    model = material("blinn-phong-50").model
    driver = show(fit_layer(fitted, "fit", "Fit"), source_layer(model))
    for number, reflectance, apart in ((0, fitted, 1), (1, model, 4)):
        found = picture(driver, number)
        exposure = 2 ** driver.execute_script("return window.homofact.state.stops")
        image = render_sphere(reflectance, size=SIDE)
        expected = displayed(image, exposure).numpy() * 255
        inside, rim = INSIDE, (image.coverage.numpy() > 0) & (image.coverage.numpy() < 1)
        difference = np.abs(found - expected)
        # Half a level of rounding each, and the table's own error for the source.
        assert difference[inside].max() <= apart
        assert np.median(difference[rim]) < 6
        assert (found[0, 0] == np.round(encode_srgb(torch.tensor(0.024)).item() * 255)).all()


def test_another_light_and_camera_are_python_s_too(show: Open) -> None:
    fitted = CASES["searched in-out"]
    driver = show(fit_layer(fitted, "fit", "Fit"))
    degrees = math.pi / 180
    a, e = -50 * degrees, 35 * degrees
    state = change(
        driver, lightFrom={"azimuth": -50, "elevation": 35}, camera={"azimuth": 20, "elevation": -15}, stops=1
    )
    assert state["stops"] == 1
    light = replace(DEFAULT_LIGHT, direction=(math.cos(e) * math.sin(a), math.sin(e), math.cos(e) * math.cos(a)))
    a, e = 20 * degrees, -15 * degrees
    view = (math.cos(e) * math.sin(a), math.sin(e), math.cos(e) * math.cos(a))
    image = render_sphere(fitted, light, SIDE, view=view)
    expected = displayed(image, 2.0).numpy() * 255
    assert np.abs(picture(driver) - expected)[INSIDE].max() <= 1


def ball(rings: int = 60) -> Mesh:
    theta, phi = np.meshgrid(
        np.linspace(0, math.pi, rings + 1), np.linspace(0, 2 * math.pi, 2 * rings + 1), indexing="ij"
    )
    points = np.stack((np.sin(theta) * np.sin(phi), np.cos(theta), np.sin(theta) * np.cos(phi)), -1).reshape(-1, 3)
    at = np.arange(points.shape[0]).reshape(theta.shape)
    a, b, c, d = at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]
    triangles = np.concatenate([np.stack(t, -1).reshape(-1, 3) for t in ((a, b, c), (a, c, d))])
    return Mesh(points, points, triangles, "ball.obj")


def test_a_ball_as_a_mesh_looks_like_the_sphere(show: Open) -> None:
    driver = show(fit_layer(CASES["fixed theta_h-theta_d"], "fit", "Fit"), mesh=ball())
    assert driver.execute_script("return window.homofact.state.surface") == "mesh"
    mesh = picture(driver)
    change(driver, surface="sphere")
    sphere = picture(driver)
    inside = DISTANCE < 0.9 * 0.94 * SIDE / 2
    assert np.median(np.abs(mesh - sphere)[inside]) <= 1
    assert np.quantile(np.abs(mesh - sphere)[inside], 0.99) <= 6
    outside = DISTANCE > 0.96 * SIDE / 2
    assert np.array_equal(mesh[outside], sphere[outside])


def under(driver: Any, **state: Any) -> np.ndarray:
    """(SIDE, SIDE, 3) linear, at an exposure of 1, of the first picture after a dozen passes of a sky."""
    script = "Object.assign(window.homofact.state, arguments[0]); window.homofact.changed();"
    driver.execute_script(script, {"stops": 0, **state})
    driver.execute_async_script("requestAnimationFrame(() => requestAnimationFrame(arguments[0]))")
    gathered(driver, 12)
    shown = picture(driver) / 255
    return np.where(shown <= 0.04045, shown / 12.92, ((shown + 0.055) / 1.055) ** 2.4)


def test_a_glossy_sphere_under_the_sky_is_python_s_too(show: Open) -> None:
    """The overcast sky, its zenith above, as a lat-long map: both renderers integrate it, with samples of their own."""
    model = Phong((0.10, 0.20, 0.30), (0.4, 0.4, 0.4), exponent=300)
    driver = show(source_layer(model))
    found = under(driver, light="overcast", lightFrom={"azimuth": 0, "elevation": 90})
    height = torch.cos((torch.arange(128) + 0.5) * (math.pi / 128)).double()
    sky = torch.where(height > 0, (9 / 7) * (1 + 2 * height) / 3, 0.2)
    light = EnvironmentMap(sky[:, None, None].expand(128, 256, 1).contiguous())
    expected = render_sphere(model, light, SIDE, samples=64).radiance.numpy()
    for row in range(40, 160, 20):
        for column in range(60, 140, 20):
            block = np.s_[row : row + 20, column : column + 20]
            assert found[block].mean((0, 1)) == pytest.approx(expected[block].mean((0, 1)), rel=0.03), (row, column)


@pytest.mark.parametrize("light", ["overcast", "studio"])
def test_skies_give_the_irradiance_that_they_say(light: str, show: Open) -> None:
    """A Lambertian surface that faces the sky's zenith, or the studio's key light, reflects about its albedo."""
    albedo = (0.2, 0.5, 0.7)
    driver = show(source_layer(Lambert(albedo)))
    found = under(driver, light=light)
    lit = driver.execute_script("return window.homofact.state.lightFrom")
    a, e = (lit[name] * math.pi / 180 for name in ("azimuth", "elevation"))
    x, y = math.cos(e) * math.sin(a), math.sin(e)
    column, row = (round(SIDE / 2 * (1 + 0.94 * s)) for s in (x, -y))
    linear = found[row - 3 : row + 4, column - 3 : column + 4].mean((0, 1))
    # The studio's lamps are only about as bright.
    assert linear / albedo == pytest.approx(1.0, abs=0.03 if light == "overcast" else 0.2)


def test_differences_are_to_the_source_and_vanish_where_there_is_none(show: Open) -> None:
    fitted = CASES["fixed h"]
    driver = show(*(fit_layer(fitted, key, key) for key in ("fit", "mccool", "source")))
    plain = picture(driver, 0)
    for mode in ("signed", "ratio", "absolute"):
        change(driver, difference=mode)
        shown = [picture(driver, number) for number in range(3)]
        assert np.array_equal(shown[2], plain)
        middle = shown[0][SIDE // 2, SIDE // 2]
        assert np.abs(shown[0][SIDE // 2 - 40 : SIDE // 2 + 40, SIDE // 2] - middle).max() <= 1, mode
        assert np.array_equal(shown[0], shown[1])
    labels = driver.execute_script(
        "return Array.from(document.querySelectorAll('.scale'), s => s.hidden ? '' : s.textContent)"
    )
    assert labels == [
        "luminance, |fit − source|00.1250.25 of white",
        "luminance, |mccool − source|00.1250.25 of white",
        "",
    ]


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
    return driver.execute_script("return structuredClone(window.homofact.state)")


def test_everything_can_be_done_by_keys(show: Open) -> None:
    from selenium.webdriver.common.keys import Keys

    layers = [fit_layer(CASES["fixed h"], key, key) for key in ("fit", "mccool", "source")]
    driver = show(*layers, mesh=ball(8))
    shrink(driver, 48)
    first = press(driver, "")
    assert press(driver, Keys.ARROW_RIGHT)["camera"]["azimuth"] == -5
    assert press(driver, Keys.ARROW_UP)["camera"]["elevation"] == -5
    lit = press(driver, Keys.ARROW_LEFT, shift=True)["lightFrom"]
    assert lit["azimuth"] == pytest.approx(first["lightFrom"]["azimuth"] - 5)
    assert press(driver, "m")["drag"] == "lightFrom"
    assert press(driver, Keys.ARROW_DOWN)["lightFrom"]["elevation"] == 25
    assert press(driver, "m")["drag"] == "camera"
    assert [press(driver, "d")["difference"] for _ in range(4)] == ["signed", "absolute", "ratio", "off"]
    assert [press(driver, key)["factor"] for key in "]][[[["] == [8, 16, 8, 4, 2, 1]
    assert press(driver, "e")["stops"] == pytest.approx(first["stops"] - 0.3, abs=0.051)
    assert press(driver, "E")["stops"] == pytest.approx(first["stops"], abs=0.051)
    assert [press(driver, "l")["light"] for _ in range(3)] == ["overcast", "studio", "directional"]
    assert [press(driver, "s")["surface"] for _ in range(2)] == ["sphere", "mesh"]
    assert press(driver, "2")["visible"] == ["fit", "source"]
    assert press(driver, "1")["visible"] == ["source"]
    # The last picture stays.
    assert press(driver, "3")["visible"] == ["source"]
    assert press(driver, "0")["visible"] == ["fit", "mccool", "source"]
    assert press(driver, "+")["zoom"] == pytest.approx(1.15)
    assert press(driver, "-")["zoom"] == pytest.approx(1)
    last = press(driver, "r")
    assert {name: last[name] for name in ("camera", "lightFrom", "zoom")} == {
        name: first[name] for name in ("camera", "lightFrom", "zoom")
    }
    textures = "return document.getElementById('textures').hidden"
    assert driver.execute_script(textures) is False
    press(driver, "t")
    assert driver.execute_script(textures) is True
    press(driver, "?")
    assert driver.execute_script("return document.getElementById('help').open") is True
    # Under the help no key turns anything.
    assert press(driver, "l")["light"] == "directional"
    press(driver, Keys.ESCAPE)
    assert driver.execute_script("return document.getElementById('help').open") is False
    # Tab reaches everything; a slider keeps its arrows.
    driver.execute_script("document.getElementById('exposure').focus()")
    stops = press(driver, "")["stops"]
    moved = press(driver, Keys.ARROW_RIGHT)
    assert moved["stops"] == pytest.approx(stops + 0.1)
    assert moved["camera"] == first["camera"]
    names = "return Array.from(document.querySelectorAll('button, input, .picture canvas'), e => e.tabIndex)"
    assert min(driver.execute_script(names)) == 0


def test_dragging_turns_and_pointing_reads(show: Open) -> None:
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.keys import Keys

    fitted = CASES["searched in-out"]
    driver = show(fit_layer(fitted, "fit", "Fit"))
    canvas = driver.find_element("css selector", ".picture canvas")
    ActionChains(driver).move_to_element_with_offset(canvas, 30, 10).perform()
    headless.settled(driver)
    cells = driver.execute_script("return Array.from(document.querySelectorAll('#reading td'), c => c.textContent)")
    x, y = (s / (0.94 * SIDE / 2) for s in (30, -10))
    n = torch.tensor([x, y, math.sqrt(1 - x * x - y * y)], dtype=torch.float64)
    t = torch.tensor([n[2], 0, -n[0]], dtype=torch.float64)
    t /= t.norm()
    frame = torch.stack((t, torch.linalg.cross(n, t), n))
    wi = (frame @ DEFAULT_LIGHT.unit())[None]
    wo = (frame @ torch.tensor([0.0, 0.0, 1.0], dtype=torch.float64))[None]
    assert [float(cell) for cell in cells] == pytest.approx(fitted.evaluate(wi, wo)[0].tolist(), rel=0.02)
    angles = driver.execute_script(
        "return Array.from(document.querySelectorAll('.reading-angles div'), c => c.textContent)"
    )
    # To the pixel that the pointer is on.
    assert float(angles[1][2:-1]) == pytest.approx(math.degrees(math.acos(float(wo[0, 2]))), abs=0.6)
    before = headless.settled(driver)
    ActionChains(driver).drag_and_drop_by_offset(canvas, 50, 20).perform()
    after = headless.settled(driver)
    # Half the picture's side is 90°; what is dragged follows the pointer.
    assert after["camera"]["azimuth"] - before["camera"]["azimuth"] == pytest.approx(-50 * 180 / SIDE, abs=1)
    assert after["camera"]["elevation"] - before["camera"]["elevation"] == pytest.approx(20 * 180 / SIDE, abs=1)
    ActionChains(driver).key_down(Keys.SHIFT).drag_and_drop_by_offset(canvas, 50, 0).key_up(Keys.SHIFT).perform()
    turned = headless.settled(driver)
    assert turned["camera"] == after["camera"]
    assert turned["lightFrom"]["azimuth"] - after["lightFrom"]["azimuth"] == pytest.approx(50 * 180 / SIDE, abs=1)


def test_the_numbers_and_the_textures_are_shown(show: Open, record_property: Callable[[str, object], None]) -> None:
    facts = (("Log MSE, held out", "0.0123"),)
    driver = show(
        fit_layer(CASES["five of all kinds"], "fit", "Fit", facts),
        fit_layer(CASES["McCool, one channel"], "mccool", "McCool"),
        source_layer(Lambert((0.5, 0.5, 0.5))),
        notes=["A note & <more>."],
    )
    # Never judged: a machine may be busy.
    record_property("first_frame_ms", headless.first_frame(driver))
    text = driver.execute_script("return document.getElementById('numbers').innerText")
    assert "0.0123" in text
    assert text.count("Log MSE, held out") == 1
    rows = driver.execute_script(
        "return Array.from(document.querySelectorAll('#numbers tr[data-key]'), r => [r.dataset.key, r.cells.length])"
    )
    assert rows == [["fit", 6], ["mccool", 6], ["source", 6]]
    captions = driver.execute_script("return Array.from(document.querySelectorAll('figcaption'), f => f.innerText)")
    assert len(captions) == 7
    assert captions[0].startswith("searched in θh, θd, φd, warped")
    assert "A note & <more>." in driver.execute_script("return document.getElementById('notes').innerText")
    assert driver.title == "A test"


BROKEN = "vec3 fit_evaluate(vec3 wi, vec3 wo) { return no_such_thing; }"


def trouble(driver: Any, page: Path, *layers: Layer) -> str:
    write_viewer(page, layers, title="t")
    headless.open_page(driver, page)
    return driver.execute_script("return document.getElementById('trouble')?.innerText ?? ''")


def test_a_broken_shader_is_said_in_the_page(chromium: Any, tmp_path: Path) -> None:
    complaints(chromium)
    said = trouble(chromium, tmp_path / "page.html", Layer("fit", "Fit", BROKEN, ()))
    assert said.startswith("The shader of “Fit” does not compile on this machine.")
    assert "no_such_thing" in said
    assert complaints(chromium) == []


def test_a_browser_that_cannot_unpack_is_told(chromium: Any, tmp_path: Path) -> None:
    script = chromium.execute_cdp_cmd(
        "Page.addScriptToEvaluateOnNewDocument", {"source": "delete window.DecompressionStream"}
    )
    try:
        said = trouble(chromium, tmp_path / "page.html", fit_layer(CASES["fixed h"], "fit", "Fit"))
    finally:
        chromium.execute_cdp_cmd("Page.removeScriptToEvaluateOnNewDocument", script)
    assert said.startswith("This browser cannot unpack the page's data.")
    assert "Firefox since 113" in said


def test_damaged_data_are_said_in_the_page(chromium: Any, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    write_viewer(page, [fit_layer(CASES["fixed h"], "fit", "Fit")], title="t")
    page.write_text(page.read_text(encoding="utf-8").replace('"layers":[', '"layers":[,'), encoding="utf-8")
    headless.open_page(chromium, page)
    said = chromium.execute_script("return document.getElementById('trouble')?.innerText ?? ''")
    assert said.startswith("The page cannot be shown.")
    assert "JSON" in said


def test_without_webgl_the_page_says_so(tmp_path: Path) -> None:
    with browser(tmp_path, webgl=False) as driver:
        said = trouble(driver, tmp_path / "page.html", fit_layer(CASES["fixed h"], "fit", "Fit"))
        assert said.startswith("This page draws with WebGL 2, which is not available here.")
        assert "hardware acceleration" in said
        assert driver.execute_script("return document.querySelectorAll('.actions button:not([hidden])').length") == 0
