"""Editing on the page by pointer, keys and buttons, in a headless Chromium."""

from typing import Any

import numpy as np
import pytest
from browser import headless
from editing.page_opened import begin, click, press, steps, values
from editing.page_scene import materials, page_prepared, quiet
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

pytestmark = pytest.mark.slow


@pytest.fixture(autouse=True)
def fresh(page: Any) -> None:
    """The page as it began."""
    begin(page, root=True)


def drag(driver: Any, start: tuple[int, float], *stops: tuple[int, float]) -> None:
    """The pointer from one (band, level) of the plot to others."""
    plot = driver.find_element(By.ID, "plot")
    places = driver.execute_script(
        "const plot = homofact.page.plot; return arguments[0].map(([j, y]) => [plot.middle(j)"
        " - plot.width / 2, plot.y(y) - plot.height / 2])",
        [start, *stops],
    )
    chain = ActionChains(driver, duration=20)
    (x, y), *rest = [(round(x), round(y)) for x, y in places]
    chain.move_to_element_with_offset(plot, x, y).click_and_hold()
    for x, y in rest:
        chain.move_to_element_with_offset(plot, x, y)
    chain.release().perform()
    quiet(driver)


def test_a_line_is_drawn_and_is_one_step(page: Any) -> None:
    press(page, "d")
    before = values(page)
    drag(page, (10, 1.0), (20, 2.0), (40, 0.5))
    after = values(page)
    assert steps(page) == 1
    # A pixel of the plot is a little more than a fifth of a band, and 0.02 of the value.
    high = page.execute_script("return homofact.page.axis.high")
    assert after[10].mean() == pytest.approx(1.0, abs=0.02 * high)
    assert after[20].mean() == pytest.approx(2.0, abs=0.02 * high)
    assert after[30].mean() == pytest.approx(1.25, abs=0.02 * high)
    assert (after[:9] == before[:9]).all()
    assert (after[42:] == before[42:]).all()
    press(page, "z")
    assert (values(page) == before).all()
    press(page, "y")
    assert (values(page) == after).all()


def test_one_channel_is_pulled_by_the_brush_and_the_others_stay(page: Any) -> None:
    click(page, "#channel button[data-value='1']")
    before = values(page)
    at = float(before[12, 1])
    drag(page, (12, at), (12, at + 1))
    after = values(page)
    high = page.execute_script("return homofact.page.axis.high")
    assert after[12, 1] - before[12, 1] == pytest.approx(1, abs=0.02 * high)
    assert (after[:, [0, 2]] == before[:, [0, 2]]).all()
    change = after[:, 1] - before[:, 1]
    # A bell of a fifteenth of the axis, which is 4.27 of the 64 bands.
    assert change[8] / change[12] == pytest.approx(np.exp(-0.5 * (4 / (64 / 15)) ** 2), rel=1e-6)


def test_handles_move_what_is_between_their_neighbours(page: Any) -> None:
    press(page, "h", "l")
    handles = page.execute_script("return homofact.shapes.handlesOf(homofact.page.curve)")
    assert handles[0] == 0
    assert handles[-1] == 63
    before, band = values(page), handles[5]
    at = float(before[band].mean())
    drag(page, (band, at), (band, at * 2))
    after = values(page)
    # At the end the curve is next to nothing.
    ratio = np.where(before > 1e-100, after / np.maximum(before, 1e-100), 1)[:, 0]
    assert ratio[band] == pytest.approx(2, rel=0.1)
    assert (ratio[: handles[4] + 1] == 1).all()
    assert (ratio[handles[6] :] == 1).all()
    middle = (handles[5] + handles[6]) // 2
    assert 1 < ratio[middle] < ratio[band]


def test_keys_move_the_point_and_raise_it(page: Any) -> None:
    press(page, "p")
    assert page.execute_script("return document.activeElement.id") == "plot"
    press(page, Keys.ARROW_RIGHT, Keys.ARROW_RIGHT, Keys.ARROW_LEFT)
    assert page.execute_script("return homofact.state.band") == 9
    press(page, "d", "l")
    before = values(page)
    press(page, Keys.ARROW_UP)
    after = values(page)
    assert after[9] == pytest.approx(1.05 * before[9], rel=1e-12)
    assert (np.delete(after, 9, 0) == np.delete(before, 9, 0)).all()
    said = page.execute_script("return document.getElementById('plot').getAttribute('aria-valuetext')")
    assert said.startswith("θh 2.0°")
    press(page, Keys.END)
    assert page.execute_script("return homofact.state.band") == 63
    ActionChains(page).key_down(Keys.CONTROL).send_keys("z").key_up(Keys.CONTROL).perform()
    quiet(page)
    assert (values(page) == before).all()


