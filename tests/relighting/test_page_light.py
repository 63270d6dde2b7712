"""The light on the page of a relit scene is the library's: its sums, skies, changes in pieces, dropped files."""

import math
from typing import Any

import numpy as np
import pytest
import relit_scene
import torch
from browser import headless
from relit_page import ANGLE, change, check_colours, check_tuples, off, page_tuples, slide
from relit_scene import SIZE, largest, tuples

from homofact.relighting import cube
from homofact.relighting.errors import relative
from homofact.relighting.relight import Relit, light_coefficients
from homofact.rendering.light import EnvironmentMap


@pytest.mark.slow
def test_light_and_view_are_the_library_s(page: Any) -> None:
    check_tuples(page, relit_scene.scene().skies[0].cube)
    check_colours(page, relit_scene.scene().skies[0].cube)


def test_vectors_are_in_falling_order_of_magnitude(page: Any) -> None:
    """So that the page's N largest are the first N; of equals the one of the lower place first."""
    for number, given in enumerate(relit_scene.scene().objects):
        index, numbers = page.execute_script(
            "const { index, number } = homofact.view.objects[arguments[0]];"
            "return [Array.from(index), Array.from(number)]",
            number,
        )
        basis = given.basis
        vector = np.repeat(np.arange(len(basis.scale)), np.diff(basis.start))
        order = np.lexsort((basis.index, -np.abs(basis.number.astype(int)), vector))
        assert np.array_equal(index, basis.index[order])
        assert np.array_equal(numbers, basis.number[order])


@pytest.mark.slow
def test_another_sky_and_a_turned_one(page: Any) -> None:
    sky = relit_scene.scene().skies[1]
    change(page, sky=1)
    check_tuples(page, sky.cube)
    for angle in (ANGLE, -150.0):
        change(page, turn=angle)
        check_tuples(page, cube.environment_cube(sky.environment(math.radians(angle)), SIZE))
    # The light at once is the same as piece by piece.
    change(page, pieces=False, turn=ANGLE)
    check_tuples(page, cube.environment_cube(sky.environment(math.radians(ANGLE)), SIZE))


@pytest.mark.slow
def test_a_turned_sky_is_resampled_beside_the_page(page: Any) -> None:
    """In a worker, the newest turn alone; where no worker may start, the page does it itself."""
    sky = relit_scene.scene().skies[0]
    said = page.execute_script(
        "const v = homofact.view, t = v.turner, sent = []; const send = t.send;"
        "t.send = (sky, turn) => { sent.push(turn); send.call(t, sky, turn); }; window.sent = sent;"
        "const before = Array.from(v.objects[0].lit);"
        "for (const turn of [10, 20, 30, 40]) { v.state.turn = turn; v.changed('light'); v.frame(0); }"
        "return [t.worker !== null, t.busy, v.idle, before.every((x, k) => x === v.objects[0].lit[k])]"
    )
    assert said == [True, True, False, True]
    headless.settled(page)
    assert page.execute_script("return sent") == [10, 40]
    check_tuples(page, cube.environment_cube(sky.environment(math.radians(40)), SIZE))
    # Back before the answer: it is no longer wanted.
    page.execute_script(
        "const v = homofact.view; v.state.turn = 50; v.changed('light'); v.frame(0);"
        "v.state.turn = 0; v.changed('light'); v.frame(0);"
    )
    headless.settled(page)
    check_tuples(page, sky.cube)
    page.execute_script("window.held = homofact.view.turner.worker; homofact.view.turner.worker = null")
    change(page, turn=ANGLE)
    page.execute_script("homofact.view.turner.worker = held; delete homofact.view.turner.send")
    check_tuples(page, cube.environment_cube(sky.environment(math.radians(ANGLE)), SIZE))


@pytest.mark.slow
def test_a_worker_that_fails_leaves_its_turn_to_the_page(page: Any) -> None:
    page.execute_script(
        "const v = homofact.view, t = v.turner; window.held = t.worker;"
        "v.state.turn = 70; v.changed('light'); v.frame(0); t.worker.onerror(new Event('error'));"
    )
    headless.settled(page)
    assert page.execute_script("return homofact.view.turner.busy") is False
    sky = relit_scene.scene().skies[0]
    check_tuples(page, cube.environment_cube(sky.environment(math.radians(70)), SIZE))
    page.execute_script("homofact.view.turner = new homofact.view.turner.constructor(homofact.view.turner.done)")


