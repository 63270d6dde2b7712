"""Hands on the page of a relit scene, the words on it, and what it says where it cannot be shown."""

import math
from pathlib import Path
from typing import Any

import pytest
import relit_scene
from browser import browser, complaints, headless, requests
from relit_page import change, check_tuples, words
from relit_scene import SIZE

from homofact.relighting import cube
from homofact.relighting.page.build import write_page

pytestmark = pytest.mark.slow


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


def test_numbers_of_five_digits_stand_beside_their_sliders(page: Any) -> None:
    """As many coefficients as a cube map of 6 × 64² has: none runs under the button next to it."""
    most = page.execute_script("const v = homofact.view, most = v.mostKept; v.mostKept = 24576; return most")
    change(page, "picture", kept=24576)
    said = page.execute_script(
        "return [...document.querySelectorAll('.slider output')].map(o => [o.scrollWidth <= o.clientWidth, o.id])"
    )
    shown = words(page, "kept-value"), page.find_element("id", "kept-all").get_attribute("title")
    page.execute_script("homofact.view.mostKept = arguments[0]", most)
    assert shown == ("24,576", "24,576 in the longest vector")
    assert said == [[True, f"{name}-value"] for name in ("turn", "terms", "kept", "exposure")]


def test_a_page_without_a_reference_says_so(chromium: Any, page: Any, tmp_path: Path) -> None:
    given = relit_scene.plain(relit_scene.scene())
    write_page(tmp_path / "p.html", given.objects, given.skies, {}, title="t")
    before = chromium.current_window_handle
    chromium.switch_to.new_window("tab")
    try:
        headless.open_page(chromium, tmp_path / "p.html")
        headless.settled(chromium)
        assert words(chromium, "error-words").startswith(
            "This page has no reference, because relight ran without --reference."
        )
        # No time is shown of what was not timed.
        assert "–" not in words(chromium, "status")
        assert "among the numbers below" not in words(chromium, "error-words")
        assert chromium.execute_script("return document.getElementById('show-field').hidden") is True
    finally:
        requests(chromium)
        chromium.close()
        chromium.switch_to.window(before)


def trouble(driver: Any, page: Path) -> str:
    given = relit_scene.plain(relit_scene.scene())
    write_page(page, given.objects, given.skies, {})
    headless.open_page(driver, page)
    return driver.execute_script("return document.getElementById('trouble')?.innerText ?? ''")


def test_without_webgl_or_unpacking_the_page_says_so(tmp_path: Path) -> None:
    with browser(webgl=False) as driver:
        said = trouble(driver, tmp_path / "page.html")
        assert said.startswith("This page draws with WebGL 2, which is not available here.")
        assert driver.execute_script("return document.querySelectorAll('.actions button:not([hidden])').length") == 0


def test_without_unpacking_the_page_says_so(chromium: Any, page: Any, tmp_path: Path) -> None:
    before = chromium.current_window_handle
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
        chromium.switch_to.window(before)
    assert said.startswith("This browser cannot unpack the page's data.")


def test_the_heading_names_each_mesh_once_with_the_materials_that_share_it(page: Any) -> None:
    assert page.execute_script("return document.getElementById('objects').textContent") == (
        "knot, coloured lobes · ground, grey"
    )
    shared = [("ball", "gold"), ("ground", "grey"), ("ball", "clay"), ("ball", "gold"), ("ball", "paint")]
    assert page.execute_script(
        "return homofact.objectsInWords(arguments[0].map(([name, material]) => ({name, material})))", shared
    ) == ("ball, gold, clay and paint · ground, grey")
