"""The page of a prepared scene in a headless Chromium: its pictures, curves and albedo are the library's."""

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch
from editing.page_opened import HALF, begin, check_pictures, numbers_of, put, shown
from editing.page_scene import page_prepared, quiet

from homofact.editing.curves import Bands, band_centres
from homofact.editing.enlarged import clear_shares, enlarged
from homofact.editing.picture import Address, image
from homofact.editing.session import Session
from homofact.rendering.sphere import SphereImage
from homofact.rendering.tonemap import automatic_exposure, tonemap

PAINT: Address = ("paint", "specular", "distribution")


@pytest.fixture(autouse=True)
def fresh(page: Any) -> None:
    """The page as it began."""
    begin(page, root=False)


def wavy(curve: Bands, k: int) -> Bands:
    """A curve that differs from the old one in every band and channel."""
    place = torch.arange(curve.count, dtype=torch.float64)[:, None]
    channel = torch.arange(curve.channels, dtype=torch.float64)[None]
    return replace(curve, values=curve.values * (1.2 + 0.7 * torch.sin(0.37 * (k + 1) * place + channel)))


@pytest.mark.slow
def test_pictures_are_the_library_s(page: Any) -> None:
    check_pictures(page, Session(page_prepared()))


def test_every_curve_counts_as_in_the_library(page: Any) -> None:
    session = Session(page_prepared())
    for k, address in enumerate(session.curves):
        changed = {address: wavy(session.curves[address], k)}
        session.set(changed)
        put(page, changed)
        for view in range(2):
            off = shown(page, view) - session.picture(view)
            assert float(off.abs().max() / session.picture(view).abs().max()) < HALF, address
    check_pictures(page, session)
    assert page.execute_script("return homofact.page.history.undo() && homofact.page.history.undo()")
    session.undo()
    session.undo()
    check_pictures(page, session)


@pytest.mark.slow
def test_an_edit_comes_in_by_pieces_and_ends_exact(page: Any) -> None:
    session = Session(page_prepared())
    changed = {PAINT: wavy(session.curves[PAINT], 3)}
    session.set(changed)
    lacking = page.execute_script(
        "const p = homofact.page, view = p.views[0], found = [];"
        "const now = p.history.state[2].values; p.history.set([[2, {values: now.map((x, i) => x * (1 + (i % 5))),"
        " sliders: null}]]); while (found.length < 50) { view.update(p.history.state, -Infinity);"
        " found.push(view.pending); if (!view.pending) break; } return found;"
    )
    assert len(lacking) > 2
    assert lacking == sorted(lacking, reverse=True)
    assert lacking[-1] == 0
    put(page, changed)
    check_pictures(page, session)


@pytest.mark.slow
def test_sliders_are_the_models(page: Any) -> None:
    """A slider's curve, and the picture that it makes, are the library's."""
    session = Session(page_prepared())
    for address, values in (
        (PAINT, {"sigma": 0.071}),
        (("paint", "specular", "fresnel"), {"n": (0.2, 0.92, 1.1), "k": (3.9, 2.4, 0.0)}),
        (("steel", "specular", "alpha"), {"nu": 731.0}),
        (("steel", "specular", "beta"), {"nv": 3.5}),
    ):
        session.slide(address, **values)
        found = page.execute_script(
            "const p = homofact.page, c = p.curves[arguments[0]];"
            "p.controls.edit(c.material, c.index); p.slide(arguments[1]); return Array.from(p.values)",
            numbers_of(address),
            values,
        )
        assert np.array(found) == pytest.approx(session.curves[address].values.reshape(-1).numpy(), rel=1e-11)
    quiet(page)
    check_pictures(page, session)
    said = page.execute_script("return document.getElementById('sliders').innerText")
    assert said.split() == ["nv", "3.5"]


@pytest.mark.slow
def test_start_curves_are_the_models_at_their_numbers(page: Any) -> None:
    starts = page.execute_script(
        "return homofact.page.curves.filter((c) => c.formula).map((c) => [c.index, Array.from(homofact.bandedFormula("
        "c, c.sliders)), Array.from(c.start.values)])"
    )
    assert len(starts) == 4
    for _, made, start in starts:
        assert made == pytest.approx(start, rel=1e-12)


