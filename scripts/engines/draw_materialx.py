"""Draw a sphere of a MaterialX export with MaterialX's own OpenGL renderer.

Run as a program of its own under an X display (the library ends the process that misses something):
python scripts/engines/draw_materialx.py request.json pixels.npy
"""

import ctypes
import json
import math
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from homofact.errors import MissingDependency
from homofact.rendering.light import DirectionalLight, EnvironmentMap

# MaterialX shades towards the eye's place, an orthographic camera's too: from here all of a sphere sees it alike.
_AWAY = 3000.0
# Mesa's software OpenGL filters with MaterialX's anisotropy of 16 where a fetch names its level too, and blurs it.
_MESA = {
    "LIBGL_ALWAYS_SOFTWARE": "1",
    "MESA_EXTENSION_OVERRIDE": "-GL_EXT_texture_filter_anisotropic -GL_ARB_texture_filter_anisotropic",
}


@contextmanager
def x_display() -> Iterator[str]:
    """The name of an X display: a virtual one for the block. Raises MissingDependency where there is no Xvfb."""
    program = shutil.which("Xvfb")
    if program is None:
        raise MissingDependency("no Xvfb on the PATH, expected Debian's xvfb and libgl1-mesa-dri")
    reading, writing = os.pipe()
    screen = ("-screen", "0", "640x480x24", "-nolisten", "tcp")
    server = subprocess.Popen(
        [program, "-displayfd", str(writing), *screen],
        pass_fds=[writing], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    os.close(writing)
    try:
        with os.fdopen(reading) as told:
            number = told.readline().strip()
        if not number:
            raise MissingDependency("Xvfb ended before it had a display")
        yield f":{number}"
    finally:
        server.terminate()
        server.wait()


def materialx_sphere(
    folder: Path, size: int, radius: float, lights: Sequence[DirectionalLight] = (),
    environment: EnvironmentMap | None = None, *, flip: bool = False, samples: int = 1024,
) -> np.ndarray:  # fmt: skip
    """Linear radiance (size, size, 3) of the unit sphere as `render_sphere` frames it, rows from the top.

    `folder` is an export with `--engine materialx`. With `flip` textures are loaded from the bottom up and the
    generator is told so, as renderers do that keep MaterialX's origin of texture coordinates. `samples` are what the
    renderer takes of an environment. Raises MissingDependency for what is not installed, RuntimeError with what the
    renderer said where it fails.
    """
    if find_spec("MaterialX") is None:
        raise MissingDependency("no MaterialX, expected it: pip install 'homofact[materialx]'")
    from homofact.brdf.analytic.metallic_roughness import MetallicRoughness
    from homofact.exporting.engines.gltf import glb

    with tempfile.TemporaryDirectory() as place, x_display() as display:
        asked = Path(place) / "request.json"
        mesh, pixels = Path(place) / "sphere.glb", Path(place) / "pixels.npy"
        mesh.write_bytes(glb(MetallicRoughness((0.5,) * 3, 0, 0.5), "sphere", 256))
        request: dict[str, Any] = {
            "folder": str(folder.resolve()), "mesh": str(mesh), "size": size, "radius": radius, "flip": flip,
            "lights": [[light.unit().tolist(), list(light.levels())] for light in lights], "samples": samples,
        }  # fmt: skip
        if environment is not None:
            np.save(Path(place) / "environment.npy", environment.radiance.numpy().astype(np.float32))
            request |= {"environment": str(Path(place) / "environment.npy"), "turn": environment.turn}
        asked.write_text(json.dumps(request), encoding="utf-8")
        done = subprocess.run(
            [sys.executable, __file__, str(asked), str(pixels)],
            env={**os.environ, "DISPLAY": display, **_MESA},
            capture_output=True, text=True, timeout=600,
        )  # fmt: skip
        if done.returncode or not pixels.is_file():
            raise RuntimeError(f"MaterialX's renderer: exit {done.returncode}\n{done.stdout}{done.stderr}")
        return np.load(pixels)


def _library(part: str) -> Any:
    """MaterialX, or a part of it: it has no types."""
    return import_module(f"MaterialX.{part}" if part else "MaterialX")


def _image(render: Any, texels: np.ndarray) -> Any:
    """A float image of the library's from texels (rows, columns, 3 or 4), top row first."""
    rows, columns, channels = texels.shape
    image = render.Image.create(columns, rows, channels, render.BaseType.FLOAT)
    image.createResourceBuffer()
    data = np.ascontiguousarray(texels, np.float32)
    ctypes.memmove(image.getResourceBuffer(), data.ctypes.data, data.nbytes)
    return image


def _surround(lamps: Any, request: dict[str, Any]) -> None:
    """Set the request's environment, a black one where there is none: the shader reads some texture in any case."""
    render = _library("PyMaterialXRender")
    radiance = np.zeros((2, 4, 3), np.float32)
    if "environment" in request:
        radiance = np.load(request["environment"])
        radiance = np.repeat(radiance, 3, 2) if radiance.shape[2] == 1 else radiance
        # The renderer turns maps by half a turn of its own; and the lights' transform would turn lamps too.
        radiance = np.roll(radiance, round((0.5 - request["turn"] / (2 * math.pi)) * radiance.shape[1]), 1)
    lamps.setEnvRadianceMap(_image(render, radiance))
    lamps.setEnvIrradianceMap(_image(render, _irradiance(radiance)))
    lamps.setEnvSampleCount(request["samples"])


def _irradiance(radiance: np.ndarray, rows: int = 32) -> np.ndarray:
    """Irradiance over pi (rows, 2 rows, 3) at the normals of a lat-long map's texels, of a map (R, 2R, 3) like it."""

    def directions(rows: int, columns: int) -> np.ndarray:
        theta = (np.arange(rows) + 0.5)[:, None] * (np.pi / rows)
        phi = ((np.arange(columns) + 0.5) / columns - 0.5) * (2 * np.pi)
        up = np.broadcast_to(np.cos(theta), (rows, columns))
        return np.stack((np.sin(theta) * np.sin(phi), up, -np.sin(theta) * np.cos(phi)), 2)

    high, wide = radiance.shape[:2]
    solid = np.sin((np.arange(high) + 0.5) * (np.pi / high))[:, None] * (np.pi / high) * (2 * np.pi / wide)
    cosine = np.maximum(directions(rows, 2 * rows).reshape(-1, 3) @ directions(high, wide).reshape(-1, 3).T, 0)
    each = (radiance * solid[..., None]).reshape(-1, 3)
    return (cosine @ each / np.pi).reshape(rows, 2 * rows, 3).astype(np.float32)


def _main(asked: Path, out: Path) -> None:
    """Draw what the request says."""
    mx, generators, shaders = (_library(name) for name in ("", "PyMaterialXGenGlsl", "PyMaterialXGenShader"))
    render, opengl = _library("PyMaterialXRender"), _library("PyMaterialXRenderGlsl")
    from homofact.containers.exr import read_exr

    request = json.loads(asked.read_text(encoding="utf-8"))
    folder, size = Path(request["folder"]), request["size"]

    class Exr(render.ImageLoader):
        """Reads the export's textures: the wheel's own loader knows no EXR."""

        def supportedExtensions(self) -> set[str]:
            """What it reads."""
            return {"exr"}

        def loadImage(self, path: Any) -> Any:
            """The image of a file."""
            channels = read_exr(path.asString())
            names = "RGBA" if "A" in channels else "RGB"
            texels = np.stack([channels.get(name, next(iter(channels.values()))) for name in names], 2)
            return _image(render, texels[::-1] if request["flip"] else texels)

    search = mx.getDefaultDataSearchPath()
    search.append(mx.FileSearchPath(str(folder)))
    library = mx.createDocument()
    mx.loadLibraries(mx.getDefaultDataLibraryFolders(), search, library)
    document = mx.createDocument()
    mx.readFromXmlFile(document, str(folder / "brdf.mtlx"))
    document.setDataLibrary(library)

    generator = generators.GlslShaderGenerator.create()
    context = shaders.GenContext(generator)
    context.registerSourceCodeSearchPath(search)
    context.getOptions().fileTextureVerticalFlip = not request["flip"]

    loader = render.StbImageLoader.create()
    renderer = opengl.GlslRenderer.create(size, size, render.BaseType.FLOAT)
    renderer.initialize()
    exr = Exr()
    images = opengl.GLTextureHandler.create(loader)
    images.addLoader(exr)
    images.setSearchPath(search)
    renderer.setImageHandler(images)

    lamps = render.LightHandler.create()
    nodes = []
    for number, (direction, levels) in enumerate(request["lights"]):
        node = document.addNode("directional_light", f"lamp_{number}", "lightshader")
        colour = levels if len(levels) == 3 else levels * 3
        node.setInputValue("direction", mx.Vector3(*(-x for x in direction)))
        node.setInputValue("color", mx.Color3(*colour))
        node.setInputValue("intensity", 1.0)
        nodes.append(node)
    lamps.setLightSources(nodes)
    lamps.registerLights(document, nodes, context)
    _surround(lamps, request)
    renderer.setLightHandler(lamps)

    meshes = renderer.getGeometryHandler()
    meshes.addLoader(render.CgltfLoader.create())
    assert meshes.loadGeometry(mx.FilePath(request["mesh"]), False)

    camera, half = render.Camera.create(), 1 / request["radius"]
    place = (mx.Vector3(0, 0, _AWAY), mx.Vector3(0, 0, 0), mx.Vector3(0, 1, 0))
    camera.setViewMatrix(render.Camera.createViewMatrix(*place))
    frame = (-half, half, -half, half, _AWAY - 2, _AWAY + 2)
    camera.setProjectionMatrix(render.Camera.createOrthographicMatrix(*frame))
    renderer.setCamera(camera)

    (element,) = shaders.findRenderableElements(document)
    renderer.createProgram(generator.generate("material", element, context))
    renderer.render()
    image = renderer.captureImage(None)
    data = ctypes.string_at(image.getResourceBuffer(), 4 * size * size * image.getChannelCount())
    # OpenGL's first row is the lowest.
    pixels = np.frombuffer(data, np.float32).reshape(size, size, -1)[::-1, :, :3]
    # Its ground is grey.
    np.save(out, np.where((pixels == pixels[0, 0]).all(2, keepdims=True), 0, pixels))


if __name__ == "__main__":
    _main(Path(sys.argv[1]), Path(sys.argv[2]))
