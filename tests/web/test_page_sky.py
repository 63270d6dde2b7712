"""The sky that the page opens under, in a headless Chromium: its light is Python's, and files may take its place."""

import base64
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from shading_cases import CASES
from viewer_page import change, gathered, radiance, shown_note

from homofact.brdf.analytic.ggx import GgxBrdf, GgxLobe
from homofact.brdf.analytic.phong import Phong
from homofact.rendering.environment import read_environment
from homofact.rendering.filtered import render_filtered
from homofact.rendering.light import EnvironmentMap
from homofact.rendering.sphere import render_sphere
from homofact.web.layers import fit_layer
from homofact.web.viewer import source_layer

pytestmark = pytest.mark.slow

Open = Callable[..., Any]
SMALL, FINER, PASSES = 64, 4, 96
SKY = Path(__file__).parents[2] / "data_synthetic" / "sky.hdr"


def sky_of(driver: Any) -> np.ndarray:
    """(rows, columns, 4) of the page's sky: radiance, and the density of drawing from it in sr⁻¹."""
    rows, columns, texels = driver.execute_script(
        "const s = window.homofact.sky; return [s.rows, s.columns, Array.from(s.texels)]"
    )
    return np.array(texels).reshape(rows, columns, 4)


def smoothed(texels: np.ndarray) -> torch.Tensor:
    """The map as the page's sampler reads it, linear between texels and round the sphere, on a finer grid."""
    rows, columns, _ = texels.shape
    for axis, count in ((0, rows), (1, columns)):
        place = (np.arange(FINER * count) + 0.5) / FINER - 0.5
        below, part = np.floor(place).astype(int), place - np.floor(place)
        low, high = (k % count if axis else k.clip(0, count - 1) for k in (below, below + 1))
        weight = part[:, None] if axis else part[:, None, None]
        texels = np.take(texels, low, axis) * (1 - weight) + np.take(texels, high, axis) * weight
    return torch.from_numpy(texels)


def directions(rows: int, columns: int) -> tuple[np.ndarray, np.ndarray]:
    """(heights y of the rows' middles (rows, 1), solid angle of a texel of each row (rows, 1))."""
    edges = np.cos(np.arange(rows + 1) * math.pi / rows)
    return np.cos((np.arange(rows) + 0.5) * math.pi / rows)[:, None], (edges[:-1] - edges[1:])[:, None] * (
        2 * math.pi / columns
    )


@pytest.mark.parametrize("exponent", [5, 60])
def test_a_sphere_under_the_sky_is_python_s(
    exponent: int, show: Open, record_property: Callable[[str, object], None]
) -> None:
    """The page opens under its sky. It sums over directions, Python's filtered light has none and no noise either."""
    model = Phong((0.10, 0.20, 0.30), (0.4, 0.4, 0.4), exponent=exponent)
    driver = show(source_layer(model), link="", side=SMALL)
    assert driver.execute_script("return window.homofact.state.light") == "sky"
    gathered(driver, PASSES)
    found = radiance(driver, "source")
    turn = math.radians(driver.execute_script("return window.homofact.state.lightFrom.azimuth"))
    light = EnvironmentMap(smoothed(sky_of(driver)[..., :3]), turn)
    expected = render_filtered(model, light, SMALL).radiance.numpy()
    inside = np.hypot(*(np.mgrid[:SMALL, :SMALL] - (SMALL - 1) / 2)) < 0.94 * SMALL / 2 - 1.5
    whole = blocks(inside[..., None].repeat(3, 2).astype(float)) == 1
    apart = np.abs(found - expected)[inside].mean() / expected[inside].mean()
    in_blocks = np.abs(blocks(found) - blocks(expected))[whole].mean() / blocks(expected)[whole].mean()
    over = found[inside].mean() / expected[inside].mean() - 1
    record_property("mean_relative_difference", float(apart))
    record_property("in_blocks_of_4", float(in_blocks))
    record_property("mean_over", float(over))
    assert apart < 0.04
    assert in_blocks < 0.015
    assert abs(over) < 0.004


