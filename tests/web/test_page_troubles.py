"""What the page says in a headless Chromium where something is missing, broken or damaged."""

from pathlib import Path
from typing import Any

import pytest
from browser import browser, complaints, headless
from shading_cases import CASES

from homofact.web.layers import fit_layer
from homofact.web.viewer import Layer, write_viewer

pytestmark = pytest.mark.slow

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
    with browser(webgl=False) as driver:
        said = trouble(driver, tmp_path / "page.html", fit_layer(CASES["fixed h"], "fit", "Fit"))
        assert said.startswith("This page draws with WebGL 2, which is not available here.")
        assert "hardware acceleration" in said
        assert driver.execute_script("return document.querySelectorAll('.actions button:not([hidden])').length") == 0
