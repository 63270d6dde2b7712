"""Balls and squares with normal maps, as glTF files."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from textured import COLOURS, ball

trimesh = pytest.importorskip("trimesh", reason="trimesh is not installed: pip install 'homofact[relight]'")
Image = pytest.importorskip("PIL.Image", reason="pillow is not installed: pip install 'homofact[pictures]'")

FLAT = (128, 128, 255)


def tilted(degrees: float, azimuth: float = 0.0) -> tuple[int, int, int]:
    """The bytes of a normal tilted so many degrees towards an azimuth: 0 is along +u, 90 upwards in the picture."""
    slope, turn = np.radians(degrees), np.radians(azimuth)
    n = np.array([np.sin(slope) * np.cos(turn), np.sin(slope) * np.sin(turn), np.cos(slope)])
    red, green, blue = (int(each) for each in np.rint(127 * n + 128))
    return red, green, blue


def halves(left: tuple[int, int, int], right: tuple[int, int, int]) -> np.ndarray:
    """Pixels (8, 16, 3) of one normal where u < 1/2 and another where it is more."""
    return np.array([[left] * 8 + [right] * 8] * 8, np.uint8)


def waves(strength: float = 0.5, size: int = 32) -> np.ndarray:
    """Pixels (size, size, 3) of a wavy surface."""
    y, x = 2 * np.pi * np.mgrid[:size, :size] / size
    n = np.stack((strength * np.sin(3 * x), strength * np.cos(2 * y + x), np.ones_like(x)), -1)
    return np.rint(127 * n / np.linalg.norm(n, axis=-1, keepdims=True) + 128).astype(np.uint8)


def written(
    file: Path,
    normals: np.ndarray | None,
    metallic: float = 0.0,
    roughness: float = 0.5,
    coloured: bool = False,
    mesh: tuple[Any, np.ndarray | None] | None = None,
) -> Path:
    """A ball, or another mesh with coordinates as OpenGL counts them, with a normal map; `coloured`: a texture too."""
    shape, uv = ball() if mesh is None else mesh
    given: dict[str, Any] = {} if normals is None else {"normalTexture": Image.fromarray(normals)}
    if coloured:
        given["baseColorTexture"] = Image.fromarray(np.array([[COLOURS[0]] * 8 + [COLOURS[1]] * 8] * 8, np.uint8))
    else:
        given["baseColorFactor"] = [0.6, 0.3, 0.2, 1.0]
    material = trimesh.visual.material.PBRMaterial(
        name="bumpy", metallicFactor=metallic, roughnessFactor=roughness, **given
    )
    shape.visual = trimesh.visual.TextureVisuals(uv=uv, material=material)
    scene = trimesh.Scene()
    scene.add_geometry(shape, geom_name="part")
    file.write_bytes(scene.export(file_type="glb"))
    return file


def square(uv: np.ndarray | None = None) -> tuple[Any, np.ndarray]:
    """(a square of 5 × 5 vertices in the plane z = 0 that faces +z, its coordinates: u along x, v along y)."""
    x, y = (each.ravel() for each in np.meshgrid(np.linspace(0, 1, 5), np.linspace(0, 1, 5)))
    points = np.stack((2 * x - 1, 2 * y - 1, 0 * x), 1)
    a = (5 * np.arange(4)[:, None] + np.arange(4)).ravel()
    faces = np.concatenate((np.stack((a, a + 1, a + 6), 1), np.stack((a, a + 6, a + 5), 1)))
    shape = trimesh.Trimesh(points, faces, process=False, vertex_normals=np.tile([0.0, 0, 1], (25, 1)))
    return shape, np.stack((x, y), 1) if uv is None else uv


def edited(file: Path, change: Any) -> Path:
    """The file with its JSON changed in place by a function."""
    data = file.read_bytes()
    size = int.from_bytes(data[12:16], "little")
    header = json.loads(data[20 : 20 + size])
    change(header)
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 4)
    rest = data[20 + size :]
    total = (20 + len(text) + len(rest)).to_bytes(4, "little")
    file.write_bytes(data[:8] + total + len(text).to_bytes(4, "little") + b"JSON" + text + rest)
    return file