AFTER_16 = (
    "const done = arguments[0]; window.homofact.changed();"
    "(function wait() { const { passes } = window.homofact;"
    " if (passes < 16 || passes >= 32) { requestAnimationFrame(wait); return; }"
    " const { width, height, values } = window.homofact.radiance('source');"
    " done([width, height, Array.from(values)]); })();"
)


@pytest.mark.parametrize(("roughness", "grain"), [(0.12, 0.06), (0.35, 0.1)])
def test_the_rim_under_the_sky_is_python_s(roughness: float, grain: float, show: Open) -> None:
    """At the rim both directions are grazing, and the sun is 300 times brighter than the sky."""
    model = GgxBrdf((0.05, 0.05, 0.05), (GgxLobe((1.0, 1.0, 1.0), roughness, 0.05),))
    driver = show(source_layer(model), link="", side=SMALL)
    width, height, values = driver.execute_async_script(AFTER_16)
    sums = np.array(values).reshape(height, width, 4)[::-1]
    gathered(driver, PASSES)
    found = radiance(driver, "source").mean(2)
    turn = math.radians(driver.execute_script("return window.homofact.state.lightFrom.azimuth"))
    light = EnvironmentMap(smoothed(sky_of(driver)[..., :3]), turn)
    expected = render_sphere(model, light, SMALL, samples=2048).radiance.numpy().mean(2)
    y, x = np.mgrid[:SMALL, :SMALL] - (SMALL - 1) / 2
    distance, azimuth = np.hypot(x, y) / (0.94 * SMALL / 2), np.degrees(np.arctan2(-y, x))
    rim = (distance > 0.95) & (distance < 1)
    for middle in range(-180, 180, 15):
        part = rim & (np.abs((azimuth - middle + 180) % 360 - 180) < 12)
        assert found[part].mean() == pytest.approx(expected[part].mean(), rel=0.08), middle
    early = (sums[..., :3].sum(2) / 3 / np.maximum(sums[..., 3], 1e-9))[rim]
    assert np.abs(early / expected[rim] - 1).mean() < grain


def test_the_titles_count_the_passes_until_the_last(show: Open) -> None:
    driver = show(source_layer(Phong((0.1,) * 3, (0.4,) * 3, exponent=5)), link="", side=SMALL)
    driver.execute_script(
        "const now = performance.now.bind(performance); performance.now = () => 100 * now(); window.homofact.changed();"
    )
    said = driver.execute_async_script(
        "const [passes, done] = arguments; const said = [];"
        "(function wait() { const p = document.querySelector('.card header p').textContent;"
        " said.push([window.homofact.passes, p]); window.homofact.passes < passes || !window.homofact.idle"
        " ? requestAnimationFrame(wait) : done(said); })();",
        PASSES,
    )
    counted = [(passes, words) for passes, words in said if words.startswith("pass ")]
    assert len({passes for passes, _ in counted}) > 3
    assert all(words == f"pass {passes} of {PASSES}" for passes, words in counted)
    assert said[-1] == [PASSES, "as a table"]