def test_every_shortcut_does_what_the_help_says(page: Any) -> None:
    press(page, "m")
    assert page.execute_script("return homofact.page.material.name") == "steel"
    press(page, "c", "c", "c", "c")
    assert page.execute_script("return homofact.page.curve.name") == "incident"
    press(page, "n", "x", "t", "E", "v", "]", "2")
    state = page.execute_script("return homofact.state")
    assert (state["channel"], state["root"], state["tones"], state["show"], state["view"]) == (
        0, False, "srgb", "split", 1,
    )  # fmt: skip
    assert state["stops"] == pytest.approx(0.3)
    assert state["split"] == pytest.approx(0.55)
    assert page.execute_script("return document.getElementById('divider').hidden") is False
    press(page, "?")
    assert page.execute_script("return document.getElementById('help').open") is True
    press(page, Keys.ESCAPE)


def test_resets_and_kept_states(page: Any) -> None:
    start = values(page)
    click(page, "#shapes button:nth-child(1)")
    assert values(page) == pytest.approx(1.25 * start, rel=1e-12)
    press(page, "k")
    assert page.execute_script("return document.getElementById('compare').innerText").split() == ["Start", "Kept", "1"]
    click(page, "#shapes button:nth-child(5)")
    assert steps(page) == 2
    click(page, "#kept button:nth-child(2)")
    assert values(page) == pytest.approx(1.25 * start, rel=1e-12)
    press(page, "r")
    assert (values(page) == start).all()
    assert page.execute_script("return homofact.page.history.changed.length") == 0
    assert page.execute_script("return document.getElementById('save').disabled") is True
    press(page, "z", "c")
    click(page, "#shapes button:nth-child(2)")
    press(page, "R")
    assert page.execute_script("return homofact.page.history.changed.length") == 0


def test_an_edit_after_an_undo_forgets_what_was_undone(page: Any) -> None:
    start = values(page)
    click(page, "#shapes button:nth-child(1)")
    click(page, "#shapes button:nth-child(1)")
    press(page, "z")
    click(page, "#shapes button:nth-child(2)")
    assert values(page) == pytest.approx(start, rel=1e-12)
    assert page.execute_script("return document.getElementById('redo').disabled") is True
    press(page, "z")
    assert values(page) == pytest.approx(1.25 * start, rel=1e-12)
    press(page, "y", "y")
    assert values(page) == pytest.approx(start, rel=1e-12)


def test_shapes_do_what_they_say(page: Any) -> None:
    before = values(page)
    click(page, "#shapes button:nth-child(3)")
    narrow = values(page)
    # Bands finer near 0: 1.25 times the angle is √1.25 times the place.
    place = np.minimum(np.sqrt(1.25) * (np.arange(64) + 0.5), 63.5) - 0.5
    expected = np.stack([np.interp(place, np.arange(64), before[:, c]) for c in range(3)], 1)
    assert narrow == pytest.approx(expected, rel=1e-9)
    click(page, "#channel button[data-value='2']")
    click(page, "#shapes button:nth-child(1)")
    assert values(page)[:, 2] == pytest.approx(1.25 * narrow[:, 2], rel=1e-12)
    assert (values(page)[:, :2] == narrow[:, :2]).all()
    click(page, "#shapes button:nth-child(6)")
    assert (values(page) == values(page).mean(1, keepdims=True)).all()


def test_a_click_in_the_picture_takes_the_material_there(page: Any) -> None:
    canvas = page.find_element(By.ID, "canvas")
    prepared = page_prepared()
    seen, (width, height) = prepared.pixels[0], prepared.scene.cameras[0].pixels
    for thing in (2, 3, 1):
        number = int(seen.numbers[np.flatnonzero(seen.objects == thing)[10]])
        x, y = page.execute_script(
            "const b = homofact.page.box(), c = document.getElementById('canvas'); return"
            " [b.left + (arguments[0] + 0.5) * b.width / arguments[2] - c.clientWidth / 2,"
            " b.top + (arguments[1] + 0.5) * b.height / arguments[3] - c.clientHeight / 2]",
            number % width, number // width, width, height,
        )  # fmt: skip
        ActionChains(page).move_to_element_with_offset(canvas, round(x), round(y)).click().perform()
        quiet(page)
        assert page.execute_script("return homofact.page.material.name") == materials()[thing].name


def test_a_curve_of_nothing_is_refused(page: Any) -> None:
    before = values(page)
    page.execute_script("homofact.page.edit(homofact.page.values.map(() => 0))")
    quiet(page)
    assert (values(page) == before).all()
    said = page.execute_script("return document.getElementById('note').textContent")
    assert said == "A curve that is 0 everywhere leaves nothing to see: it stays as it was."


