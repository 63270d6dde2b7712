"""Balls with a texture of two colours, as glTF files, and the same balls each of one of the colours."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from homofact.containers.srgb import decode_srgb

trimesh = pytest.importorskip("trimesh", reason="trimesh is not installed: pip install 'homofact[relight]'")
Image = pytest.importorskip("PIL.Image", reason="pillow is not installed: pip install 'homofact[pictures]'")

# Bytes of the texture where u < 1/2, towards +x, and where it is more, towards −x.
COLOURS = ((230, 60, 30), (40, 120, 200))
LINEAR = np.array([decode_srgb(np.array(colour) / 255) for colour in COLOURS])
MEAN = LINEAR.mean(0)


def ball(around: int = 24, down: int = 16) -> tuple[Any, np.ndarray]:
    """(a sphere about y, texture coordinates as OpenGL counts them): u goes round from +z by way of +x."""
    u, v = (each.ravel() for each in np.meshgrid(np.linspace(0, 1, around + 1), np.linspace(0, 1, down + 1)))
    theta, phi = np.pi * (1 - v), 2 * np.pi * u
    points = np.stack((np.sin(theta) * np.sin(phi), np.cos(theta), np.sin(theta) * np.cos(phi)), 1)
    faces = []
    for row in range(down):
        for column in range(around):
            a = row * (around + 1) + column
            b = a + around + 1
            # At the poles one of the two has no area.
            faces += [[a, a + 1, b + 1]] * (row > 0) + [[a, b + 1, b]] * (row < down - 1)
    return trimesh.Trimesh(points, faces, process=False, vertex_normals=points), np.stack((u, v), 1)


def written(file: Path, metallic: float, roughness: float, colour: int | None = None) -> Path:
    """A ball with the texture, or with one of its colours as a factor."""
    mesh, uv = ball()
    pixels = np.array([[COLOURS[0]] * 8 + [COLOURS[1]] * 8] * 8, np.uint8)
    picture = pixels if colour is None else np.full((2, 2, 3), 255, np.uint8)
    given: dict[str, Any] = {"baseColorTexture": Image.fromarray(picture)}
    if colour is not None:
        # Factors are linear; trimesh rounds them to 1/255.
        given = {"baseColorFactor": [*LINEAR[colour], 1.0]}
    mesh.visual = trimesh.visual.TextureVisuals(
        uv=uv,
        material=trimesh.visual.material.PBRMaterial(
            name="ball", metallicFactor=metallic, roughnessFactor=roughness, **given
        ),
    )
    scene = trimesh.Scene()
    scene.add_geometry(mesh, geom_name="ball")
    file.write_bytes(scene.export(file_type="glb"))
    return file
