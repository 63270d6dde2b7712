"""What hands do on the page in a headless Chromium: keys, drags, readings."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch
from browser import headless
from shading_cases import CASES
from viewer_page import SIDE, ball, press

from homofact.brdf.analytic.lambert import Lambert
from homofact.rendering.light import DEFAULT_LIGHT
from homofact.web.layers import fit_layer
from homofact.web.viewer import source_layer

pytestmark = pytest.mark.slow

Open = Callable[..., Any]


def test_everything_can_be_done_by_keys(show: Open) -> None:
    from selenium.webdriver.common.keys import Keys

    layers = [fit_layer(CASES["fixed h"], key, key) for key in ("fit", "mccool", "source")]
    driver = show(*layers, mesh=ball(8), side=32)
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
    assert [press(driver, "l")["light"] for _ in range(4)] == ["overcast", "studio", "sky", "directional"]
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
    # A file is asked for by a button.
    reached = "'button, input:not([type=file]), .picture canvas'"
    names = f"return Array.from(document.querySelectorAll({reached}), e => e.tabIndex)"
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
    sentence = "a verdict of many words: " + "total reflected light within 5%, " * 3
    facts = (("Verdict", sentence), ("Log MSE, held out", "0.0123"))
    fit = fit_layer(CASES["five of all kinds"], "fit", "Fit", facts)
    first = fit.textures[0]
    mask = np.arange(first.pixels[..., 0].size).reshape(first.pixels.shape[:2]) > 2
    driver = show(
        replace(fit, textures=(replace(first, mask=mask), *fit.textures[1:])),
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
    # A sentence is no column: it is as wide as the table, under its fit's title.
    said = driver.execute_script(
        "return Array.from(document.querySelectorAll('#numbers .said'), d => [d.innerText, d.offsetWidth])"
    )
    assert [each[0].split() for each in said] == [f"Fit Verdict: {sentence}".split()]
    assert said[0][1] == driver.execute_script("return document.querySelector('#numbers table').offsetWidth")
    captions = driver.execute_script("return Array.from(document.querySelectorAll('figcaption'), f => f.innerText)")
    assert len(captions) == 7
    assert captions[0].startswith("searched in θh, θd, φd, warped")
    # Of McCool's, every texel is read.
    captions = (
        "return Array.from(document.querySelectorAll('.texture-set'), s => s.querySelector(':scope > p')?.innerText)"
    )
    assert driver.execute_script(captions) == ["Hatched: texels that no pair of directions reads.", None]
    assert "A note & <more>." in driver.execute_script("return document.getElementById('notes').innerText")
    assert driver.title == "A test"


@pytest.mark.parametrize("width", [420, 800, 1000, 1400])
def test_no_word_on_a_button_is_cut_off(show: Open, width: int) -> None:
    layers = [
        fit_layer(CASES["fixed h"], key, title)
        for key, title in (("fit", "Searched fit"), ("mccool", "McCool"), ("source", "Source"))
    ]
    driver = show(*layers, side=32)
    headless.resize(driver, (width, 900))
    cut = (
        "return Array.from(document.querySelectorAll('button'))"
        ".filter(b => b.offsetParent && (b.scrollWidth > b.clientWidth || b.scrollHeight > b.clientHeight + 1))"
        ".map(b => b.innerText)"
    )
    words = driver.execute_script("return Array.from(document.querySelectorAll('.choice button'), b => b.innerText)")
    assert {"Searched fit", "Sphere", "Knot", "Overcast", "Turns camera", "Moves light"} <= set(words)
    assert driver.execute_script(cut) == []
    assert driver.execute_script("return document.documentElement.scrollWidth") <= width
