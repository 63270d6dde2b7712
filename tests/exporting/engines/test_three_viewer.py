"""The example page of the three.js folder with glTF models and panoramas, in a browser with the real three."""

import json
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
import pytest
import torch
from browser import browser, complaints, headless
from engine_cases import combed, engine_folder, fit_no_looks, isotropic, light_of, npm_package, served

from homofact.exporting.engines.three import KERNELS
from homofact.exporting.exported import Exported
from homofact.exporting.prefiltered import picture
from homofact.rendering.light import DirectionalLight, EnvironmentMap
from homofact.rendering.prefilter import Prefiltered
from homofact.rendering.sky_chain import FilteredSky
from homofact.rendering.sphere import render_sphere
from homofact.rendering.surface import RADIUS

SIZE, APART = 64, 1.25
# Renders the ball at `x` (in balls' radii) by the page's own scene, in linear floats; sets the lamp to `power`.
BALL = """
const [x, size, radius, power, sky] = arguments, { THREE, renderer, scene } = window.viewer;
document.getElementById("power").value = power;
document.getElementById("surroundings").checked = sky;
window.viewer.draw();
scene.background = null;
let scale = 1;
scene.traverse((each) => {
  if (each.isDirectionalLight) each.castShadow = false;
  if (each.isMesh) scale = each.getWorldScale(new THREE.Vector3()).x;
});
const half = scale / radius;
const camera = new THREE.OrthographicCamera(-half, half, half, -half, 0.1, 20);
camera.position.set(x * scale, 0, 8);
const target = new THREE.WebGLRenderTarget(size, size, { type: THREE.FloatType });
renderer.setRenderTarget(target);
renderer.render(scene, camera);
const pixels = new Float32Array(4 * size * size);
renderer.readRenderTargetPixels(target, 0, 0, size, size, pixels);
renderer.setRenderTarget(null);
return Array.from(pixels);
"""


def ball(middle: float, tangents: bool) -> dict[str, np.ndarray]:
    """A unit sphere about the x axis, whose texture coordinates go round that axis, maybe with other tangents."""
    rows, columns = np.meshgrid(np.linspace(0, 1, 129), np.linspace(0, 1, 257), indexing="ij")
    theta, phi = (rows * np.pi).ravel(), (columns * 2 * np.pi).ravel()
    # The sphere about y, turned by 90 degrees about z.
    n = np.stack((-np.cos(theta), np.sin(theta) * np.sin(phi), np.sin(theta) * np.cos(phi)), 1)
    first = (np.arange(128)[:, None] * 257 + np.arange(256)).ravel()
    made = {
        "POSITION": (n + np.array((middle, 0, 0))).astype("<f4"),
        "NORMAL": n.astype("<f4"),
        "TEXCOORD_0": np.stack((columns.ravel(), rows.ravel()), 1).astype("<f4"),
        "indices": np.stack((first, first + 257, first + 1, first + 1, first + 257, first + 258), 1).astype("<u4"),
    }
    if tangents:
        along = np.stack((n[:, 2], 0 * n[:, 0], -n[:, 0]), 1)
        along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
        made["TANGENT"] = np.concatenate((along, np.ones((len(n), 1))), 1).astype("<f4")
    return made


def glb(place: Path, tangents: bool = False) -> None:
    """A binary glTF of two balls in the materials "paint" and "rubber"."""
    views, accessors, primitives, data = [], [], [], b""
    for material, middle in enumerate((-APART, APART)):
        numbers = {}
        for name, values in ball(middle, tangents).items():
            flat = values.reshape(-1, 1) if name == "indices" else values
            numbers[name] = len(accessors)
            views.append({"buffer": 0, "byteOffset": len(data), "byteLength": values.nbytes})
            kind = ("SCALAR", "", "VEC2", "VEC3", "VEC4")[0 if name == "indices" else flat.shape[1]]
            accessor: dict[str, Any] = {
                "bufferView": numbers[name], "componentType": 5125 if name == "indices" else 5126,
                "count": len(flat), "type": kind, "min": flat.min(0).tolist(), "max": flat.max(0).tolist(),
            }  # fmt: skip
            accessors.append(accessor)
            data += values.tobytes()
        primitives.append({"indices": numbers.pop("indices"), "attributes": numbers, "material": material})
    scene = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": primitives}], "accessors": accessors, "bufferViews": views,
        "materials": [{"name": name, "pbrMetallicRoughness": {"baseColorFactor": colour}} for name, colour in
                      (("paint", (0.9, 0.1, 0.1, 1)), ("rubber", (0.1, 0.9, 0.1, 1)))],
        "buffers": [{"byteLength": len(data)}],
    }  # fmt: skip
    text = json.dumps(scene).encode()
    text += b" " * (-len(text) % 4)
    head = struct.pack("<4sIII4s", b"glTF", 2, 28 + len(text) + len(data), len(text), b"JSON")
    place.write_bytes(head + text + struct.pack("<I4s", len(data), b"BIN\0") + data)


