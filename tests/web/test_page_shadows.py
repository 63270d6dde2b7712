"""What a mesh blocks of its own light in the page: nothing of a convex body, half in a bowl; and the first picture."""

import base64
import io
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from browser import complaints, headless
from PIL import Image
from viewer_page import ball, gathered, radiance, shown_note

from homofact.brdf.analytic.lambert import Lambert
from homofact.brdf.materials import material
from homofact.geometry.directions import draw_cosine_weighted
from homofact.meshes.mesh import Mesh
from homofact.web.viewer import source_layer, write_viewer

pytestmark = pytest.mark.slow

Open = Callable[..., Any]
SKY = "#light=sky&on=mesh"
ALBEDO = 0.6
# What the harmonics miss of a bowl's edge, and 128 directions of any.
OFF = 0.04


def bowl(rings: int = 40) -> Mesh:
    """The half of the unit sphere that is away from the viewer, a sheet that faces its middle."""
    full = ball(2 * rings)
    behind = (full.positions[full.triangles][..., 2] < 1e-9).all(1)
    return Mesh(full.positions, -full.normals, full.triangles[behind][:, ::-1].copy(), "bowl.obj")


def harmonics(w: np.ndarray) -> np.ndarray:
    """(N, 16) real spherical harmonics of bands 0 to 3, in the page's order, of unit vectors (N, 3)."""
    x, y, z = w.T
    values = (
        np.full(len(w), 0.5),
        math.sqrt(0.75) * y, math.sqrt(0.75) * z, math.sqrt(0.75) * x,
        math.sqrt(3.75) * x * y, math.sqrt(3.75) * y * z, math.sqrt(5) / 4 * (3 * z**2 - 1), math.sqrt(3.75) * x * z,
        math.sqrt(15) / 4 * (x**2 - y**2),
        math.sqrt(35 / 32) * y * (3 * x**2 - y**2), math.sqrt(105) / 2 * x * y * z,
        math.sqrt(21 / 32) * y * (5 * z**2 - 1), math.sqrt(7) / 4 * z * (5 * z**2 - 3),
        math.sqrt(21 / 32) * x * (5 * z**2 - 1), math.sqrt(105) / 4 * z * (x**2 - y**2),
        math.sqrt(35 / 32) * x * (x**2 - 3 * y**2),
    )  # fmt: skip
    return np.stack(values, 1) / math.sqrt(math.pi)


def blocked(driver: Any) -> np.ndarray | None:
    """(vertices, 16) of the mesh, as the page found them."""
    found = driver.execute_script("const b = window.homofact.blocked; return b && Array.from(b)")
    return None if found is None else np.array(found).reshape(-1, 16)


def even_sky(driver: Any) -> None:
    """Light the object by a sky of radiance 1 from everywhere."""
    data = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 8 +X 16\n" + bytes((128, 128, 128, 129)) * 128
    script = (
        "const bytes = Uint8Array.from(atob(arguments[0]), c => c.charCodeAt(0));"
        "window.homofact.open(new File([bytes], 'even.hdr')).then(arguments[1]);"
    )
    driver.execute_async_script(script, base64.b64encode(data).decode())
    assert not shown_note(driver)[1]


def test_a_convex_body_blocks_nothing(show: Open) -> None:
    driver = show(source_layer(Lambert((ALBEDO,) * 3)), link=SKY, side=48, mesh=ball(24))
    found = blocked(driver)
    assert found is not None
    assert len(found) == len(ball(24).positions)
    assert np.abs(found).max() == 0


def test_half_of_a_bowl_s_light_is_blocked(show: Open) -> None:
    """The opening's form factor is its area over the bowl's, 1/2, at every place of a sphere's part."""
    mesh = bowl()
    driver = show(source_layer(Lambert((ALBEDO,) * 3)), link=SKY, side=64, mesh=mesh)
    found = blocked(driver)
    assert found is not None
    inside = np.unique(mesh.triangles)
    inside = inside[mesh.positions[inside][:, 2] < -0.1][::29]
    wi, _ = draw_cosine_weighted(4096, torch.Generator().manual_seed(0))
    shares = []
    for vertex in inside:
        n = mesh.normals[vertex]
        across = np.cross(n, (1.0, 0.0, 0.0) if abs(n[0]) < 0.9 else (0.0, 1.0, 0.0))
        across /= np.linalg.norm(across)
        w = wi.numpy() @ np.stack((across, np.cross(n, across), n))
        shares.append(np.clip(1 - harmonics(w) @ found[vertex], 0, 1).mean())
    assert np.mean(shares) == pytest.approx(0.5, abs=OFF)
    assert np.abs(np.array(shares) - 0.5).max() < 3 * OFF
    # The picture under an even sky: the same share of the albedo.
    even_sky(driver)
    gathered(driver, 16)
    shown = radiance(driver, "source")
    side = len(shown)
    middle = shown[side // 4 : -side // 4, side // 4 : -side // 4]
    assert middle.mean() / ALBEDO == pytest.approx(0.5, abs=OFF)


# Keeps the picture of the first frame, before another one replaces it.
FIRST = (
    "const next = window.requestAnimationFrame.bind(window);"
    "window.requestAnimationFrame = (call) => next((time) => { call(time);"
    " const shown = document.querySelector('.picture canvas');"
    " if (!window.first && shown && shown.width > 16) window.first = shown.toDataURL(); });"
)


def pixels(data: str) -> np.ndarray:
    """(height, width, 3) in 0 … 255 of a canvas's data URL."""
    return np.array(Image.open(io.BytesIO(base64.b64decode(data.split(",")[1]))).convert("RGB"), float)


@pytest.mark.parametrize("name", ["cook-torrance-plastic", "phong-30"])
def test_the_first_picture_has_no_specks(
    name: str, chromium: Any, tmp_path: Path, record_property: Callable[[str, object], None]
) -> None:
    """Against the picture of 64 passes. Where each pixel begins its samples anywhere, it is off by 18 to 20 levels."""
    page = tmp_path / "page.html"
    write_viewer(page, [source_layer(material(name).model)], title=name)
    chromium.get("about:blank")
    complaints(chromium)
    headless.resize(chromium, (260, 420))
    found = chromium.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": FIRST})
    try:
        headless.open_page(chromium, page, "#light=sky")
        gathered(chromium, 64)
    finally:
        chromium.execute_cdp_cmd("Page.removeScriptToEvaluateOnNewDocument", found)
    first, last = (pixels(chromium.execute_script(f"return {each}")) for each in (
        "window.first", "document.querySelector('.picture canvas').toDataURL()"
    ))  # fmt: skip
    assert complaints(chromium) == []
    assert first.shape == last.shape
    height, width, _ = first.shape
    middle = np.array([height - 1, width - 1])[:, None, None] / 2
    inside = np.hypot(*(np.mgrid[:height, :width] - middle)) < 0.94 * min(height, width) / 2 - 8
    apart = np.abs(first - last)[inside]
    record_property("levels", [float(apart.mean()), float(np.quantile(apart, 0.99))])
    assert apart.mean() < 3
    assert np.quantile(apart, 0.99) < 12