def blocks(picture: np.ndarray) -> np.ndarray:
    """(H/4, W/4, C): means of 4 × 4 pixels."""
    return picture.reshape(SMALL // 4, 4, SMALL // 4, 4, -1).mean((1, 3))


def read_means(grey: np.ndarray) -> np.ndarray:
    """Means over texels of what is linear between their middles: ⅛, ¾, ⅛ of neighbours."""
    padded = np.pad(np.pad(grey, ((1, 1), (0, 0)), "edge"), ((0, 0), (1, 1)), "wrap")
    rows = (padded[:-2] + 6 * padded[1:-1] + padded[2:]) / 8
    return (rows[:, :-2] + 6 * rows[:, 1:-1] + rows[:, 2:]) / 8


def test_the_sky_s_density_is_its_light_s_share(show: Open) -> None:
    texels = sky_of(show(fit_layer(CASES["fixed h"], "fit", "Fit"), link="", side=16))
    _, solid = directions(*texels.shape[:2])
    mean = read_means(texels[..., :3].mean(2))
    assert (mean * solid).sum() == pytest.approx(4 * math.pi, rel=1e-5)
    assert texels[..., 3] == pytest.approx(mean / (4 * math.pi), rel=1e-5)


def test_the_sun_is_where_the_light_is_said_to_be(show: Open) -> None:
    texels = sky_of(show(fit_layer(CASES["fixed h"], "fit", "Fit"), link="", side=16))
    row, column = np.unravel_index(texels[..., :3].mean(2).argmax(), texels.shape[:2])
    # At azimuth 0, +z, which is where a lat-long map begins and ends; elevation 30°.
    assert min(column, texels.shape[1] - 1 - column) <= 4
    assert 90 - 180 * (row + 0.5) / texels.shape[0] == pytest.approx(30, abs=6)


DROP = (
    "const [name, text, done] = arguments;"
    "const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));"
    "const data = new DataTransfer(); data.items.add(new File([bytes], name));"
    "document.dispatchEvent(new DragEvent('dragenter', {dataTransfer: data}));"
    "const seen = !document.getElementById('drop').hidden;"
    "document.dispatchEvent(new DragEvent('drop', {dataTransfer: data, cancelable: true}));"
    "setTimeout(() => done([seen, document.getElementById('drop').hidden]), 400);"
)


def drop(driver: Any, name: str, data: bytes) -> tuple[str, bool]:
    seen = driver.execute_async_script(DROP, name, base64.b64encode(data).decode())
    assert seen == [True, True]
    return shown_note(driver)


def test_a_dropped_hdr_lights_the_object(show: Open) -> None:
    driver = show(fit_layer(CASES["fixed h"], "fit", "Fit"), side=48)
    words, wrong = drop(driver, "sky.hdr", SKY.read_bytes())
    assert (words, wrong) == ("sky.hdr lights the object. It stays in this page; a link does not hold it.", False)
    assert driver.execute_script("return window.homofact.state.light") == "sky"
    texels, expected = sky_of(driver), read_environment(SKY).radiance.numpy()
    _, solid = directions(*expected.shape[:2])
    mean = (read_means(expected.mean(2)) * solid).sum() / (4 * math.pi)
    assert texels[..., :3] == pytest.approx(expected / mean, rel=1e-4)


@pytest.mark.parametrize(
    ("name", "data", "said"),
    [
        ("cut.hdr", SKY.read_bytes()[:-9], "cut.hdr: it ends after 8189 of 8192 pixels."),
        ("a.png", b"\x89PNG\r\n\x1a\n", "a.png: it does not start with #?RADIANCE."),
        ("dark.hdr", SKY.read_bytes()[: -4 * 8192] + bytes(4 * 8192), "dark.hdr: every pixel is 0."),
        ("empty.hdr", b"", "empty.hdr: it does not start with #?RADIANCE."),
    ],
)
def test_a_damaged_hdr_is_refused_in_a_line(name: str, data: bytes, said: str, show: Open) -> None:
    driver = show(fit_layer(CASES["fixed h"], "fit", "Fit"), side=48)
    words, wrong = drop(driver, name, data)
    assert wrong
    assert words.startswith(said)
    assert "\n" not in words
    assert driver.execute_script("return [window.homofact.state.light, window.homofact.sky.name]") == [
        "directional", "built-in sky",
    ]  # fmt: skip


def test_the_sky_is_behind_the_object_and_turns_with_the_light(show: Open) -> None:
    driver = show(fit_layer(CASES["fixed h"], "fit", "Fit"), link="", side=48)
    script = (
        "const c = document.querySelector('.picture canvas'), copy = document.createElement('canvas');"
        "[copy.width, copy.height] = [c.width, c.height];"
        "const context = copy.getContext('2d', {willReadFrequently: true});"
        "context.drawImage(c, 0, 0); return Array.from(context.getImageData(0, 0, c.width, c.height).data)"
    )

    def corners() -> np.ndarray:
        pixels = np.array(driver.execute_script(script), float).reshape(48, 48, 4)[..., :3]
        return np.stack([pixels[0, 0], pixels[0, -1], pixels[-1, 0], pixels[-1, -1]])

    first = corners()
    # Blue above, brown below.
    assert (first[:2, 2] > first[:2, 0]).all()
    assert (first[2:, 0] > first[2:, 2]).all()
    change(driver, lightFrom={"azimuth": 150, "elevation": 30})
    assert np.abs(corners() - first).max() > 8
