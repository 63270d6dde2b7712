"""Pictures of relit objects: the first triangle along each pixel's rays, its vertices' light mixed over it.

A graphics card interpolates colours of vertices in this way, and Wang et al. show their results so. A separate lobe is
summed at each pixel, because between vertices the normal turns by more than the lobe's width. Where the corners of a
triangle see different parts of the sky, rays find what the pixel sees. Suns and their shadows are computed for each
ray, and so are lamps. There are four rays per pixel, and the background is the environment itself with the suns' discs.
The pictures show the lamps, which hide what is behind them.
"""

from collections.abc import Sequence

import numpy as np
import torch

from homofact.meshes.mesh import Mesh
from homofact.meshes.occlusion import Occluder
from homofact.relighting.lit import LitObject
from homofact.relighting.lit_points import LitPoints
from homofact.relighting.lobe import PointSight, SurfacePoints, facing_shares
from homofact.relighting.mapped_points import bent_back, mapped_points
from homofact.rendering.light import EnvironmentMap
from homofact.rendering.tonemap import tonemap_scene
from homofact.scene.cameras import Camera
from homofact.scene.meshes import MeshGroup, faded
from homofact.scene.normal_map import SurfaceNormals

_RAYS = 2
_STEEP = 0.3
_SHADOW_RAYS, _EDGE_RAYS = 16, 64  # to a sun or lamp from each of a pixel's four points; the second in half shadow


def picture(
    meshes: Sequence[Mesh],
    colours: Sequence[np.ndarray],
    occluder: Occluder,
    camera: Camera,
    light: EnvironmentMap,
    lit: Sequence[LitObject] = (),
) -> tuple[np.ndarray, np.ndarray]:
    """Return (radiance (H, W, 3) float64, coverage of each pixel by objects (H, W)).

    `colours` are the vertices' radiance (V, 3) towards the camera; `occluder` holds the meshes in this order. The
    objects in `lit`, in the same order, add their lobes, suns and lamps per pixel, and their textures are read for each
    ray. A level plane ends softly.
    """
    w = camera.rays(_RAYS)
    shape = w.shape[:3]
    flat = w.reshape(-1, 3)
    triangle, weights = occluder.first(np.array(camera.eye)[None], flat)
    group = MeshGroup(meshes)
    corners = group.triangles
    values = np.concatenate(colours).astype(np.float64)
    hit = triangle >= 0
    behind = np.broadcast_to(light.between(torch.from_numpy(flat)).numpy(), flat.shape)
    beside = lit[0].sunlight if lit else None
    lights = () if beside is None else beside.lights
    for sun in () if beside is None else beside.suns:
        behind = behind + np.where(flat @ sun.direction > np.cos(sun.radius), 1.0, 0.0)[:, None] * sun.radiance()
    found, cover = behind.copy(), hit.astype(np.float64)
    facing = np.concatenate([(mesh.normals * (np.array(camera.eye) - mesh.positions)).sum(1) > 0 for mesh in meshes])
    met = corners[triangle[hit]]
    found[hit] = (values[met] * facing_shares(weights[hit], facing[met])[..., None]).sum(1)
    first = 0
    for number, mesh in enumerate(meshes):
        rays = np.flatnonzero((triangle >= first) & (triangle < first + len(mesh.triangles)))
        own, shares = triangle[rays] - first, weights[rays]
        first += len(mesh.triangles)
        if lit and (lit[number].varied or lit[number].lobe is not None or lights):
            points = surface_points(mesh, own, shares, -flat[rays], lit[number].bumps)
            if lit[number].varied:
                found[rays] = lit[number].terms_at(points, camera.eye)
            lifted = LitPoints.on(mesh, points, occluder.offset)
            sight = lifted.sight(occluder)
            if lit[number].lobe is not None:
                found[rays] += _lobe(lit[number], points, rays, shape[2], sight)
            if lights:
                seen = lifted.seen(lights, occluder, _SHADOW_RAYS, number, _EDGE_RAYS)
                found[rays] += lit[number].suns_at(points, seen, sight)
        ends = faded(mesh)
        if ends is not None:
            at = (mesh.positions[mesh.triangles[own]] * shares[..., None]).sum(1)
            x = ((np.hypot(at[:, 0], at[:, 2]) - ends[0]) / (ends[1] - ends[0])).clip(0, 1)
            clear = x * x * (3 - 2 * x)
            found[rays] += clear[:, None] * (behind[rays] - found[rays])
            cover[rays] -= clear
    if beside is not None and beside.lamps:
        eye, far = np.array(camera.eye), np.full(len(flat), np.inf)
        at = (group.positions[corners[triangle[hit]]] * weights[hit][..., None]).sum(1)
        far[hit] = np.linalg.norm(at - eye, axis=1)
        for lamp in beside.lamps:
            met = lamp.met(eye, flat)
            nearest = met < far
            found[nearest], cover[nearest], far[nearest] = lamp.radiance(), 0.0, met[nearest]
    return found.reshape(*shape, 3).mean(2), cover.reshape(shape).mean(2)


def _lobe(lit: LitObject, points: SurfacePoints, rays: np.ndarray, samples: int, sight: PointSight) -> np.ndarray:
    """Return the lobe's light at the points of `rays`, computed once per pixel, or once per ray at outlines.

    With a normal map it is computed for every ray.
    """
    if lit.bumps is not None:
        return lit.lobe_at(points, sight)
    key = rays // samples * 2 * samples + np.where(points.wo[:, 2] < _STEEP, samples + rays % samples, 0)
    _, chosen, own = np.unique(key, return_index=True, return_inverse=True)
    return lit.lobe_at(points.only(chosen), sight.only(chosen))[own]


def surface_points(
    mesh: Mesh, triangles: np.ndarray, shares: np.ndarray, towards: np.ndarray, bumps: SurfaceNormals | None = None
) -> SurfacePoints:
    """Return points on `triangles` (S,) of a mesh with barycentric weights `shares` (S, 3).

    `towards` (S, 3) are the directions to the viewer. An interpolated normal that faces away, as at an outline, is bent
    towards the viewer. `bumps` is the mesh's normal map.
    """
    corners = mesh.triangles[triangles]
    normals = (mesh.normals[corners] * shares[..., None]).sum(1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True).clip(1e-12)
    return mapped_points(bumps, corners, shares, bent_back(normals, towards), towards)


def displayed_picture(radiance: np.ndarray, coverage: np.ndarray, exposure: float | None = None) -> np.ndarray:
    """8-bit sRGB (H, W, 3) of a picture: the filmic curve, at the automatic exposure of its objects or a given one."""
    shown, _ = tonemap_scene(torch.from_numpy(radiance), torch.from_numpy(coverage), exposure)
    return shown.pixels.numpy()