@pytest.mark.parametrize(
    ("button", "channel", "said"),
    [
        (3, None, "The curve has the same value at every angle, so “Narrower” changes nothing."),
        (4, None, "The curve has the same value at every angle, so “Wider” changes nothing."),
        (5, 1, "The channel has the same value at every angle, so “Smooth” changes nothing."),
        (6, 1, "The curve is grey already, so “Grey” changes nothing."),
        (1, 2, "The channel is 0 at every angle, so “Brighter” changes nothing."),
    ],
)
def test_a_button_that_changes_nothing_prints_why(page: Any, button: int, channel: int | None, said: str) -> None:
    page.execute_script(
        "const p = homofact.page; p.controls.edit(2, p.curvesOf(2)[1].index);"
        # A value that is not exact as a sum of its parts, so that means and readings between bands round.
        "p.edit(p.values.map((x, i) => arguments[0] === 2 && i % 3 === 2 ? 0 : 0.1)); p.state.channel = arguments[0];",
        channel,
    )
    quiet(page)
    before = steps(page)
    click(page, f"#shapes button:nth-child({button})")
    note = "return document.getElementById('note').textContent"
    assert page.execute_script(note) == said
    assert steps(page) == before
    # The line is about this curve, and goes with it.
    page.execute_script("homofact.page.controls.edit(0)")
    quiet(page)
    assert page.execute_script(note) == ""


MEAN_ALBEDO = """
const p = homofact.page, { mean } = p.data.furnace, furnace = p.furnaces[p.state.material];
const rows = furnace.albedo(arguments[0] ? p.curves.map((c) => c.start) : p.history.state);
return [0, 1, 2].map((c) => mean.reduce((sum, weight, i) => sum + weight * rows[3 * i + c], 0));
"""


def test_a_narrower_highlight_can_have_the_same_albedo(page: Any) -> None:
    page.execute_script("homofact.page.controls.edit(0, 2)")
    quiet(page)
    before = page.execute_script(MEAN_ALBEDO, True)
    for _ in range(3):
        click(page, "#shapes button:nth-child(3)")
    narrow, darker = values(page), page.execute_script(MEAN_ALBEDO, False)
    assert np.less(darker, np.multiply(before, 0.99)).any()
    click(page, "#shapes button:nth-child(7)")
    assert page.execute_script(MEAN_ALBEDO, False) == pytest.approx(before, rel=1e-6)
    # It is the same curve times a number for each channel.
    lit = (narrow > 0).all(1)
    ratios = values(page)[lit] / narrow[lit]
    assert lit.sum() > 10
    assert np.allclose(ratios, ratios[0], rtol=1e-9)
    count = steps(page)
    click(page, "#shapes button:nth-child(7)")
    assert steps(page) == count
    # In one channel alone, and where no factor will do.
    page.execute_script("homofact.page.state.channel = 1; homofact.page.edit(homofact.page.values.map((x) => 2 * x))")
    quiet(page)
    click(page, "#shapes button:nth-child(7)")
    found = page.execute_script(MEAN_ALBEDO, False)
    assert found[1] == pytest.approx(before[1], rel=1e-6)
    assert found[0] > 1.01 * before[0]


def test_a_curve_over_both_directions_can_have_the_same_albedo(page: Any) -> None:
    page.execute_script("homofact.page.controls.edit(2, homofact.page.curvesOf(2)[1].index)")
    quiet(page)
    page.execute_script(
        "homofact.page.state.channel = null; homofact.page.edit(homofact.page.values.map((x) => 1.3 * x))"
    )
    quiet(page)
    before, brighter = page.execute_script(MEAN_ALBEDO, True), page.execute_script(MEAN_ALBEDO, False)
    assert brighter == pytest.approx([1.69 * value for value in before], rel=1e-6)
    click(page, "#shapes button:nth-child(7)")
    assert page.execute_script(MEAN_ALBEDO, False) == pytest.approx(before, rel=1e-6)


def test_the_same_buttons_change_a_curve_that_is_not_flat(page: Any) -> None:
    for button in range(1, 6):
        before = values(page)
        click(page, f"#shapes button:nth-child({button})")
        assert not np.allclose(values(page), before, rtol=1e-6)
    assert page.execute_script("return document.getElementById('note').textContent") == ""


def test_it_fits_a_phone_and_a_desk(page: Any) -> None:
    try:
        for width, height in ((420, 900), (800, 900), (1400, 900)):
            headless.resize(page, (width, height))
            quiet(page)
            wide = page.execute_script(
                "return [document.documentElement.scrollWidth, ...[...document.querySelectorAll('button')].filter("
                "(b) => b.offsetParent && b.getBoundingClientRect().right > innerWidth + 0.5).map((b) => b.innerText)]"
            )
            assert wide == [width]
    finally:
        headless.resize(page, (1440, 900))