@pytest.mark.slow
def test_a_coarse_sky_is_asked_at_points(page: Any) -> None:
    picture = relit_scene.sky_picture(3, rows=16).astype(np.float32)
    found = page.execute_script(
        "const picture = {values: Float32Array.from(arguments[0]), rows: 16, columns: 32};"
        "return Array.from(homofact.environmentCube(picture, 16, 0.4))",
        picture.reshape(-1).tolist(),
    )
    expected = cube.environment_cube(EnvironmentMap(torch.from_numpy(picture.astype(float)), 0.4), SIZE)
    assert off(np.array(found).reshape(expected.shape), expected) < 1e-6


@pytest.mark.slow
def test_another_view(page: Any) -> None:
    for across, up in ((40, 12), (110, -22)):
        page.execute_script("homofact.view.orbit.turn(...arguments); homofact.changed('moving')", across, up)
        headless.settled(page)
        check_colours(page, relit_scene.scene().skies[0].cube)


@pytest.mark.slow
def test_terms_and_coefficients_by_their_sliders(page: Any) -> None:
    light = relit_scene.scene().skies[0].cube
    for terms in (1, 2):
        slide(page, "terms", terms)
        check_colours(page, light, terms=terms)
    steps = page.execute_script("return homofact.view.keptSteps")
    place = next(k for k, step in enumerate(steps) if step >= 20)
    slide(page, "kept", place)
    check_tuples(page, light, steps[place])
    # More coefficients come back, and a change of light uses as many as are kept.
    slide(page, "kept", place + 2)
    change(page, sky=1)
    check_tuples(page, relit_scene.scene().skies[1].cube, steps[place + 2])


@pytest.mark.slow
def test_a_change_in_pieces_is_the_library_s_at_every_step(page: Any) -> None:
    """On the ground, whose vectors are its own: Overbeck's order is the library's then."""
    given, skies = relit_scene.scene().objects[1], relit_scene.scene().skies
    relit = Relit(given.basis)
    relit.relight(skies[0].cube)
    relit.ask(skies[1].cube)
    page.execute_script(
        "const v = homofact.view; window.alone = new v.relit.constructor([v.objects[1]], v.relit.coefficients);"
        "alone.relight(v.skies[0].coefficients(0)); alone.ask(v.skies[1].coefficients(0));"
    )
    left, found = 1, np.zeros(0)
    while left:
        left = relit.step(64)
        pending, found = page.execute_script(
            "alone.step(64); const o = homofact.view.objects[1]; o.mix(); return [alone.pending, Array.from(o.tuples)]"
        )
        assert pending == left
        found = np.array(found).reshape(-1, 4)[:, :3]
        assert off(found, relit.tuples[:, 0]) < 2e-4
    assert off(found, tuples(given, skies[1].cube)[:, 0]) < 2e-6


@pytest.mark.slow
def test_clusters_converge_in_pieces_to_the_exact_sum(page: Any) -> None:
    """The largest changes first: half of the error is gone after an eighth of the coefficients."""
    knot, sky = relit_scene.scene().objects[0], relit_scene.scene().skies[1]
    expected = tuples(knot, sky.cube)
    errors = [relative(page_tuples(page, 0), expected)]
    page.execute_script("homofact.view.relit.ask(homofact.view.skies[1].coefficients(0))")
    for _ in range(8):
        page.execute_script("homofact.view.relit.step(192); homofact.view.bring()")
        errors.append(relative(page_tuples(page, 0), expected))
    assert errors[1] < errors[0] / 2
    assert errors[-1] < 1e-6
    assert page.execute_script("return homofact.view.relit.pending") == 0


@pytest.mark.slow
def test_pending_coefficients_are_counted_on_the_page(page: Any) -> None:
    # A machine that no budget suits: a chunk a frame, and the picture is exact in the end all the same.
    # What the line said is noted as it changes: a look now and then may miss all of it.
    counts = page.execute_async_script(
        "const done = arguments[0], counts = [], line = document.getElementById('status'), v = homofact.view;"
        "const note = () => {"
        " counts.push(line.textContent.split(' ')[0]);"
        " if (counts.length > 3 && !v.relit.pending && counts.at(-1) === '0') { watch.disconnect(); done(counts); } };"
        "const watch = new MutationObserver(note);"
        "watch.observe(line, {childList: true, characterData: true, subtree: true});"
        "v.lightBudget = 0; v.state.sky = 1; v.changed('light');"
    )
    assert counts[-1] == "0"
    assert any(int(each.replace(",", "")) > 100 for each in counts)
    headless.settled(page)
    check_tuples(page, relit_scene.scene().skies[1].cube)


