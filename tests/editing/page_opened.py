"""The page of a prepared scene, opened for tests, and what hands do to it."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import torch
from browser import browser, complaints, headless, requests
from editing.page_scene import page_prepared, quiet
from selenium.webdriver.common.action_chains import ActionChains

from homofact.editing.curves import Bands
from homofact.editing.picture import Address
from homofact.editing.session import Session

# What a half float leaves of each value.
HALF = 2.0**-11


@contextmanager
def opened_page(folder: Path) -> Iterator[Any]:
    """The page in a tab of its own; it must stay silent and ask for nothing."""
    from homofact.editing.page.build import write_edit_page

    with browser() as driver:
        write_edit_page(folder / "edit.html", page_prepared(), title="A test")
        complaints(driver)
        requests(driver)
        headless.open_page(driver, folder / "edit.html")
        quiet(driver)
        yield driver
        assert complaints(driver) == []
        assert set(requests(driver)) <= {(folder / "edit.html").as_uri()}


def begin(driver: Any, *, root: bool) -> None:
    """Put the page back as it began, with the axis of angles as their roots or not."""
    driver.execute_script(
        "const p = homofact.page; p.step = p.axisHeld = null; p.history.states.length = 1; p.history.now = 0;"
        "p.history.kept.length = 1; p.controls.fillKept(); p.budget = 1e6; p.note('');"
        "Object.assign(p.state, {view: 0, tool: 'brush', channel: null, logs: false, root: arguments[0], band: 8,"
        " show: 'after', compare: 0, split: 0.5, tones: 'filmic'}); p.preview.reset(); p.controls.edit(0, 2);"
        "document.activeElement?.blur(); p.changed('all');",
        root,
    )
    quiet(driver)
    # The exposure is that of the radiance, once it is what the page began with.
    driver.execute_script("homofact.page.expose(homofact.page.start); homofact.changed('all')")
    quiet(driver)


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


def numbers_of(address: Address) -> int:
    """The curve's number on the page."""
    places = [
        (thing.material.name, *place) for thing in page_prepared().scene.objects for place in thing.material.places
    ]
    return places.index(address)


def put(driver: Any, curves: dict[Address, Bands]) -> None:
    """Set curves on the page in one step."""
    driver.execute_script(
        "homofact.page.history.set(arguments[0].map(([k, v]) => [k, {values: Float64Array.from(v), sliders: null}]));"
        "homofact.changed('all');",
        [[numbers_of(address), curve.values.reshape(-1).tolist()] for address, curve in curves.items()],
    )
    quiet(driver)


def shown(driver: Any, view: int) -> torch.Tensor:
    """Radiance (P, 3) of the page."""
    values = driver.execute_script("return Array.from(homofact.radiance(arguments[0]))", view)
    return torch.tensor(values, dtype=torch.float64).reshape(-1, 3)


def check_pictures(driver: Any, session: Session) -> None:
    """Every view is the library's, to less than half floats would leave."""
    for view in range(len(session.prepared.pixels)):
        expected = session.picture(view)
        off = shown(driver, view) - expected
        assert float(off.square().mean().sqrt() / expected.square().mean().sqrt()) < HALF / 2
        assert float(off.abs().max() / expected.abs().max()) < 1.25 * HALF
