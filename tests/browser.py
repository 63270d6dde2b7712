"""A headless Chromium for tests of pages: one for all modules, each with a tab of its own.

Tests are skipped with a message where there is no browser. A browser takes over two seconds of a processor to start,
a tab less than half a second.
"""

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest

from homofact.errors import MissingDependency
from scripts.shared import headless


class _Browser:
    """A browser that stays open until `end_browsers`, with the number of the tab that commands go to."""

    def __init__(self, webgl: bool) -> None:
        """Start it. Raises MissingDependency where there is none."""
        self.folder = Path(tempfile.mkdtemp(prefix="homofact-browser-"))
        self._started = headless.chromium(self.folder / "profile", webgl=webgl)
        try:
            self.driver = self._started.__enter__()
        except BaseException:
            shutil.rmtree(self.folder, ignore_errors=True)
            raise
        self.first = self.shown = self.driver.current_window_handle

    def show(self, tab: str) -> None:
        """Bring a tab to the front, if it is not there: pages that nobody sees draw nothing."""
        if tab != self.shown:
            self.driver.switch_to.window(tab)
            self.driver.execute_cdp_cmd("Page.bringToFront", {})
            self.shown = tab

    def end(self) -> None:
        with suppress(Exception):
            self._started.__exit__(None, None, None)
        shutil.rmtree(self.folder, ignore_errors=True)


class _Tab:
    """A selenium driver of one tab: it comes to the front whenever it is used, since other tabs are used in between."""

    def __init__(self, browser: _Browser) -> None:
        browser.show(browser.first)
        browser.driver.switch_to.new_window("tab")
        self._browser, self._handle = browser, browser.driver.current_window_handle
        browser.shown = self._handle

    def __getattr__(self, name: str) -> Any:
        self._browser.show(self._handle)
        return getattr(self._browser.driver, name)

    def leave(self) -> None:
        """Close the tab."""
        self.close()
        self._browser.shown = ""
        self._browser.show(self._browser.first)


# By whether pages find WebGL.
_OPEN: dict[bool, _Browser] = {}
# Addresses by the tab that asked for them, of tabs whose own have not been looked at since.
_REQUESTS: dict[str, list[str]] = {}


def end_browsers() -> None:
    """End the browsers that `browser` has started."""
    while _OPEN:
        _OPEN.popitem()[1].end()


def _new_tab(webgl: bool) -> _Tab:
    """A tab of the browser that is open, of a new one where there is none or it no longer answers."""
    from selenium.common.exceptions import WebDriverException

    if webgl in _OPEN:
        try:
            return _Tab(_OPEN[webgl])
        except WebDriverException:
            _OPEN.pop(webgl).end()
    _OPEN[webgl] = _Browser(webgl)
    return _Tab(_OPEN[webgl])


@contextmanager
def browser(*, webgl: bool = True, size: tuple[int, int] = (1440, 900)) -> Iterator[Any]:
    """A selenium driver of a new tab of `size`; skips the test that asks for it where no browser can start."""
    try:
        headless.required()
        driver = _new_tab(webgl)
    except MissingDependency as error:
        pytest.skip(f"{error}")
    headless.resize(driver, size)
    complaints(driver)
    requests(driver)
    try:
        yield driver
    finally:
        driver.leave()


def skip_without_browser() -> None:
    """Skip a test of what starts a browser itself where there is none; starts none."""
    try:
        headless.required()
    except MissingDependency as error:
        pytest.skip(f"{error}")


def complaints(driver: Any) -> list[str]:
    """What the page has said on its console since the last call."""
    return [entry["message"] for entry in driver.get_log("browser")]


def requests(driver: Any) -> list[str]:
    """Addresses that the page has asked for since the last call, those inside itself left out."""
    import json

    for entry in driver.get_log("performance"):
        found = json.loads(entry["message"])
        if found["message"]["method"] == "Network.requestWillBeSent":
            _REQUESTS.setdefault(found["webview"], []).append(found["message"]["params"]["request"]["url"])
    urls = _REQUESTS.pop(driver.current_window_handle, [])
    # The browser's own first tab may still be loading when the page is opened.
    return [url for url in urls if not url.startswith(("data:", "blob:", "chrome:", "chrome-untrusted:"))]
