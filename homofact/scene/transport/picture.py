"""Pictures of relit objects: the first triangle along each pixel's rays, its vertices' light mixed over it.

As a graphics card does with colours at vertices, and as Wang et al. show their results. Four rays a pixel; what is
behind the objects is the environment itself.
"""

import math
from collections.abc import Sequence

import numpy as np
import torch

from homofact.meshes.mesh import Mesh
from homofact.meshes.occlusion import Occluder
from homofact.render.light import EnvironmentMap
from homofact.scene.placed import Camera

_RAYS = 2


def camera_rays(camera: Camera, rays: int = _RAYS) -> np.ndarray:
    """Unit directions (H, W, rays², 3) through the pixels, row 0 on top."""
    width, height = camera.pixels
    eye, target = np.array(camera.eye, float), np.array(camera.target, float)
    forward = (target - eye) / np.linalg.norm(target - eye)
    # Straight up or down: any direction is as good as another for the picture's right.
    up = np.array([0.0, 1.0, 0.0]) if abs(forward[1]) < 1 - 1e-9 else np.array([0.0, 0.0, -1.0])
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    above = np.cross(right, forward)
    half = math.tan(math.radians(camera.field) / 2)
    y = half * (1 - 2 * (np.arange(height * rays) + 0.5) / (height * rays))
    x = half * width / height * (2 * (np.arange(width * rays) + 0.5) / (width * rays) - 1)
    w = forward + x[None, :, None] * right + y[:, None, None] * above
    w /= np.linalg.norm(w, axis=-1, keepdims=True)
    return w.reshape(height, rays, width, rays, 3).swapaxes(1, 2).reshape(height, width, rays**2, 3)


def picture(
    meshes: Sequence[Mesh], colours: Sequence[np.ndarray], occluder: Occluder, camera: Camera, light: EnvironmentMap
) -> tuple[np.ndarray, np.ndarray]:
    """(radiance (H, W, 3) float64, the part of each pixel that objects cover (H, W)).

    `colours` are the vertices' radiance (V, 3) towards the camera; `occluder` holds the meshes in this order.
    """
    w = camera_rays(camera)
    shape = w.shape[:3]
    flat = w.reshape(-1, 3)
    triangle, weights = occluder.first(np.array(camera.eye)[None], flat)
    starts = np.cumsum([0, *(len(mesh.positions) for mesh in meshes)])
    corners = np.concatenate([mesh.triangles + start for mesh, start in zip(meshes, starts, strict=False)])
    values = np.concatenate(colours).astype(np.float64)
    hit = triangle >= 0
    found = np.array(np.broadcast_to(light.look_up(torch.from_numpy(flat))[0].numpy(), flat.shape))
    found[hit] = (values[corners[triangle[hit]]] * weights[hit][..., None]).sum(1)
    return found.reshape(*shape, 3).mean(2), hit.reshape(shape).mean(2)
