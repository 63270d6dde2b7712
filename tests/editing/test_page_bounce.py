"""Light between surfaces on the page in a headless Chromium: pictures are the library's, whatever is edited."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest
import torch
from browser import browser, complaints, headless
from editing.page_scene import page_scene, quiet

from homofact.editing.page.build import scene_numbers, write_edit_page
from homofact.editing.precompute import prepare
from homofact.editing.scene import PreparedScene
from homofact.editing.session import Session

# As in test_page_browser: a quarter of what a half float leaves of each value.
MOST = 2.0**-12


@pytest.fixture(scope="module")
def prepared() -> PreparedScene:
    """Two balls on a floor of squares, seen once."""
    scene = page_scene()
    objects = scene.objects[0], scene.objects[2], scene.objects[3]
    return prepare(replace(scene, objects=objects, cameras=scene.cameras[:1], bounces=1), 60)


@pytest.fixture(scope="module")
def page(prepared: PreparedScene, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    folder = tmp_path_factory.mktemp("page")
    write_edit_page(folder / "edit.html", prepared)
    with browser() as driver:
        headless.open_page(driver, folder / "edit.html")
        quiet(driver)
        yield driver
        assert complaints(driver) == []


def shown(driver: Any, script: str = "homofact.radiance(0)") -> torch.Tensor:
    values = driver.execute_script(f"return Array.from({script})")
    return torch.tensor(values, dtype=torch.float64).reshape(-1, 3)


def off(found: torch.Tensor, session: Session) -> float:
    expected = session.picture(0)
    return float((found - expected).square().mean().sqrt() / expected.square().mean().sqrt())


def test_edits_of_senders_and_receivers_are_the_library_s(page: Any, prepared: PreparedScene) -> None:
    session = Session(prepared)
    start = session.picture(0)
    assert off(shown(page), session) < MOST
    for number, address in enumerate(session.curves):
        curve = session.curves[address]
        place = torch.arange(curve.count, dtype=torch.float64)[:, None]
        channel = torch.arange(3, dtype=torch.float64)[None]
        changed = replace(curve, values=curve.values * (1.2 + 0.7 * torch.sin(0.3 * place + channel)))
        session.set({address: changed})
        page.execute_script(
            "homofact.page.history.set([[arguments[0], {values: Float64Array.from(arguments[1]), sliders: null}]]);"
            "homofact.changed('all');",
            number,
            changed.values.reshape(-1).tolist(),
        )
        quiet(page)
        assert off(shown(page), session) < MOST, address
        # The picture as it began, beside the edited one.
        before = shown(page, "homofact.page.view.other(homofact.page.start)")
        assert float((before - start).abs().max() / start.abs().max()) < 4 * MOST, address


def test_the_page_names_the_parts_that_are_light_of_surfaces(prepared: PreparedScene) -> None:
    names = list(scene_numbers(prepared)["floor"])
    assert names == ["pixels", "diffuse, 256 bands", "diffuse, from surfaces, 256 bands"]
