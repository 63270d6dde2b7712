"""A view's picture at more pixels than were precomputed, with its sky behind it.

Along a surface the light changes little from one pixel to the next; the jagged parts of a small picture are its
silhouettes. So rays are traced at `times` as many pixels along each side, four rays per pixel. The radiance of each ray
is a weighted mean of the 4 × 4 precomputed pixels around it that show the same object. The weight depends on the
distance d in pixels, on the normals n and n', and on the distance of the pixel's point p' from the tangent plane at the
ray's point p:

    w = exp(−d²/2σ² − (1 − n·n')/s − (n·(p − p')/2q)²),    σ = ½, s = .05, q the width of a pixel there.

The page does the same on the graphics card (settled.js). The environment map is the background, and a level ground
fades out, as in pictures of relit scenes.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from homofact.editing.scene import PreparedScene
from homofact.meshes.mesh import Mesh
from homofact.rendering.light import EnvironmentMap
from homofact.scene.cameras import Camera
from homofact.scene.lighting import Lighting
from homofact.scene.meshes import MeshGroup, faded
from homofact.scene.visibility import VisiblePixels, visible_pixels

REACH, ALIKE, OFF = 0.5, 0.05, 2.0
# What is left to a pixel of the object that is like none of those about it, and where none is of the object.
_UNLIKE, _OTHER = 1e-6, 1e-12
_RAYS, _PIECE = 2, 1 << 17


@dataclass(frozen=True)
class Enlarged:
    """`radiance` (H, W, C) with the sky behind the objects, and the part of each pixel that they cover (H, W)."""

    radiance: Tensor
    coverage: Tensor


def enlarged(prepared: PreparedScene, view: int, values: Tensor, times: int = 4) -> Enlarged:
    """Return the picture of `values` (P, C), radiance of a view's covered pixels, at `times` as many pixels a side."""
    scene, camera = prepared.scene, prepared.scene.cameras[view]
    width, height = camera.pixels
    finer = replace(camera, pixels=(width * times * _RAYS, height * times * _RAYS))
    meshes = [edited.mesh for edited in scene.objects]
    seen = visible_pixels(MeshGroup(meshes), finer, rims=True)
    rays = finer.rays().reshape(-1, 3)
    channels = values.shape[1]
    picture = sky_behind(scene.lighting, rays, channels)
    cover = np.zeros(len(rays))
    own = _taken(prepared.pixels[view], camera, seen, finer, values.numpy())
    opaque = 1 - clear_shares(meshes, seen)
    picture[seen.numbers] += opaque[:, None] * (own - picture[seen.numbers])
    cover[seen.numbers] = opaque
    shape = (height * times, _RAYS, width * times, _RAYS)
    return Enlarged(
        torch.from_numpy(picture.reshape(*shape, channels).mean((1, 3))),
        torch.from_numpy(cover.reshape(shape).mean((1, 3))),
    )


def sky_behind(lighting: Lighting, directions: np.ndarray, channels: int) -> np.ndarray:
    """Return radiance (N, C) of a lighting's maps in world directions (N, 3): 0 of directional lights alone."""
    found = np.zeros((len(directions), channels))
    for light in lighting.lights:
        if isinstance(light, EnvironmentMap):
            found += light.between(torch.from_numpy(directions)).numpy()
    return found


def clear_shares(meshes: Sequence[Mesh], seen: VisiblePixels) -> np.ndarray:
    """Return the transparency (P,) of a level ground at each of the pixels: 0 is opaque, 1 is fully faded."""
    clear = np.zeros(len(seen))
    for number, mesh in enumerate(meshes):
        ends = faded(mesh)
        if ends is not None:
            own = seen.objects == number
            x = ((np.hypot(*seen.points[own][:, ::2].T) - ends[0]) / (ends[1] - ends[0])).clip(0, 1)
            clear[own] = x * x * (3 - 2 * x)
    return clear


def _taken(coarse: VisiblePixels, camera: Camera, seen: VisiblePixels, finer: Camera, values: np.ndarray) -> np.ndarray:
    """Return the radiance (P', C) of `seen` pixels, interpolated from `values` (P, C) of coarse pixels."""
    width, height = camera.pixels
    # The row of each covered pixel, −1 elsewhere and beyond the edges.
    grid = np.full(height * width, -1)
    grid[coarse.numbers] = np.arange(len(coarse))
    grid = np.pad(grid.reshape(height, width), 2, constant_values=-1)
    found = np.empty((len(seen), values.shape[1]))
    pixel = 2 * math.tan(math.radians(camera.field) / 2) / height
    eye = np.array(camera.eye, np.float64)
    for begin in range(0, len(seen), _PIECE):
        some = slice(begin, begin + _PIECE)
        rows, columns = np.divmod(seen.numbers[some], finer.pixels[0])
        at = np.stack(((rows + 0.5) / finer.pixels[1] * height, (columns + 0.5) / finer.pixels[0] * width), 1) - 0.5
        first = np.floor(at).astype(np.int64) - 1
        normals, points, objects = seen.frames[some, 2], seen.points[some], seen.objects[some]
        size = np.linalg.norm(points - eye, axis=1) * pixel
        total, weights = np.zeros((len(at), values.shape[1])), np.zeros(len(at))
        for tap in range(16):
            place = first + np.array((tap // 4, tap % 4))
            near = grid[place[:, 0] + 2, place[:, 1] + 2]
            here = near >= 0
            k = near[here]
            weight = np.exp(-((place[here] - at[here]) ** 2).sum(1) / (2 * REACH**2))
            unlike = (1 - (normals[here] * coarse.frames[k, 2]).sum(1)) / ALIKE
            off = (normals[here] * (points[here] - coarse.points[k])).sum(1) / (OFF * size[here])
            same = objects[here] == coarse.objects[k]
            weight *= np.where(same, np.exp(-unlike - off**2) + _UNLIKE, _OTHER)
            total[here] += weight[:, None] * values[k]
            weights[here] += weight
        found[some] = total / np.maximum(weights, 1e-300)[:, None]
    return found
