"""What a camera sees: one surface point per pixel, with its frame and the direction to the viewer."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from homofact.meshes.tangents import frames
from homofact.scene.cameras import Camera
from homofact.scene.meshes import MeshGroup

# Of the unit normal along the ray: less is a silhouette of coarse triangles.
_AWAY = 0.2
PIXEL_ARRAYS = ("numbers", "objects", "points", "frames", "wo", "uv")


@dataclass(frozen=True)
class VisiblePixels:
    """The P pixels of a view that see something, float64.

    `numbers` (P,) row by row from the top left; `objects` (P,) which mesh each sees; `points` (P, 3) in the world;
    `frames` (P, 3, 3), rows t, b, n; `wo` (P, 3) unit, in the frame; `uv` (P, 2) texture coordinates, 0 where the mesh
    has none.
    """

    numbers: np.ndarray
    objects: np.ndarray
    points: np.ndarray
    frames: np.ndarray
    wo: np.ndarray
    uv: np.ndarray

    def __len__(self) -> int:
        """P."""
        return len(self.numbers)

    def some(self, rows: np.ndarray) -> "VisiblePixels":
        """Return those of the given rows."""
        return VisiblePixels(*(getattr(self, name)[rows] for name in PIXEL_ARRAYS))


def visible_pixels(meshes: MeshGroup, camera: Camera, rims: bool = False) -> VisiblePixels:
    """Return the nearest surface points through the centres of pixels, with interpolated normals.

    A pixel whose interpolated normal is turned away from the viewer, as happens on coarse rims, is not covered unless
    `rims` are asked for.
    """
    rays = camera.rays().reshape(-1, 3)
    triangle, weights = meshes.occluder.first(np.broadcast_to(np.array(camera.eye, np.float64), rays.shape), rays)
    hit = np.flatnonzero(triangle >= 0)
    corners, weights = meshes.triangles[triangle[hit]], weights[hit, :, None]
    points = (meshes.positions[corners] * weights).sum(1)
    normals = (meshes.normals[corners] * weights).sum(1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    frame = frames(normals)
    wo = np.einsum("pij,pj->pi", frame, -rays[hit])
    kept = np.ones(len(wo), bool) if rims else wo[:, 2] > 0
    owners = meshes.owners[triangle[hit]]
    uv = (meshes.uv[corners] * weights).sum(1)
    return VisiblePixels(hit[kept], owners[kept], points[kept], frame[kept], wo[kept], uv[kept])


def seen_from_behind(meshes: MeshGroup, cameras: Iterable[Camera]) -> np.ndarray:
    """Return the share (M,) of each mesh's pixels, over all cameras, whose normals face away; 0 if invisible."""
    count = int(meshes.owners.max()) + 1
    whole, away = np.zeros(count), np.zeros(count)
    for camera in cameras:
        rays = camera.rays().reshape(-1, 3)
        triangle, weights = meshes.occluder.first(np.array(camera.eye, np.float64)[None], rays)
        hit = np.flatnonzero(triangle >= 0)
        normals = (meshes.normals[meshes.triangles[triangle[hit]]] * weights[hit, :, None]).sum(1)
        owners = meshes.owners[triangle[hit]]
        whole += np.bincount(owners, minlength=count)
        away += np.bincount(owners, (normals * rays[hit]).sum(1) > _AWAY, count)
    return away / np.maximum(whole, 1)
