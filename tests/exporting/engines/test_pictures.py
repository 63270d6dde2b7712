"""Spheres drawn by MaterialX's GlslRenderer and by Godot 4, beside our renderer's, in linear values."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from browser import browser
from engine_cases import LOOK, brushed, combed, engine_folder, fit_no_looks, isotropic, light_of, script

from homofact.brdf.reflectance import Reflectance
from homofact.containers.formats import format_named
from homofact.errors import MissingDependency
from homofact.exporting.engines import materialx, three
from homofact.exporting.engines.table import ENGINES
from homofact.exporting.exported import exported, write_exported
from homofact.exporting.prefiltered import in_halves, picture, prefiltered_export
from homofact.factor.factorization import Factorization
from homofact.rendering.chain_kernels import ChainKernels
from homofact.rendering.filtered import render_filtered
from homofact.rendering.light import DEFAULT_LIGHT, DirectionalLight, EnvironmentMap
from homofact.rendering.prefilter import Prefiltered
from homofact.rendering.sky_chain import FilteredSky, SkyChain, chain_of
from homofact.rendering.sphere import render_sphere
from homofact.rendering.surface import RADIUS, seen_surface

pytestmark = pytest.mark.slow
SIZE = 96
LIGHTS = [DEFAULT_LIGHT, DirectionalLight((0.9, -0.1, 0.3), 1.5)]


@pytest.fixture(autouse=True)
def look(monkeypatch: pytest.MonkeyPatch) -> None:
    fit_no_looks(monkeypatch)


@pytest.fixture(scope="module")
def driver(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    with browser() as driver:
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


@cache
def filtered() -> SkyChain:
    """`sky` as an export stores it, of small faces."""
    return in_halves(chain_of(sky(), 64))


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


@pytest.mark.parametrize("fit", [isotropic(), brushed()], ids=["isotropic", "brushed"])
def test_godot_reads_the_filtered_sky_as_the_table_says(driver: Any, tmp_path: Path, fit: Factorization) -> None:
    """Beside lamps, and whatever sky and ambient light the scene has."""
    made = engine_folder(tmp_path / "fit", fit, "godot", chain=filtered())
    assert made.prefiltered is not None
    expected = picture(made.prefiltered.data, SIZE).radiance + render_sphere(made.stored, LIGHTS, SIZE).radiance
    found = drawn(
        script("engines.draw_godot").godot_sphere,
        driver, tmp_path / "page", tmp_path / "fit", SIZE, RADIUS, LIGHTS, EnvironmentMap.constant(0.5),
    )  # fmt: skip
    off = apart(found, expected.numpy())
    assert np.median(off) < 4e-3
    assert np.quantile(off, 0.99) < 0.02


@pytest.mark.parametrize(("fit", "median"), [(isotropic(), 0.03), (combed(), 0.05)], ids=["isotropic", "combed"])
def test_godot_shows_the_fit_under_a_sky(driver: Any, tmp_path: Path, fit: Factorization, median: float) -> None:
    """The table that is fitted to the material, against the exact integration: the table's own error is most of it."""
    made = exported(fit, format_named("exr16"))
    made = replace(made, prefiltered=prefiltered_export(made.stored, sky(), made.format, 64))
    write_exported(tmp_path / "fit", made, {}, engine="godot", files=ENGINES["godot"].add(made).files)
    draw = script("engines.draw_godot").godot_sphere
    found = drawn(draw, driver, tmp_path / "page", tmp_path / "fit", SIZE, RADIUS)
    off = apart(found, render_filtered(made.stored, sky(), SIZE).radiance.numpy())
    assert np.median(off) < median
    assert np.quantile(off, 0.9) < 4 * median


TURNED = (0.4, -1.1, 0.7)


def to_the_sky(directions: np.ndarray) -> np.ndarray:
    """Directions (..., 3) in homofact's sky of those in the world under an Environment's sky_rotation TURNED."""
    (sx, sy, sz), (cx, cy, cz) = np.sin(TURNED), np.cos(TURNED)
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    # Godot's order YXZ; its panoramas begin half a turn from ours.
    return directions @ (about_y @ about_x @ about_z) * (-1, 1, -1)


def test_godot_turns_its_background_so(driver: Any, tmp_path: Path) -> None:
    engine_folder(tmp_path / "fit", isotropic(), "godot")
    # Cut off at 1.
    dim = EnvironmentMap(sky(256).radiance / 8, turn=sky().turn)
    draw = script("engines.draw_godot").godot_background
    found = drawn(draw, driver, tmp_path / "page", tmp_path / "fit", SIZE, dim, TURNED)
    y, x = -(np.mgrid[:SIZE, :SIZE] + 0.5 - SIZE / 2) / (SIZE / 2)
    towards = np.stack((-x, y, np.full_like(x, -1.0)), 2)
    x, y, z = np.moveaxis(to_the_sky(towards / np.linalg.norm(towards, axis=2, keepdims=True)), 2, 0)
    rows, columns, _ = dim.radiance.shape
    column = ((np.arctan2(x, -z) + dim.turn) / (2 * np.pi) + 0.5) % 1 * columns
    expected = dim.radiance.numpy()[(np.arccos(y) / np.pi * rows).astype(int), column.astype(int)]
    off = np.abs(found - expected) / expected
    # The Compatibility renderer decodes a sky's colours by a polynomial. Another rotation is off by more than half.
    assert np.median(off) < 0.06
    assert np.quantile(off, 0.99) < 0.2


def test_godot_turns_the_filtered_sky_like_its_background(driver: Any, tmp_path: Path) -> None:
    made = engine_folder(tmp_path / "fit", brushed(), "godot", chain=filtered())
    assert made.prefiltered is not None
    draw = script("engines.draw_godot").godot_sphere
    found = drawn(draw, driver, tmp_path / "page", tmp_path / "fit", SIZE, RADIUS, rotation=TURNED)
    coverage, surface = seen_surface(SIZE, (0.0, 0.0, 1.0))
    frame = [to_the_sky(surface.frame[:, k].numpy()) for k in (2, 0)]
    n, t = (torch.from_numpy(each.copy()) for each in frame)
    wo = torch.from_numpy(to_the_sky(np.array([0.0, 0.0, 1.0]))).expand_as(n).contiguous()
    expected = torch.zeros(coverage.numel(), 3, dtype=torch.float64)
    expected[surface.pixels] = made.prefiltered.data.radiance(n, wo, t)
    off = apart(found, expected.reshape(SIZE, SIZE, 3).numpy())
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