def hdr(picture: np.ndarray) -> tuple[bytes, np.ndarray]:
    """A Radiance file of new run lengths with its decoded radiance."""
    exponent = np.ceil(np.log2(picture.max(-1)) + 1e-9).astype(int)
    mantissa = np.floor(picture / np.exp2(exponent)[..., None] * 256).astype(np.uint8)
    rows, columns, _ = picture.shape
    data = bytearray(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\nEXPOSURE=2\n\n" + f"-Y {rows} +X {columns}\n".encode())
    for row in range(rows):
        data += bytes((2, 2, columns >> 8, columns & 255))
        for component in (*mantissa[row].T, (exponent[row] + 128).astype(np.uint8)):
            # Half of a scanline as it is, the rest run by run.
            data += bytes((100, *component[:100]))
            for value in component[100:]:
                data += bytes((129, value))
    return bytes(data), mantissa * np.exp2(exponent - 8)[..., None] / 2


def drop(driver: Any, name: str, data: bytes) -> str:
    """Drop a file on the page; what is said beside the skies."""
    return driver.execute_async_script(
        "const [name, bytes, done] = arguments, transfer = new DataTransfer();"
        "transfer.items.add(new File([Uint8Array.from(bytes)], name));"
        "const note = document.getElementById('light-note'); note.textContent = '';"
        "document.dispatchEvent(new DragEvent('drop', {dataTransfer: transfer, bubbles: true, cancelable: true}));"
        "(function wait() { note.textContent ? done(note.textContent) : setTimeout(wait, 20); })();",
        name,
        list(data),
    )


@pytest.mark.slow
def test_a_dropped_hdr_lights_the_scene(page: Any) -> None:
    data, radiance = hdr(relit_scene.sky_picture(5))
    light = EnvironmentMap(torch.from_numpy(radiance))
    assert drop(page, "new sky.hdr", data) == "new sky.hdr lights the scene."
    headless.settled(page)
    check_tuples(page, light)
    change(page, turn=ANGLE)
    check_tuples(page, light.turned(math.radians(ANGLE)))
    names = page.execute_script("return Array.from(document.querySelectorAll('#skies button'), b => b.innerText)")
    assert names == ["one", "two", "new sky", "Open .hdr …"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "damage", "said"),
    [
        ("a.hdr", lambda data: data[:-9], "a.hdr: it ends within scanline 63."),
        ("b.png", lambda data: b"\x89PNG" + data, "b.png: it does not start with #?RADIANCE."),
        ("c.hdr", lambda data: data.replace(b"-Y 64", b"+Y 64"), "c.hdr: its size is not given as -Y rows +X columns."),
        ("d.hdr", lambda data: data.replace(b"rgbe", b"xyze"), "d.hdr: its format is 32-bit_rle_xyze"),
        ("e.hdr", lambda data: data.replace(b"EXPOSURE=2", b"EXPOSURE=0"), "e.hdr: its EXPOSURE is not above 0."),
    ],
)
def test_a_bad_file_is_named_and_the_light_stays(page: Any, name: str, damage: Any, said: str) -> None:
    data, _ = hdr(relit_scene.sky_picture(5))
    assert drop(page, name, damage(data)).startswith(said)
    check_tuples(page, relit_scene.scene().skies[0].cube)


@pytest.mark.slow
def test_flat_pixels_and_old_runs_are_read(page: Any) -> None:
    head = b"#?RADIANCE\n\n-Y 2 +X 4\n"
    pixels = bytes((10, 20, 30, 129, 1, 1, 1, 3, 40, 50, 60, 130, 1, 1, 1, 3))
    values = page.execute_script(
        "return Array.from(homofact.readHdr(Uint8Array.from(arguments[0]), 'x').values)", list(head + pixels)
    )
    expected = [10 / 128, 20 / 128, 30 / 128] * 4 + [40 / 64, 50 / 64, 60 / 64] * 4
    assert values == pytest.approx(expected)


def test_the_largest_numbers_are_the_largest() -> None:
    basis = relit_scene.scene().objects[1].basis
    kept = largest(basis, 5)
    assert (np.diff(kept.start) == np.minimum(np.diff(basis.start), 5)).all()
    light = light_coefficients(relit_scene.scene().skies[0].cube, SIZE)
    assert light.shape == (6 * SIZE * SIZE, 3)
    first = np.abs(basis.number[: basis.start[1]].astype(int))
    assert sorted(np.abs(kept.number[: kept.start[1]].astype(int))) == sorted(first)[-5:]
