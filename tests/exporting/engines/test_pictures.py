"""Spheres drawn by MaterialX's GlslRenderer and by Godot 4, beside our renderer's, in linear values."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from browser import browser
from engine_cases import LOOK, brushed, engine_folder, fit_no_looks, isotropic, light_of, script

from homofact.brdf.reflectance import Reflectance
from homofact.errors import MissingDependency
from homofact.exporting.engines import materialx, three
from homofact.exporting.prefiltered import picture
from homofact.factor.factorization import Factorization
from homofact.rendering.chain_kernels import ChainKernels
from homofact.rendering.light import DEFAULT_LIGHT, DirectionalLight, EnvironmentMap
from homofact.rendering.prefilter import Prefiltered
from homofact.rendering.sky_chain import FilteredSky
from homofact.rendering.sphere import render_sphere
from homofact.rendering.surface import RADIUS

pytestmark = pytest.mark.slow
SIZE = 96
LIGHTS = [DEFAULT_LIGHT, DirectionalLight((0.9, -0.1, 0.3), 1.5)]


@pytest.fixture(autouse=True)
def look(monkeypatch: pytest.MonkeyPatch) -> None:
    fit_no_looks(monkeypatch)


@pytest.fixture(scope="module")
def driver(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    with browser(tmp_path_factory.mktemp("browser")) as driver:
        yield driver


def drawn(draw: Callable[..., np.ndarray], *given: Any, **named: Any) -> np.ndarray:
    """What a script draws; skips where it misses something."""
    try:
        return draw(*given, **named)
    except MissingDependency as error:
        pytest.skip(f"{error}")


def apart(found: np.ndarray, expected: np.ndarray) -> np.ndarray:
    """Relative differences, but for the silhouette, where a pixel's mean and its middle differ."""
    y, x = np.mgrid[:SIZE, :SIZE] + 0.5 - SIZE / 2
    inner = np.hypot(x, y) < 0.85 * RADIUS * SIZE / 2
    return np.abs(found - expected)[inner] / np.maximum(expected, 0.05 * expected[inner].mean())[inner]


def sky(rows: int = 64) -> EnvironmentMap:
    """Three coloured glows without any symmetry."""
    theta = (np.arange(rows) + 0.5)[:, None] / rows * np.pi
    phi = ((np.arange(2 * rows) + 0.5) / (2 * rows) - 0.5) * 2 * np.pi
    up = np.broadcast_to(np.cos(theta), (rows, 2 * rows))
    towards = np.stack((np.sin(theta) * np.sin(phi), up, -np.sin(theta) * np.cos(phi)), 2)
    radiance = np.full((rows, 2 * rows, 3), 0.1)
    for place, width, colour in (
        ((0.65, 0.54, 0.54), 12, (6, 4, 2)), ((-0.84, 0.11, 0.53), 20, (1, 3, 6)), ((0, -0.98, 0.2), 6, (0.3, 1, 0.2)),
    ):  # fmt: skip
        radiance += np.exp(width * (towards @ np.array(place) - 1))[..., None] * np.array(colour)
    return EnvironmentMap(torch.from_numpy(radiance), turn=np.pi / 4)


# With `flip` images are loaded from the bottom up, as some renderers do: random texels show it.
@pytest.mark.parametrize(
    ("fit", "form", "flip"),
    [(isotropic(), None, False), (brushed(), None, False), (brushed(), None, True), (brushed(), "exr16", False)],
    ids=["isotropic", "brushed", "brushed-flipped", "brushed-halves"],
)
def test_materialx_draws_what_we_draw(tmp_path: Path, fit: Factorization, form: str | None, flip: bool) -> None:
    made = engine_folder(tmp_path / "fit", fit, "materialx", form)
    found = drawn(script("engines.draw_materialx").materialx_sphere, tmp_path / "fit", SIZE, RADIUS, LIGHTS, flip=flip)
    off = apart(found, render_sphere(made.stored, LIGHTS, SIZE).radiance.numpy())
    assert np.median(off) < 1e-3
    assert np.quantile(off, 0.99) < 5e-3
    assert (found[0] == 0).all()


@pytest.mark.parametrize("fit", [isotropic(), brushed()], ids=["isotropic", "brushed"])
def test_materialx_reads_its_environment_as_the_table_says(tmp_path: Path, fit: Factorization) -> None:
    made = engine_folder(tmp_path / "fit", fit, "materialx")
    found = drawn(script("engines.draw_materialx").materialx_sphere, tmp_path / "fit", SIZE, RADIUS, environment=sky())
    off = apart(found, under_the_sky(made.stored, materialx.KERNELS))
    assert np.median(off) < 0.01
    assert np.quantile(off, 0.99) < 0.05


@pytest.mark.parametrize("fit", [isotropic(), brushed()], ids=["isotropic", "brushed"])
def test_three_reads_its_environment_as_the_table_says(driver: Any, tmp_path: Path, fit: Factorization) -> None:
    made = engine_folder(tmp_path / "fit", fit, "three")
    draw = script("engines.draw_three").three_sphere
    found = drawn(draw, driver, tmp_path / "page", tmp_path / "fit", SIZE, RADIUS, environment=sky())
    off = apart(found, under_the_sky(made.stored, three.KERNELS))
    assert np.median(off) < 0.01
    assert np.quantile(off, 0.99) < 0.05


def under_the_sky(fit: Reflectance, kernels: ChainKernels) -> np.ndarray:
    """What the made-up table reads of `sky`."""
    table = light_of(fit, kernels).table
    return picture(Prefiltered(table, FilteredSky.of(sky(), kernels)), SIZE).radiance.numpy()


@pytest.mark.parametrize(
    ("fit", "form"), [(isotropic(), "png8"), (brushed(), None)], ids=["isotropic-bytes", "brushed-halves"]
)
def test_godot_draws_what_we_draw(driver: Any, tmp_path: Path, fit: Factorization, form: str | None) -> None:
    made = engine_folder(tmp_path / "fit", fit, "godot", form)
    found = drawn(
        script("engines.draw_godot").godot_sphere, driver, tmp_path / "page", tmp_path / "fit", SIZE, RADIUS, LIGHTS
    )
    off = apart(found, render_sphere(made.stored, LIGHTS, SIZE).radiance.numpy())
    # Its pixels are bytes, at several exposures.
    assert np.median(off) < 4e-3
    assert np.quantile(off, 0.99) < 0.02


def test_godot_shows_the_look_alike_an_even_sky(driver: Any, tmp_path: Path) -> None:
    """Even, since the Compatibility renderer filters skies in sRGB's curve."""
    engine_folder(tmp_path / "fit", isotropic(), "godot")
    even = EnvironmentMap.constant(0.5)
    place = (tmp_path / "page", tmp_path / "fit")
    found = drawn(script("engines.draw_godot").godot_sphere, driver, *place, SIZE, RADIUS, environment=even)
    # It does not take away from the diffuse part what the lobe reflects.
    assert np.quantile(apart(found, render_sphere(LOOK, even, SIZE).radiance.numpy()), 0.99) < 0.08
