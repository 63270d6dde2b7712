"""Pictures of relit objects: the first triangle along each pixel's rays, its vertices' light mixed over it.

As a graphics card does with colours at vertices, and as Wang et al. show their results. A lobe that stands apart is
summed at each pixel itself: between vertices its normal turns by more than it is wide. Four rays a pixel; what is
behind the objects is the environment itself.
"""

from collections.abc import Sequence

import numpy as np
import torch

from homofact.meshes.mesh import Mesh
from homofact.meshes.occlusion import Occluder
from homofact.meshes.tangents import frames
from homofact.relighting.lit import LitObject
from homofact.relighting.lobe import SurfacePoints
from homofact.rendering.light import EnvironmentMap
from homofact.rendering.sphere import SphereImage
from homofact.rendering.tonemap import choose_exposure, tonemap
from homofact.scene.cameras import Camera
from homofact.scene.meshes import MeshGroup

_RAYS = 2
_LEAST_COSINE = 0.02


def picture(
    meshes: Sequence[Mesh],
    colours: Sequence[np.ndarray],
    occluder: Occluder,
    camera: Camera,
    light: EnvironmentMap,
    lit: Sequence[LitObject] = (),
) -> tuple[np.ndarray, np.ndarray]:
    """(radiance (H, W, 3) float64, the part of each pixel that objects cover (H, W)).

    `colours` are the vertices' radiance (V, 3) towards the camera; `occluder` holds the meshes in this order. The lobes
    of the objects that are `lit`, in this order too, are added pixel by pixel.
    """
    w = camera.rays(_RAYS)
    shape = w.shape[:3]
    flat = w.reshape(-1, 3)
    triangle, weights = occluder.first(np.array(camera.eye)[None], flat)
    corners = MeshGroup(meshes).triangles
    values = np.concatenate(colours).astype(np.float64)
    hit = triangle >= 0
    found = np.array(np.broadcast_to(light.look_up(torch.from_numpy(flat))[0].numpy(), flat.shape))
    found[hit] = (values[corners[triangle[hit]]] * weights[hit][..., None]).sum(1)
    first = 0
    for mesh, each in zip(meshes, lit, strict=bool(lit)):
        if each.lobe is not None:
            rays = np.flatnonzero((triangle >= first) & (triangle < first + len(mesh.triangles)))
            # Once a pixel: highlights are smooth within it, outlines come from all of its rays.
            _, chosen, pixel = np.unique(rays // shape[2], return_index=True, return_inverse=True)
            own = rays[chosen]
            points = surface_points(mesh, triangle[own] - first, weights[own], -flat[own])
            found[rays] += each.lobe_at(points)[pixel]
        first += len(mesh.triangles)
    return found.reshape(*shape, 3).mean(2), hit.reshape(shape).mean(2)


def surface_points(mesh: Mesh, triangles: np.ndarray, shares: np.ndarray, towards: np.ndarray) -> SurfacePoints:
    """Points on `triangles` (S,) of a mesh by their corners' `shares` (S, 3), seen from `towards` (S, 3).

    A normal between vertices that is turned away, at an outline, is bent back until it is seen.
    """
    corners = mesh.triangles[triangles]
    normals = (mesh.normals[corners] * shares[..., None]).sum(1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True).clip(1e-12)
    normals += (_LEAST_COSINE - (normals * towards).sum(1, keepdims=True)).clip(0) * towards
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    rows = frames(normals)
    return SurfacePoints(rows, np.einsum("sij,sj->si", rows, towards), corners, shares)


def displayed_picture(radiance: np.ndarray, coverage: np.ndarray, exposure: float | None = None) -> np.ndarray:
    """8-bit sRGB (H, W, 3) of a picture, at the exposure that suits its objects unless one is given."""
    shown = torch.from_numpy(np.maximum(radiance, 0))
    chosen = choose_exposure(SphereImage(shown, torch.from_numpy(coverage))) if exposure is None else exposure
    whole = SphereImage(shown, torch.ones(coverage.shape, dtype=torch.float64))
    return tonemap(whole, chosen).pixels.numpy()
