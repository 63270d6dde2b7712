"""The page of the small scene in a browser, for tests: what it holds, and what the library says of the same."""

import base64
import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import relit_scene
import torch
from browser import browser, complaints, headless
from coarse import coarse_shapes, coarse_terms
from relit_scene import CAMERA, tuples, whole

from homofact.meshes.occlusion import Occluder
from homofact.relighting.build import RelitObject, open_relight_scene, relit_objects
from homofact.relighting.page.build import PageObject
from homofact.relighting.page.relit_page import write_relit_page
from homofact.relighting.picture import picture
from homofact.relighting.relight import shaded
from homofact.relighting.result import RelightResult
from homofact.relighting.scene_file import read_relight_scene
from homofact.rendering.tonemap import encode_srgb
from homofact.scene.cameras import Camera
from homofact.scene.meshes import MeshGroup

ANGLE = 37.0
DAY = np.ones((6, 8, 8, 3))
# A window whose first picture costs a renderer in software little.
SMALL = (640, 400)


def colours_of(given: PageObject, light: Any, eye: Any, terms: int = 3, kept: int | None = None) -> np.ndarray:
    """What the library shades (V, 3)."""
    transport = replace(given.basis, positions=given.transport.positions, frames=given.transport.frames)
    first = transport.factors.first(terms)
    return shaded(replace(transport, factors=first), tuples(given, light, kept)[:, :terms], eye)


def shrink(driver: Any, width: int = 420, height: int = 320) -> None:
    """A picture that software draws in no time."""
    driver.execute_script(
        "const p = document.getElementById('picture'); p.style.width = arguments[0]; p.style.height = arguments[1];"
        "homofact.changed('picture');",
        f"{width}px",
        f"{height}px",
    )
    headless.settled(driver)


def pixels_of(driver: Any, script: str = "homofact.pixels()") -> np.ndarray:
    """The page's pixels (H, W, 3) 0 … 255 as `script` gives them, row 0 at the bottom."""
    # As text: lists of numbers take selenium seconds.
    width, height, data = driver.execute_script(
        f"const p = new Uint8Array({script}), c = homofact.view.stage.canvas; let text = '';"
        "for (let k = 0; k < p.length; k += 32768) text += String.fromCharCode(...p.subarray(k, k + 32768));"
        "return [c.width, c.height, btoa(text)]"
    )
    return np.frombuffer(base64.b64decode(data), np.uint8).astype(float).reshape(height, width, 4)[..., :3]


def change(driver: Any, what: str = "light", **state: Any) -> None:
    driver.execute_script("Object.assign(homofact.state, arguments[0]); homofact.changed(arguments[1])", state, what)
    headless.settled(driver)


def page_tuples(driver: Any, number: int) -> np.ndarray:
    """(V, K, 3) of the page."""
    given = relit_scene.scene().objects[number]
    values = driver.execute_script(f"return Array.from(homofact.view.objects[{number}].tuples)")
    terms = given.basis.factors.terms
    return np.array(values).reshape(len(given.mesh.positions), -1)[:, : 3 * terms].reshape(-1, terms, 3)


def page_colours(driver: Any, number: int) -> tuple[np.ndarray, np.ndarray]:
    """(V, 3) as the page's processor shades, and as its graphics card does."""
    found = driver.execute_script(
        "const v = homofact.view, o = v.stage.objects[arguments[0]]; o.shade(v);"
        "return [Array.from(v.shade()[arguments[0]]), Array.from(o.read())]",
        number,
    )
    processor, card = (np.array(each).reshape(-1, 3) for each in found)
    return processor, card


def eye_of(driver: Any) -> np.ndarray:
    return np.array(driver.execute_script("return homofact.view.orbit.eye"))


def check_colours(driver: Any, light: Any, terms: int = 3, kept: int | None = None) -> None:
    """The page's colours are the library's; positions and frames are rounded in it."""
    for number, given in enumerate(relit_scene.scene().objects):
        expected = colours_of(given, light, eye_of(driver), min(terms, given.basis.factors.terms), kept)
        facing = np.flatnonzero(expected.any(1))
        assert len(facing) > 20
        for found in page_colours(driver, number):
            assert off(found[facing], expected[facing]) < 2e-3


def off(found: np.ndarray, expected: np.ndarray) -> float:
    """The largest difference, as a part of the largest value."""
    return float(np.abs(found - expected).max() / np.abs(expected).max())


def check_tuples(driver: Any, light: Any, kept: int | None = None) -> None:
    for number, given in enumerate(relit_scene.scene().objects):
        expected = tuples(given, light, kept)
        assert off(page_tuples(driver, number), expected) < 2e-6


def slide(driver: Any, name: str, value: float) -> None:
    driver.execute_script(
        "const s = document.getElementById(arguments[0]); s.value = arguments[1]; s.dispatchEvent(new Event('input'))",
        name,
        value,
    )
    headless.settled(driver)


