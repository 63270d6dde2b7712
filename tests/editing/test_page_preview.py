"""The page's preview sphere in a headless Chromium, and the page where a browser cannot draw it."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from browser import browser, headless
from editing.page_opened import begin, check_pictures, put
from editing.page_scene import materials, page_prepared, quiet

from homofact.editing.curves import Bands, band_place
from homofact.editing.page.quotients import quotient_table
from homofact.editing.picture import Address
from homofact.editing.session import Session
from homofact.geometry.directions import normalize
from homofact.rendering.sphere import SphereImage
from homofact.rendering.tonemap import automatic_exposure

PAINT: Address = ("paint", "specular", "distribution")


@pytest.fixture(autouse=True)
def fresh(page: Any) -> None:
    """The page as it began."""
    begin(page, root=False)


@pytest.mark.slow
def test_the_preview_shows_the_edited_material(page: Any) -> None:
    """Radiance of the sphere against the material itself, for every material, turned, with the light moved."""
    session, size = Session(page_prepared()), 48
    session.slide(PAINT, sigma=0.35)
    session.slide(("steel", "specular", "beta"), nv=20.0)
    put(page, session.changed)
    for number, (name, most) in enumerate((("paint", 0.03), ("steel", 0.02), ("clay", 0.02), ("floor", 1e-3))):
        values, axes, light = page.execute_script(
            "const p = homofact.page; p.preview.turn(25, -10); p.preview.move(-15, 10);"
            "const l = p.preview.light, a = l.azimuth * Math.PI / 180, e = l.elevation * Math.PI / 180;"
            "return [Array.from(p.preview.radiance(arguments[0], p.history.state, arguments[1])), p.preview.axes,"
            " [Math.cos(e) * Math.sin(a), Math.sin(e), Math.cos(e) * Math.cos(a)]]",
            number,
            size,
        )
        found = torch.tensor(values, dtype=torch.float64).reshape(size * size, 4)
        expected = sphere_of(session, name, torch.tensor(axes).double().reshape(3, 3), torch.tensor(light).double())
        covered = found[:, 3] > 0
        off = (found[covered, :3] - expected[covered]).square().mean().sqrt() / expected[covered].square().mean().sqrt()
        assert float(off) < most, name


@pytest.mark.slow
def test_the_preview_is_exposed_like_a_picture(page: Any) -> None:
    """Of all channels and the highlight: by the green of a red paint alone, its red would be white."""
    for number in range(4):
        values, stops = page.execute_script(
            "const p = homofact.page, [number] = arguments; p.preview.materials[number].stops = null;"
            "p.preview.draw(number, p.start, p.start, 'filmic');"
            "return [Array.from(p.preview.radiance(number, p.start, 64)), p.preview.materials[number].stops]",
            number,
        )
        found = torch.tensor(values, dtype=torch.float64).reshape(64, 64, 4)
        expected = automatic_exposure(SphereImage(found[..., :3], found[..., 3]))
        assert stops == pytest.approx(math.log2(expected), abs=1e-3)


@pytest.mark.slow
def test_the_preview_says_how_far_off_it_is(page: Any) -> None:
    said = []
    for number in (0, 3):
        page.execute_script("homofact.page.controls.edit(arguments[0])", number)
        quiet(page)
        said.append(page.execute_script("return document.getElementById('preview-note').textContent"))
    shown = "The sphere shows the material under one light, without shadows."
    error = max(quotient_table(term).error(term) for term in materials()[0].terms)
    assert said[0].startswith(f"{shown} It reads the material from a coarse table, so its brightness is off by ")
    assert float(said[0].split("off by ")[1].split("%")[0]) == pytest.approx(100 * error, rel=0.05)
    # The floor's quotient is one number.
    assert said[1] == shown


@dataclass(frozen=True)
class Between:
    """Straight lines from the middle of a band to the next, as the preview has them."""

    bands: Bands

    @property
    def channels(self) -> int:
        return self.bands.channels

    def at(self, gamma: torch.Tensor) -> torch.Tensor:
        last = self.bands.count - 1
        place = (band_place(gamma, self.bands.count, self.bands.finer) - 0.5).clamp(0, last)
        low = place.floor().long().clamp_max(last - 1)
        return torch.lerp(self.bands.values[low], self.bands.values[low + 1], (place - low)[:, None])


def sphere_of(session: Session, name: str, axes: torch.Tensor, light: torch.Tensor) -> torch.Tensor:
    """Radiance (48², 3), rows from below, of a sphere; `axes` are right, up and towards the viewer."""
    side = ((torch.arange(48, dtype=torch.float64) + 0.5) / 48 * 2 - 1) / 0.94
    y, x = torch.meshgrid(side, side, indexing="ij")
    inside = 1 - x**2 - y**2
    n = normalize(torch.stack((x, y, inside.clamp_min(1e-9).sqrt()), -1).reshape(-1, 3) @ axes)
    t = normalize(torch.stack((n[:, 2], torch.zeros(len(n)), -n[:, 0]), 1))
    frame = torch.stack((t, torch.linalg.cross(n, t), n), 1)
    wi, wo = frame @ light, frame @ axes[2]
    curves = {address[1:]: Between(curve) for address, curve in session.curves.items() if address[0] == name}
    radiance = session.material(name).edited(curves).evaluate(wi, wo) * wi[:, 2:].clamp_min(0) * np.pi
    return torch.where(inside.reshape(-1, 1) > 0, radiance, torch.zeros_like(radiance))


@pytest.mark.slow
def test_without_webgl_all_but_the_preview_works(tmp_path: Path) -> None:
    from homofact.editing.page.build import write_edit_page

    with browser(webgl=False) as driver:
        write_edit_page(tmp_path / "p.html", page_prepared())
        headless.open_page(driver, tmp_path / "p.html")
        quiet(driver)
        said = driver.execute_script("return document.getElementById('no-preview').textContent")
        assert said.startswith("The preview sphere is drawn with WebGL 2, which is not available here.")
        put(driver, {PAINT: page_prepared().scene.objects[0].material.banded_start()[PAINT[1:]]})
        check_pictures(driver, Session(page_prepared()))
        # Without unpacking there is nothing to show.
        script = {"source": "delete window.DecompressionStream"}
        driver.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", script)
        headless.open_page(driver, tmp_path / "p.html")
        trouble = driver.execute_script("return document.getElementById('trouble').innerText")
        assert trouble.startswith("This browser cannot unpack the page's data.")
