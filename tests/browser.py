"""A headless Chromium for tests of pages, one a module; they are skipped with a message where there is none."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from homofact.errors import MissingDependency
from scripts.shared import headless


@contextmanager
def browser(folder: Path, *, webgl: bool = True, size: tuple[int, int] = (1440, 900)) -> Iterator[Any]:
    """A selenium driver with its profile under `folder`; skips the test that asks for it where it cannot start."""
    started = headless.chromium(folder / "profile", webgl=webgl, size=size)
    try:
        driver = started.__enter__()
    except MissingDependency as error:
        pytest.skip(f"{error}")
    try:
        yield driver
    finally:
        started.__exit__(None, None, None)


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

    messages = [json.loads(entry["message"])["message"] for entry in driver.get_log("performance")]
    urls = [m["params"]["request"]["url"] for m in messages if m["method"] == "Network.requestWillBeSent"]
    # The browser's own first tab may still be loading when the page is opened.
    return [url for url in urls if not url.startswith(("data:", "blob:", "chrome:", "chrome-untrusted:"))]
