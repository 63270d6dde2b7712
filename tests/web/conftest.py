"""A browser a module, and a page of layers in it that has to be silent."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from browser import browser, complaints, headless, requests
from viewer_page import SIDE, shrink

from homofact.web.viewer import Layer, write_viewer


@pytest.fixture(scope="module")
def chromium(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    with browser() as driver:
        yield driver


@pytest.fixture
def show(chromium: Any, tmp_path: Path) -> Iterator[Callable[..., Any]]:
    """Opens a page of layers, under the point light unless `link` says otherwise, with pictures `side` pixels wide.

    Afterwards the page must have been silent and must have asked for nothing else.
    """

    def show(*layers: Layer, link: str = "#light=directional", side: int = SIDE, **more: Any) -> Any:
        path = tmp_path / "page.html"
        write_viewer(path, layers, title="A test", **more)
        chromium.get("about:blank")
        # Software takes long for a large first picture.
        headless.resize(chromium, (1440, 900) if side == SIDE else (480, 480))
        headless.open_page(chromium, path, link)
        shrink(chromium, side)
        return chromium

    complaints(chromium)
    requests(chromium)
    yield show
    assert complaints(chromium) == []
    assert set(requests(chromium)) <= {(tmp_path / "page.html").as_uri(), "about:blank"}