@pytest.mark.slow
def test_the_albedo_is_the_library_s_with_its_warning(page: Any) -> None:
    session = Session(page_prepared())
    start = session.curves["steel", "specular", "alpha"]
    bright = {("steel", "specular", "alpha"): replace(start, values=6 * start.values)}
    session.set(bright)
    put(page, bright)
    for number, name in enumerate(("paint", "steel", "clay", "floor")):
        found = page.execute_script(
            "const p = homofact.page; return Array.from(p.furnaces[arguments[0]].albedo(p.history.state))", number
        )
        assert found == pytest.approx(np.ravel(session.albedo(name).values).tolist(), rel=1e-5)
    page.execute_script("homofact.page.controls.edit(1)")
    wait_for(page, "return document.getElementById('albedo-warning').textContent !== ''")
    warning = session.albedo("steel").warning()
    assert warning is not None
    said = page.execute_script("return document.getElementById('albedo-warning').textContent")
    assert said.removesuffix(".").lower() == warning.lower()
    page.execute_script("homofact.page.resetAll()")
    wait_for(page, "return document.getElementById('albedo-warning').textContent === ''")


def test_the_albedo_follows_an_edit_that_takes_several_frames(page: Any) -> None:
    quiet(page)
    before = page.execute_script("return document.getElementById('albedo').textContent")
    # With no time left a frame sums no more than one column of the picture. What was to be read before is not.
    page.execute_script(
        "const p = homofact.page, draw = p.draw; p.budget = -1e6; window.unfinished = 0; clearTimeout(p.reading);"
        "p.draw = () => { draw.call(p); if (p.view.pending) window.unfinished += 1; };"
        "p.edit(p.values.map((each, k) => (2 + (k % 7)) * each))"
    )
    wait_for(
        page,
        "const p = homofact.page, furnace = p.furnaces[p.state.material];"
        "return !p.view.pending && p.pending === null &&"
        " document.getElementById('albedo').textContent ==="
        " furnace.largest(furnace.albedo(p.history.state)).value.toFixed(2)",
    )
    assert page.execute_script("return document.getElementById('albedo').textContent") != before
    assert page.execute_script("delete homofact.page.draw; return window.unfinished") > 0


def wait_for(driver: Any, script: str) -> None:
    """Until a script answers true."""
    driver.execute_async_script(
        f"const done = arguments[0]; const is = () => {{ {script} }};"
        "(function wait() { is() ? done() : setTimeout(wait, 20); })();"
    )


def pixels(driver: Any, view: int) -> np.ndarray:
    """(H, W, 3) of the canvas."""
    width, height = page_prepared().scene.cameras[view].pixels
    driver.execute_script("homofact.page.state.view = arguments[0]; homofact.changed('all')", view)
    quiet(driver)
    values = driver.execute_script(
        "const c = document.getElementById('canvas'), other = new OffscreenCanvas(c.width, c.height),"
        " context = other.getContext('2d', {willReadFrequently: true}); context.drawImage(c, 0, 0);"
        "return Array.from(context.getImageData(0, 0, c.width, c.height).data)"
    )
    return np.array(values).reshape(height, width, 4)[:, :, :3]


def mapped(session: Session, view: int, exposure: float, curve: str) -> np.ndarray:
    radiance, coverage = image(session.prepared, view, session.picture(view))
    return tonemap(SphereImage(radiance, coverage), exposure, 0.0, curve).pixels.numpy().astype(int)


@pytest.mark.slow
def test_what_is_seen_is_tone_mapped_as_elsewhere(page: Any) -> None:
    start, session = Session(page_prepared()), Session(page_prepared())
    exposure = automatic_exposure(SphereImage(*image(start.prepared, 0, start.picture(0))))
    seen = start.prepared.pixels
    # But for the ground where it ends, which shows the sky behind it.
    meshes = [edited.mesh for edited in start.prepared.scene.objects]
    covered = [each.numbers[clear_shares(meshes, each) == 0] for each in seen]
    assert all(0 < len(each) < len(own) for each, own in zip(covered, seen, strict=True))

    def same(found: np.ndarray, expected: np.ndarray, view: int) -> None:
        rows = covered[view]
        assert np.abs(found.reshape(-1, 3)[rows] - expected.reshape(-1, 3)[rows]).max() <= 1

    same(pixels(page, 0), mapped(start, 0, exposure, "filmic"), 0)
    changed = {PAINT: wavy(session.curves[PAINT], 1), ("floor", "diffuse", "outgoing"): Bands(0.5 + torch.rand(256, 3))}
    session.set(changed)
    put(page, changed)
    for view in range(2):
        after, before = (mapped(each, view, exposure, "filmic") for each in (session, start))
        same(pixels(page, view), after, view)
        assert np.abs(after - before).max() > 10
        page.execute_script("homofact.state.show = 'before'")
        same(pixels(page, view), before, view)
        page.execute_script("homofact.state.show = 'split'; homofact.state.split = 0.25")
        cut = after.shape[1] // 4
        both = np.concatenate((before[:, :cut], after[:, cut:]), 1)
        same(pixels(page, view), both, view)
        page.execute_script("homofact.state.show = 'after'")
    page.execute_script("homofact.state.tones = 'srgb'; homofact.page.stops = -1")
    same(pixels(page, 0), mapped(session, 0, 0.5, "srgb"), 0)