def seen_pixels(
    driver: Any, given: tuple[PageObject, ...], among: Occluder | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(which vertices of all the camera sees well, their (row from below, column), pixels (H, W, 3) 0 … 255)."""
    picture = pixels_of(driver)
    height, width = picture.shape[:2]
    mesh, eye = whole(given), eye_of(driver)
    towards = eye - mesh.positions
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    occluder = relit_scene.scene().occluder if among is None else among
    seen = (towards * mesh.normals).sum(1) > 0.4
    seen &= ~occluder.blocked(mesh.positions + occluder.offset * 20 * mesh.normals, towards)
    # On the ground, where it is not fading yet.
    seen &= np.linalg.norm(mesh.positions[:, ::2], axis=1) < 1.4
    forward = np.array(CAMERA.target) - eye
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, (0, 1, 0))
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    relative_to = mesh.positions - eye
    scale = height / 2 / math.tan(math.radians(CAMERA.field / 2)) / (relative_to @ forward)
    columns, rows = width / 2 + scale * (relative_to @ right), height / 2 + scale * (relative_to @ up)
    seen &= (columns > 1) & (columns < width - 1) & (rows > 1) & (rows < height - 1)
    which = np.flatnonzero(seen)
    return which, np.stack((rows[which], columns[which]), 1).astype(int), picture


def statistics(driver: Any) -> dict[str, Any]:
    return driver.execute_script("return homofact.view.statistics()")


def words(driver: Any, place: str) -> str:
    """An element's text, once the page has said all there is to say of its picture."""
    headless.settled(driver)
    return driver.execute_script("return document.getElementById(arguments[0]).textContent", place)


def relit(folder: Path, text: str, rings: int = 16) -> RelightResult:
    """The scene of a file with this text, of coarse shapes and terms; a sphere has `rings` bands."""
    (folder / "scene.toml").write_text(text)
    with coarse_shapes(rings=rings), coarse_terms():
        opened = open_relight_scene(read_relight_scene(folder / "scene.toml"))
        return RelightResult.of(opened.file, relit_objects(opened), {})


def with_own_light(made: RelightResult, light: np.ndarray = DAY) -> RelightResult:
    """The library's own light as a reference: what the sum in full gives is the error's business."""
    return replace(made, reference=tuple(made.shade(light, made.cameras[0].eye, suns=True)))


def turned(objects: Sequence[RelitObject], degrees: float) -> list[RelitObject]:
    """The objects under suns that are turned with the sky, from +z towards +x."""
    a = math.radians(degrees)
    turn = np.array([[math.cos(a), 0, math.sin(a)], [0, 1, 0], [-math.sin(a), 0, math.cos(a)]])
    found = []
    for each in objects:
        assert each.sunlight is not None
        moved = tuple(replace(sun, direction=turn @ sun.direction) for sun in each.sunlight.suns)
        found.append(replace(each, sunlight=replace(each.sunlight, suns=moved)))
    return found


def lit_at(objects: tuple[RelitObject, ...], *levels: float) -> list[RelitObject]:
    """The objects under their lamps at these levels."""
    found = []
    for each in objects:
        assert each.sunlight is not None
        pairs = zip(each.sunlight.lamps, levels, strict=True)
        changed = tuple(replace(lamp, intensity=lamp.intensity * level) for lamp, level in pairs)
        found.append(replace(each, sunlight=replace(each.sunlight, lamps=changed)))
    return found


def lit_by(objects: tuple[RelitObject, ...], *numbers: int) -> list[RelitObject]:
    """The objects under these of their lamps alone, the others dark."""
    return lit_at(objects, *(float(k in numbers) for k in range(2)))


def vertex_light(driver: Any) -> list[np.ndarray]:
    """What the page's processor shades of each object (V, 3)."""
    found = driver.execute_script("return homofact.view.shade().map((each) => Array.from(each))")
    return [np.array(each).reshape(-1, 3) for each in found]


def compared(
    driver: Any, scene: RelightResult, objects: Sequence[RelitObject], suns: bool = True, light: np.ndarray = DAY
) -> np.ndarray:
    """The largest difference (N,) of the channels, in 255ths, at the page's pixels that are all surface."""
    shown = shown_picture(driver)
    expected, cover = library_picture(driver, scene, objects, light, (shown.shape[1], shown.shape[0]), suns)
    return np.abs(shown - expected).max(-1)[cover]


@contextmanager
def relit_page(folder: Path, scene: RelightResult, size: tuple[int, int] = (420, 320)) -> Iterator[Any]:
    """The page of a relit scene, opened in a browser of its own and small; it must stay silent."""
    write_relit_page(folder / "scene.html", scene)
    with browser(size=SMALL) as driver:
        headless.open_page(driver, folder / "scene.html")
        shown = driver.execute_script("return homofact.changed ? '' : document.body.innerText")
        assert shown == "", f"the page shows its trouble: {shown}"
        shrink(driver, *size)
        yield driver
        assert complaints(driver) == []


def shown_picture(driver: Any, script: str = "homofact.pixels()") -> np.ndarray:
    """The page's picture (H, W, 3) from above, 0 to 255."""
    return pixels_of(driver, script)[::-1]


def library_picture(
    driver: Any,
    scene: RelightResult,
    objects: Sequence[RelitObject],
    light: np.ndarray,
    size: tuple[int, int],
    suns: bool,
) -> tuple[np.ndarray, np.ndarray]:
    """(the library's picture (H, W, 3) as the page would show it, whether a pixel is all surface)."""
    camera = Camera(tuple(eye_of(driver)), scene.cameras[0].target, scene.cameras[0].field, size)
    lit, meshes = [each.lit(light, suns) for each in objects], [each.mesh for each in objects]
    colours = [each.terms(camera.eye) for each in lit]
    radiance, cover = picture(meshes, colours, MeshGroup(meshes).occluder, camera, scene.sky.environment(), lit)
    x = np.maximum(radiance * 2 ** driver.execute_script("return homofact.view.stops"), 0)
    x = x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14)
    return encode_srgb(torch.from_numpy(x)).numpy() * 255, cover > 0.999
