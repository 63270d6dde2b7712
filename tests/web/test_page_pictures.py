"""The page's pictures in a headless Chromium are Python's: point light, skies, meshes, differences."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch
from shading_cases import CASES
from viewer_page import DISTANCE, INSIDE, SIDE, ball, change, gathered, picture, radiance

from homofact.brdf.analytic.lambert import Lambert
from homofact.brdf.analytic.phong import Phong
from homofact.brdf.materials import material
from homofact.rendering.light import DEFAULT_LIGHT, EnvironmentMap
from homofact.rendering.sphere import render_sphere
from homofact.rendering.tonemap import DEFAULT_CURVE, automatic_exposure, displayed, encode_srgb
from homofact.web.layers import fit_layer
from homofact.web.viewer import source_layer

Open = Callable[..., Any]


def test_a_picture_is_python_s_render(show: Open) -> None:
    fitted = CASES["five of all kinds"]
    model = material("blinn-phong-50").model
    driver = show(fit_layer(fitted, "fit", "Fit"), source_layer(model))
    for number, reflectance, apart in ((0, fitted, 1), (1, model, 4)):
        found = picture(driver, number)
        stops = driver.execute_script("return window.homofact.state.stops")
        image = render_sphere(reflectance, size=SIDE)
        expected = displayed(image, 2**stops, curve=DEFAULT_CURVE).numpy() * 255
        if number == 1:
            # Of the source, in tenths of a stop, from fewer pixels.
            assert stops == pytest.approx(math.log2(automatic_exposure(image)), abs=0.12)
        inside, rim = INSIDE, (image.coverage.numpy() > 0) & (image.coverage.numpy() < 1)
        difference = np.abs(found - expected)
        # Half a level of rounding each, and the table's own error for the source.
        assert difference[inside].max() <= apart
        assert np.median(difference[rim]) < 6
        assert (found[0, 0] == np.round(encode_srgb(torch.tensor(0.024)).item() * 255)).all()


@pytest.mark.slow
def test_another_light_and_camera_are_python_s_too(show: Open) -> None:
    fitted = CASES["searched in-out"]
    driver = show(fit_layer(fitted, "fit", "Fit"))
    degrees = math.pi / 180
    a, e = -50 * degrees, 35 * degrees
    state = change(
        driver, lightFrom={"azimuth": -50, "elevation": 35}, camera={"azimuth": 20, "elevation": -15}, stops=1
    )
    assert state["stops"] == 1
    light = replace(DEFAULT_LIGHT, direction=(math.cos(e) * math.sin(a), math.sin(e), math.cos(e) * math.cos(a)))
    a, e = 20 * degrees, -15 * degrees
    view = (math.cos(e) * math.sin(a), math.sin(e), math.cos(e) * math.cos(a))
    image = render_sphere(fitted, light, SIDE, view=view)
    expected = displayed(image, 2.0, curve=DEFAULT_CURVE).numpy() * 255
    assert np.abs(picture(driver) - expected)[INSIDE].max() <= 1


@pytest.mark.slow
def test_a_ball_as_a_mesh_looks_like_the_sphere(show: Open) -> None:
    driver = show(fit_layer(CASES["fixed theta_h-theta_d"], "fit", "Fit"), mesh=ball())
    assert driver.execute_script("return window.homofact.state.surface") == "mesh"
    mesh = picture(driver)
    change(driver, surface="sphere")
    sphere = picture(driver)
    inside = DISTANCE < 0.9 * 0.94 * SIDE / 2
    assert np.median(np.abs(mesh - sphere)[inside]) <= 1
    assert np.quantile(np.abs(mesh - sphere)[inside], 0.99) <= 6
    outside = DISTANCE > 0.96 * SIDE / 2
    assert np.array_equal(mesh[outside], sphere[outside])


def under(driver: Any, **state: Any) -> np.ndarray:
    """(SIDE, SIDE, 3) radiance of the source after 16 passes of a sky: every pixel then had all starts of samples."""
    driver.execute_script("Object.assign(window.homofact.state, arguments[0]); window.homofact.changed();", state)
    driver.execute_async_script("requestAnimationFrame(() => requestAnimationFrame(arguments[0]))")
    gathered(driver, 16)
    return radiance(driver, "source")


@pytest.mark.slow
def test_a_glossy_sphere_under_the_sky_is_python_s_too(show: Open) -> None:
    """The overcast sky, its zenith above, as a lat-long map: both renderers integrate it, with samples of their own."""
    model = Phong((0.10, 0.20, 0.30), (0.4, 0.4, 0.4), exponent=300)
    driver = show(source_layer(model))
    found = under(driver, light="overcast", lightFrom={"azimuth": 0, "elevation": 90})
    height = torch.cos((torch.arange(128) + 0.5) * (math.pi / 128)).double()
    sky = torch.where(height > 0, (9 / 7) * (1 + 2 * height) / 3, 0.2)
    light = EnvironmentMap(sky[:, None, None].expand(128, 256, 1).contiguous())
    expected = render_sphere(model, light, SIDE, samples=64).radiance.numpy()
    for row in range(40, 160, 20):
        for column in range(60, 140, 20):
            block = np.s_[row : row + 20, column : column + 20]
            assert found[block].mean((0, 1)) == pytest.approx(expected[block].mean((0, 1)), rel=0.03), (row, column)


@pytest.mark.slow
@pytest.mark.parametrize("light", ["overcast", "studio"])
def test_skies_give_the_irradiance_that_they_say(light: str, show: Open) -> None:
    """A Lambertian surface that faces the sky's zenith, or the studio's key light, reflects about its albedo."""
    albedo = (0.2, 0.5, 0.7)
    driver = show(source_layer(Lambert(albedo)))
    found = under(driver, light=light)
    lit = driver.execute_script("return window.homofact.state.lightFrom")
    a, e = (lit[name] * math.pi / 180 for name in ("azimuth", "elevation"))
    x, y = math.cos(e) * math.sin(a), math.sin(e)
    column, row = (round(SIDE / 2 * (1 + 0.94 * s)) for s in (x, -y))
    linear = found[row - 3 : row + 4, column - 3 : column + 4].mean((0, 1))
    # The studio's lamps are only about as bright.
    assert linear / albedo == pytest.approx(1.0, abs=0.03 if light == "overcast" else 0.2)


@pytest.mark.slow
def test_differences_are_to_the_source_and_vanish_where_there_is_none(show: Open) -> None:
    fitted = CASES["fixed h"]
    driver = show(*(fit_layer(fitted, key, key) for key in ("fit", "mccool", "source")))
    plain = picture(driver, 0)
    for mode in ("signed", "ratio", "absolute"):
        change(driver, difference=mode)
        shown = [picture(driver, number) for number in range(3)]
        assert np.array_equal(shown[2], plain)
        middle = shown[0][SIDE // 2, SIDE // 2]
        assert np.abs(shown[0][SIDE // 2 - 40 : SIDE // 2 + 40, SIDE // 2] - middle).max() <= 1, mode
        assert np.array_equal(shown[0], shown[1])
    labels = driver.execute_script(
        "return Array.from(document.querySelectorAll('.scale'), s => s.hidden ? '' : s.textContent)"
    )
    assert labels == [
        "luminance, |fit − source|00.1250.25 of white",
        "luminance, |mccool − source|00.1250.25 of white",
        "",
    ]
