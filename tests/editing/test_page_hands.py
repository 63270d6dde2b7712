"""Editing on the page by pointer, keys, buttons and files, in a headless Chromium."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from browser import browser, complaints, headless
from editing.page_scene import page_prepared, quiet
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

from homofact.editing.curves_file import read_curves, write_curves
from homofact.editing.material import Editable
from homofact.editing.picture import Address
from homofact.editing.session import Session

pytestmark = pytest.mark.slow


def materials() -> list[Editable]:
    return [thing.material for thing in page_prepared().scene.objects]


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    from homofact.editing.page.build import write_edit_page

    folder = tmp_path_factory.mktemp("page")
    with browser() as driver:
        write_edit_page(folder / "edit.html", page_prepared(), title="A test")
        headless.open_page(driver, folder / "edit.html")
        quiet(driver)
        yield driver
        assert complaints(driver) == []


@pytest.fixture(autouse=True)
def fresh(page: Any) -> None:
    """The page as it began."""
    page.execute_script(
        "const p = homofact.page; p.step = p.axisHeld = null; p.history.states.length = 1; p.history.now = 0;"
        "p.history.kept.length = 1; p.controls.fillKept(); p.budget = 1e6; p.note('');"
        "Object.assign(p.state, {view: 0, tool: 'brush', channel: null, logs: false, root: true, band: 8,"
        " show: 'after', compare: 0, split: 0.5, tones: 'filmic'}); p.controls.edit(0, 2);"
        "document.activeElement?.blur(); p.changed('all');"
    )
    quiet(page)


def values(driver: Any) -> np.ndarray:
    """(J, C) of the curve in hand."""
    found = driver.execute_script("const p = homofact.page; return [p.curve.bands, Array.from(p.values)]")
    return np.array(found[1]).reshape(found[0], -1)


def steps(driver: Any) -> int:
    """States of the history before the one that is shown."""
    return driver.execute_script("return homofact.page.history.now")


def press(driver: Any, *keys: str) -> None:
    ActionChains(driver).send_keys(*keys).perform()
    quiet(driver)


def click(driver: Any, place: str) -> None:
    driver.execute_script(f"document.querySelector({place!r}).click()")
    quiet(driver)


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


def text(driver: Any) -> str:
    return driver.execute_script("return homofact.page.text()")


def dropped(driver: Any, content: str, name: str = "c.json") -> str:
    """Drop a file on the page; what it says."""
    driver.execute_script(
        "const d = new DataTransfer(); d.items.add(new File([arguments[0]], arguments[1]));"
        "document.dispatchEvent(new DragEvent('drop', {dataTransfer: d, bubbles: true, cancelable: true}));",
        content,
        name,
    )
    quiet(driver)
    return driver.execute_script("return document.getElementById('note').textContent")


def all_values(driver: Any) -> list[list[float]]:
    return driver.execute_script("return homofact.page.history.state.map((c) => Array.from(c.values))")


def test_curves_go_to_a_file_and_back_bit_for_bit(page: Any, tmp_path: Path) -> None:
    page.execute_script(
        "const p = homofact.page; p.slide({sigma: 0.0731}); p.controls.edit(2, p.curvesOf(2)[1].index);"
        "p.edit(p.values.map((x, i) => x * (1 + Math.sin(i) / 3)));"
    )
    kept, content = all_values(page), text(page)
    (tmp_path / "c.json").write_text(content)
    found = read_curves(tmp_path / "c.json", materials())
    assert list(found) == [("paint", "specular", "distribution"), ("clay", "whole", "directions")]
    for address, index in zip(found, (2, 9), strict=True):
        assert found[address].values.reshape(-1).tolist() == kept[index]
    page.execute_script("homofact.page.resetAll()")
    assert all_values(page) != kept
    before = steps(page)
    assert dropped(page, content, "mine.json") == "mine.json is shown."
    assert all_values(page) == kept
    assert steps(page) == before + 1
    assert text(page) == content


def test_a_file_of_the_library_is_shown(page: Any, tmp_path: Path) -> None:
    session = Session(page_prepared())
    session.slide(("steel", "specular", "alpha"), nu=500.0)
    write_curves(tmp_path / "c.json", materials(), session.changed)
    assert dropped(page, (tmp_path / "c.json").read_text()) == "c.json is shown."
    off = torch.tensor(page.execute_script("return Array.from(homofact.radiance(0))")).double().reshape(-1, 3)
    expected = session.picture(0)
    assert float((off - expected).abs().max() / expected.abs().max()) < 2.0**-11


def entry(address: Address = ("clay", "whole", "half"), **given: Any) -> dict[str, Any]:
    own = {
        "material": address[0],
        "term": address[1],
        "curve": address[2],
        "angle": "theta_h",
        "bands": "finer near 0",
        "values": [[1, 1, 1]] * 32,
    }
    return own | given


def holding(*entries: dict[str, Any]) -> dict[str, Any]:
    return {**WHOLE, "curves": list(entries)}


WHOLE = {"format": "homofact curves", "format_version": 2, "channels": ["R", "G", "B"], "curves": [entry()]}


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("{", "file: found no JSON, expected edited curves in JSON."),
        ([1], "file: found [1], expected an object."),
        ({**WHOLE, "format": "x"}, 'format: found "x", expected homofact curves.'),
        ({**WHOLE, "format_version": 3}, "format_version: found 3, expected 2 at most"),
        (holding(entry(bands="even")), 'curves[0].bands: found "even", expected one of equal, finer near 0.'),
        ({**WHOLE, "channels": ["grey"]}, 'channels: found ["grey"], expected ["R","G","B"], as the materials have.'),
        ({**WHOLE, "curves": []}, "curves: found [], expected 1 to 10000 objects."),
        (holding(entry(("gold", "whole", "half"))), 'curves[0].material: found "gold", expected one of'),
        (holding(entry(("clay", "diffuse", "half"))), 'curves[0].term: found "diffuse", expected whole.'),
        (holding(entry(("clay", "whole", "x"))), 'curves[0].curve: found "x", expected one of half,'),
        (holding(entry(angle="theta_d")), 'curves[0].angle: found "theta_d", expected theta_h.'),
        (holding(entry(), entry()), 'curves[1].curve: found "half", expected each curve once.'),
        (holding(entry(values=[])), "curves[0].values: found 0 rows, expected 32 rows of 3 numbers."),
        (holding(entry(values=[[1, 1, 1]] * 31 + [[1, -1, 1]])), "curves[0].values[31]: found [1,-1,1], expected"),
        (holding(entry(values=[[1, None, 1]] * 32)), "curves[0].values[0]: found [1,null,1], expected 3"),
        (holding(entry(values=[[0, 0, 0]] * 32)), "curves[0].values: found 0 everywhere, expected some value"),
    ],
)  # fmt: skip
def test_a_wrong_file_is_a_line_and_changes_nothing(page: Any, content: Any, said: str) -> None:
    click(page, "#shapes button:nth-child(1)")
    kept = all_values(page)
    found = dropped(page, content if isinstance(content, str) else json.dumps(content))
    assert found.startswith(f"c.json: {said}")
    assert page.execute_script("return document.getElementById('note').className") == "note wrong"
    assert all_values(page) == kept
    assert steps(page) == 1


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
