"""What leaves the page in a headless Chromium: a link that keeps the view, a picture's file; and a phone's width."""

import base64
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from browser import headless
from PIL import Image
from shading_cases import CASES
from viewer_page import change, shown_note, shrink

from homofact.web.layers import fit_layer

pytestmark = pytest.mark.slow

Open = Callable[..., Any]
LAYERS = [fit_layer(CASES["fixed h"], key, key) for key in ("fit", "mccool", "source")]
KEPT = ("visible", "surface", "light", "lightFrom", "camera", "zoom", "stops", "difference", "factor")


def state(driver: Any) -> dict[str, Any]:
    found = driver.execute_script("return structuredClone(window.homofact.state)")
    return {name: found[name] for name in KEPT}


def link(driver: Any) -> str:
    return driver.execute_async_script("setTimeout(() => arguments[0](location.hash), 400)")


def test_a_link_brings_back_the_view(show: Open, tmp_path: Path) -> None:
    driver = show(*LAYERS, side=48)
    change(
        driver, visible=["fit", "source"], surface="mesh", light="directional", zoom=1.5, stops=-1.3,
        difference="ratio", factor=16, camera={"azimuth": -20.25, "elevation": 12},
        lightFrom={"azimuth": 100, "elevation": -5.5},
    )  # fmt: skip
    before, address = state(driver), link(driver)
    assert address.startswith("#show=fit,source&on=mesh&light=directional&")
    driver.get("about:blank")
    headless.open_page(driver, tmp_path / "page.html", address)
    shrink(driver, 16)
    assert state(driver) == before
    # Another link in the same page, by hand.
    driver.execute_script("location.hash = '#light=overcast&camera=10,20'")
    link(driver)
    assert state(driver) == before | {
        "light": "overcast", "camera": {"azimuth": 10, "elevation": 20}, "stops": state(driver)["stops"],
    }  # fmt: skip


def test_a_page_that_is_only_opened_keeps_its_address(show: Open) -> None:
    driver = show(LAYERS[0], link="", side=16)
    assert link(driver) == ""
    change(driver, zoom=1.15)
    assert "zoom=1.15" in link(driver)


UNREADABLE = (
    "light=fog", "camera=1", "camera=1,2,3", "camera=a,b", "camera=0,90", "zoom=NaN", "zoom=1e99", "stops=9", "show=",
    "show=none", "show=fit,fit", "factor=3", "difference", "what=1", "zoom=1&zoom=2", "light=%E0%A4%A", "on=<b>",
    "light=sky&zoom=-1",
)  # fmt: skip


def test_a_link_that_cannot_be_read_is_left_out_and_said(show: Open) -> None:
    driver = show(LAYERS[0], side=16)
    before = state(driver)
    for each in UNREADABLE:
        said = driver.execute_async_script(
            "document.getElementById('note').textContent = ''; location.hash = arguments[0];"
            "setTimeout(() => arguments[1](document.getElementById('note').textContent), 40)",
            f"#{each}",
        )
        assert said.startswith("The link's view cannot be read ("), each
        assert shown_note(driver)[1]
        assert state(driver) == before, each


def test_a_saved_picture_shows_the_pictures_side_by_side(show: Open, tmp_path: Path) -> None:
    driver = show(*LAYERS)
    change(driver, visible=["fit", "source"])
    data, name = driver.execute_async_script(
        "const done = arguments[0], create = URL.createObjectURL; let blob;"
        "URL.createObjectURL = (each) => { blob = each; return create(each); };"
        "HTMLAnchorElement.prototype.click = function () { const reader = new FileReader();"
        " reader.onload = () => done([reader.result, this.download]); reader.readAsDataURL(blob); };"
        "document.getElementById('save-button').click();"
    )
    assert name == "A-test-sphere-directional.png"
    place = tmp_path / "saved.png"
    place.write_bytes(base64.b64decode(data.partition(",")[2]))
    with Image.open(place) as picture:
        assert picture.size == (2 * 200 + 8, 200 + 44)
        pixels = picture.convert("RGB")
        left, right = (pixels.crop((x, 44, x + 200, 244)) for x in (0, 208))
        assert left.tobytes() == right.tobytes()
        colours = left.getcolors(1 << 20)
        assert colours is not None
        assert len(colours) > 50
        words = pixels.crop((0, 0, 200, 44)).getcolors(1 << 20)
        assert words is not None
        assert len(words) > 5
    assert shown_note(driver) == ("Saved as A-test-sphere-directional.png.", False)


def test_on_a_phone_the_picture_is_first_and_fingers_reach_everything(show: Open) -> None:
    driver = show(*LAYERS)
    headless.resize(driver, (420, 900))
    try:
        shrink(driver, 48)
        wide, tops, sizes, names = driver.execute_script(
            "const top = (s) => document.querySelector(s).getBoundingClientRect().top;"
            "const controls = [...document.querySelectorAll('aside button, aside input[type=range], .actions button')]"
            " .filter((e) => e.offsetParent);"
            "return [document.documentElement.scrollWidth, [top('.picture'), top('aside'), top('#numbers')],"
            " controls.map((e) => e.getBoundingClientRect().height),"
            " controls.map((e) => (e.textContent || e.labels?.[0]?.textContent || '').trim())]"
        )
    finally:
        headless.resize(driver, (1440, 900))
    assert wide <= 420
    assert tops == sorted(tops)
    assert tops[0] < 300
    assert len(sizes) > 15
    assert min(sizes) >= 40
    assert all(names)