def sky() -> EnvironmentMap:
    """Two glows without any symmetry, as three places the middle of a panorama: towards +x."""
    ticks = (np.arange(128) + 0.5) / 64 * np.pi
    theta, phi = np.meshgrid(ticks[:64], ticks, indexing="ij")
    glow = np.exp(3 * (np.sin(theta) * np.cos(phi - 1.2) - 1)), np.exp(8 * (np.cos(theta - 0.7) - 1))
    radiance = 0.1 + glow[0][..., None] * (2.0, 1.0, 0.5) + glow[1][..., None] * (0.2, 0.6, 1.5)
    return EnvironmentMap(torch.from_numpy(radiance), turn=-np.pi / 2)


def write_hdr(place: Path, radiance: np.ndarray) -> None:
    """Radiance's RGBE without run lengths."""
    most = radiance.max(2)
    exponent = np.ceil(np.log2(most)).astype(int)
    mantissa = np.clip(radiance / 2.0 ** exponent[..., None] * 256, 0, 255).astype(np.uint8)
    texels = np.concatenate((mantissa, (exponent + 128)[..., None].astype(np.uint8)), 2)
    rows, columns = most.shape
    place.write_bytes(f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {rows} +X {columns}\n".encode() + texels.tobytes())


FITS = {"plain": isotropic, "combed": combed}


def write_folder(place: Path, fit: Any) -> Exported:
    """The folder of a fit for three.js, with three itself, models and panoramas in it."""
    with pytest.MonkeyPatch.context() as patch:
        fit_no_looks(patch)
        made = engine_folder(place, fit, "three")
    (place / "node_modules").mkdir()
    (place / "node_modules" / "three").symlink_to(npm_package("three"))
    glb(place / "two.glb")
    glb(place / "tangents.glb", tangents=True)
    write_hdr(place / "sky.hdr", sky().radiance.numpy())
    (place / "broken.glb").write_bytes(b"glTF\2\0\0\0 and no more")
    (place / "broken.hdr").write_bytes(b"no sky")
    return made


class Page:
    """The example page, served with models beside it. A fit has a folder, which is made when it is first asked for."""

    def __init__(self, driver: Any, address: str, place: Path) -> None:
        self.driver, self.address, self.place, self.opened = driver, address, place, ""
        self._made: dict[str, Exported] = {}

    def made(self, folder: str) -> Exported:
        """The export in a folder of the page."""
        if folder not in self._made:
            self._made[folder] = write_folder(self.place / folder, FITS[folder]())
        return self._made[folder]

    def open(self, folder: str, query: str) -> list[str]:
        """[whether it is ready, what it says]."""
        self.made(folder)
        if folder != self.opened:
            self.opened = folder
            self.driver.get(f"{self.address}/{folder}/index.html?{query}")
            self.driver.execute_async_script(
                "const done = arguments[0]; (function wait() {"
                " document.documentElement.dataset.ready ? done(0) : setTimeout(wait, 20); })();"
            )
            ready = self.driver.execute_script("return document.documentElement.dataset.ready")
        else:
            ready = self.driver.execute_async_script(
                "window.viewer.load(arguments[0]).then((whole) => arguments[1](whole ? 'yes' : 'no'));", query
            )
        return [ready, self.driver.execute_script("return document.querySelector('output').textContent")]

    def ball(self, x: float, power: float = np.pi, sky: bool = False) -> np.ndarray:
        """Linear pixels (SIZE, SIZE, 3) of the ball there, as `render_sphere` frames it."""
        found = self.driver.execute_script(BALL, x, SIZE, RADIUS, power, sky)
        return np.array(found).reshape(SIZE, SIZE, 4)[::-1, :, :3]


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    npm_package("three")
    place = tmp_path_factory.mktemp("viewer")
    with browser() as driver, served(place) as address:
        headless.resize(driver, (320, 200))
        yield Page(driver, address, place)


def apart(found: np.ndarray, expected: np.ndarray) -> np.ndarray:
    """Relative differences inside 85% of the radius, of dark pixels to 5% of the mean."""
    y, x = np.mgrid[:SIZE, :SIZE] + 0.5 - SIZE / 2
    inner = np.hypot(x, y) < 0.85 * RADIUS * SIZE / 2
    return np.abs(found - expected)[inner] / np.maximum(expected, 0.05 * expected[inner].mean())[inner]


def lamp() -> np.ndarray:
    """Towards the page's lamp."""
    angle = np.radians(-40)
    return np.array((5 * np.sin(angle), 4, 5 * np.cos(angle)))


def lit(made: Exported) -> np.ndarray:
    """What the fit shows of a sphere under the page's lamp."""
    return render_sphere(made.stored, [DirectionalLight(tuple(lamp()), np.pi)], SIZE).radiance.numpy()


@pytest.mark.slow
def test_the_page_shows_a_model_in_the_fit(page: Page) -> None:
    assert page.open("plain", "model=two.glb") == ["yes", ""]
    for x in (-APART, APART):
        off = apart(page.ball(x), lit(page.made("plain")))
        assert np.median(off) < 2e-3
        assert np.quantile(off, 0.99) < 0.03


@pytest.mark.slow
def test_one_material_of_a_model_is_replaced_and_the_other_stays(page: Page) -> None:
    assert page.open("plain", "model=two.glb&material=rubber") == ["yes", ""]
    assert np.median(apart(page.ball(APART), lit(page.made("plain")))) < 2e-3
    # The fit is blue.
    red = page.ball(-APART)[SIZE // 2, SIZE // 2]
    assert red[0] > 3 * red[2]


@pytest.mark.slow
def test_the_page_shows_a_model_under_a_panorama(page: Page) -> None:
    assert page.open("plain", "model=two.glb&sky=sky.hdr") == ["yes", ""]
    table = light_of(page.made("plain").stored, KERNELS).table
    expected = picture(Prefiltered(table, FilteredSky.of(sky(), KERNELS)), SIZE).radiance.numpy()
    off = apart(page.ball(APART, power=0, sky=True), expected)
    assert np.median(off) < 0.015
    assert np.quantile(off, 0.99) < 0.06


def test_the_page_takes_dropped_files(page: Page) -> None:
    assert page.open("plain", "model=tangents.glb")[0] == "yes"
    said = page.driver.execute_async_script(
        "const done = arguments[0]; (async () => { const { dropped } = window.viewer;"
        " const bytes = await (await fetch('two.glb')).blob();"
        " await dropped(new File([bytes], 'Two.GLB'));"
        " const first = document.querySelector('output').textContent;"
        " await dropped(new File([bytes], 'two.obj'));"
        " return [first, document.querySelector('output').textContent]; })().then(done, (e) => done(String(e)));"
    )
    assert said[0] == ""
    assert said[1].startswith("two.obj: expected ")
    assert np.median(apart(page.ball(-APART), lit(page.made("plain")))) < 2e-3


@pytest.mark.slow
@pytest.mark.parametrize(
    ("query", "name"),
    [
        ("model=none.glb", "none.glb"),
        ("model=broken.glb", "broken.glb"),
        ("model=sky.hdr", "sky.hdr"),
        ("model=two.glb&material=wood", "wood"),
        ("sky=broken.hdr", "broken.hdr"),
        (f"model={quote('<b>none</b>.glb')}", "<b>none</b>.glb"),
    ],
)
def test_a_wrong_file_gives_one_line_on_the_page(page: Page, query: str, name: str) -> None:
    ready, said = page.open("plain", query)
    assert ready == "no"
    assert name in said
    assert said.count(". Expected ") == 1
    assert "\n" not in said
    # The browser is shared, and other pages must stay silent.
    complaints(page.driver)


@pytest.mark.slow
def test_a_brushed_fit_lies_along_the_texture_coordinates_of_a_model(page: Page) -> None:
    """About x there, where the direction of increasing longitude would be about y."""
    assert page.open("combed", "model=two.glb") == ["yes", ""]
    x, y, z = lamp()
    image = render_sphere(page.made("combed").stored, [DirectionalLight((y, -x, z), np.pi)], SIZE).radiance.numpy()
    off = apart(page.ball(-APART), np.rot90(image))
    assert np.median(off) < 5e-3
    assert np.quantile(off, 0.99) < 0.05
    assert np.median(apart(page.ball(-APART), lit(page.made("combed")))) > 0.05


@pytest.mark.slow
def test_a_models_own_tangents_come_first(page: Page) -> None:
    assert page.open("combed", "model=tangents.glb") == ["yes", ""]
    assert np.median(apart(page.ball(-APART), lit(page.made("combed")))) < 5e-3
