"""The page of a relit scene, opened once in a headless Chromium for all tests of it, and an opened scene."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import relit_scene
from browser import browser, complaints, headless, requests
from relighting import ball_scene
from relit_page import colours_of, shrink
from relit_scene import CAMERA

from homofact.relighting import build
from homofact.relighting.build import RelightScene, open_relight_scene
from homofact.relighting.page import coarse
from homofact.relighting.page.build import PageReference, write_page


@pytest.fixture(scope="package")
def chromium(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    with browser() as driver:
        yield driver


@pytest.fixture(scope="package")
def reference() -> PageReference:
    """The library's own colours, a tenth too bright, with none for the first seventh of the vertices."""
    given = relit_scene.scene()
    found = [1.1 * colours_of(each, given.skies[0].cube, CAMERA.eye).astype(float) for each in given.objects]
    for each in found:
        each[: len(each) // 7] = np.nan
    return PageReference(found)


@pytest.fixture(scope="package")
def page(chromium: Any, tmp_path_factory: pytest.TempPathFactory, reference: PageReference) -> Iterator[Any]:
    """The page, opened once; it must stay silent and ask for nothing."""
    given = relit_scene.scene()
    path = tmp_path_factory.mktemp("page") / "relit.html"
    with pytest.MonkeyPatch.context() as patch:
        # The knot has few triangles: it gets a coarse form all the same.
        patch.setattr(coarse, "FEW", 500)
        write_page(
            path, given.objects, given.skies, {"Knot": {"vertices": 384}}, reference, title="A test", camera=CAMERA
        )
    complaints(chromium)
    requests(chromium)
    headless.open_page(chromium, path)
    shrink(chromium)
    yield chromium
    assert complaints(chromium) == []
    assert set(requests(chromium)) <= {path.as_uri()}


@pytest.fixture(scope="module")
def decomposed_once() -> Iterator[None]:
    """Materials that many scenes share are decomposed once."""
    from relighting_cases import factored_once

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(build, "factored", factored_once)
        yield


@pytest.fixture(scope="module")
def ready(decomposed_once: None, tmp_path_factory: pytest.TempPathFactory) -> RelightScene:
    """The scene of `ball_scene`, opened."""
    return open_relight_scene(ball_scene.read(tmp_path_factory.mktemp("scene")))


@pytest.fixture(autouse=True)
def fresh(request: pytest.FixtureRequest) -> None:
    """The page as it began, for each test that uses it."""
    if "page" in request.fixturenames:
        driver = request.getfixturevalue("page")
        driver.execute_script(
            "const v = homofact.view; v.orbit.reset(); v.skies.length = 2; v.controls.skies();"
            "Object.assign(v.state, {sky: 0, turn: 0, terms: v.mostTerms, kept: v.mostKept, interpolation: 'vertex',"
            " signal: false, stops: 0, curve: 'filmic', show: 'picture', split: 0.5, range: 0.1, pieces: true,"
            " turning: false}); v.lightBudget = 1e6; v.changed('kept'); v.changed('light');"
        )
        headless.settled(driver)