@pytest.mark.slow
def test_the_status_says_whether_the_picture_is_finished(page: Any) -> None:
    status = "return document.getElementById('status').textContent"
    finished = "return !document.getElementById('settled').hidden"
    wait_for(page, finished)
    assert re.fullmatch(r"nothing edited( · [\d.]+ ms)? · finished, \d+ × \d+ pixels", page.execute_script(status))
    # No picture is finished while a curve is being dragged.
    page.execute_script(
        "const p = homofact.page; p.beginStep(); p.setValues(p.values.map((x, i) => x * (1 + (i % 3))))"
    )
    quiet(page)
    assert re.fullmatch(r"1 curve edited · [\d.]+ ms · draft, 28 × 20 pixels", page.execute_script(status))
    page.execute_script("homofact.page.endStep()")
    wait_for(page, finished)
    width, height = page.execute_script("const c = document.getElementById('settled'); return [c.width, c.height]")
    assert page.execute_script(status).endswith(f" · finished, {width} × {height} pixels")


@pytest.mark.slow
def test_the_plot_names_its_axes(page: Any) -> None:
    words = page.execute_script(
        "const p = homofact.page, own = CanvasRenderingContext2D.prototype, fill = own.fillText, found = [];"
        "own.fillText = function (text, ...more) { found.push(text); fill.call(this, text, ...more); };"
        "for (const root of [false, true]) { p.state.root = p.state.logs = root; p.drawPlot(); }"
        "own.fillText = fill; return found.filter((text) => /[a-z]{3}/.test(text))"
    )
    assert words == ["θh in degrees", "value", "θh in degrees (square-root scale)", "value (logarithmic scale)"]


def test_the_settled_picture_is_the_enlarged_one(page: Any) -> None:
    """In four times as many pixels per side as were precomputed, split by a divider."""
    start, session = Session(page_prepared()), Session(page_prepared())
    clay: Address = ("clay", "whole", "half")
    changed: dict[Address, Bands] = {clay: wavy(session.curves[clay], 1)}
    session.set(changed)
    put(page, changed)
    width, height = (4 * side for side in start.prepared.scene.cameras[0].pixels)
    found = page.execute_script(
        "const p = homofact.page, [width, height, exposure] = arguments, [first] = p.history.states;"
        "p.settled.draw(p.view, p.view.radiance, p.view.other(first), 0.5, [width, height], exposure, 'srgb');"
        "const gl = p.settled.gl, bytes = new Uint8Array(4 * width * height);"
        "gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, bytes); return Array.from(bytes)",
        width, height, 1.5,
    )  # fmt: skip
    shown = np.array(found).reshape(height, width, 4)[::-1, :, :3].astype(int)
    expected = []
    for each in (start, session):
        picture = enlarged(each.prepared, 0, each.picture(0), 4).radiance
        whole = SphereImage(picture, torch.ones(picture.shape[:2], dtype=torch.float64))
        expected.append(tonemap(whole, 1.5).pixels.numpy().astype(int))
    half = width // 2
    both = np.concatenate((expected[0][:, :half], expected[1][:, half:]), 1)
    off = np.abs(shown - both).max(2)
    # Outlines are averaged in linear light there and after the tone curve here, and the page's sky is smoothed.
    assert np.median(off) <= 1
    assert (off > 4).mean() < 0.12
    assert (off > 30).mean() < 0.02
    edit = np.abs(expected[0] - expected[1]).max(2)
    assert edit[:, half:].max() > 10
    assert off[edit > 10].mean() < 0.3 * edit[edit > 10].mean()
    # The small picture comes again while something is dragged, and the settled one after it.
    page.execute_script("homofact.page.beginStep(); homofact.changed('all')")
    quiet(page)
    assert page.execute_script("return document.getElementById('settled').hidden") is True
    page.execute_script("homofact.page.endStep()")
    quiet(page)
    page.execute_async_script(
        "const done = arguments[0]; (function wait() {"
        " document.getElementById('settled').hidden ? setTimeout(wait, 20) : done(); })()"
    )
    size = page.execute_script(
        "const b = homofact.page.box(), c = homofact.page.settled.canvas; return [b.width, c.width]"
    )
    assert size[1] == pytest.approx(size[0], abs=1)


@pytest.mark.slow
def test_bands_have_their_centres_where_the_page_says(page: Any) -> None:
    page.execute_script("homofact.state.band = 8; homofact.changed('plot')")
    quiet(page)
    degrees = np.degrees(float(band_centres(64, finer=True)[8]))
    said = page.execute_script("return document.getElementById('point').textContent")
    assert said.startswith(f"θh {degrees:.1f}°: ")
