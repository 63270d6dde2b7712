"""Compute the tangents at the vertices of a mesh with texture coordinates, as normal maps need them.

The tangents follow MikkTSpace (Mikkelsen 2008, Simulation of wrinkled surfaces revisited). At each vertex, the
directions of increasing u of its triangles are projected perpendicular to the normal and summed, weighted by the corner
angles. Vertices with the same position, normal and texture coordinates share one tangent. Where triangles of both
handedness meet, e.g. along the centre line of mirrored coordinates, the vertex is duplicated. The binormal is n × t
times the sign. It points towards smaller v, because glTF counts v downwards and the green channel of its normal maps
points upwards.
"""

from dataclasses import replace

import numpy as np

from homofact.meshes.mesh import Mesh
from homofact.meshes.tangents import frames


def with_tangents(mesh: Mesh) -> Mesh:
    """Return the mesh with `tangents` (V, 4): its own if all are valid, else tangents from texture coordinates.

    A mesh without texture coordinates is returned unchanged.
    """
    if mesh.uv is None:
        return mesh
    own = None if mesh.tangents is None else _usable(mesh.tangents, mesh.normals)
    return replace(mesh, tangents=own) if own is not None else _derived(mesh)


def _usable(tangents: np.ndarray, normals: np.ndarray) -> np.ndarray | None:
    """Return unit tangents (V, 4) perpendicular to the normals; None if one tangent is invalid."""
    if tangents.shape != (len(normals), 4) or not np.isfinite(tangents).all() or (np.abs(tangents[:, :3]) > 1e9).any():
        return None
    across = tangents[:, :3] - (tangents[:, :3] * normals).sum(1, keepdims=True) * normals
    length = np.linalg.norm(across, axis=1, keepdims=True)
    if (length < 1e-6).any():
        return None
    return np.concatenate((across / length, np.where(tangents[:, 3:] < 0, -1.0, 1.0)), 1)


def _derived(mesh: Mesh) -> Mesh:
    assert mesh.uv is not None
    along, side = _growing(mesh.positions, mesh.uv, mesh.triangles)
    # Copies of the vertices that have triangles of both sides, for those of the left one.
    right, left = (np.unique(mesh.triangles[side == sign]) for sign in (1, -1))
    double = np.intersect1d(right, left)
    copies = np.arange(len(mesh.positions))
    copies[double] = len(mesh.positions) + np.arange(len(double))
    triangles = np.where((side == -1)[:, None], copies[mesh.triangles], mesh.triangles)
    chosen = np.concatenate((np.arange(len(mesh.positions)), double))
    positions, normals, uv = mesh.positions[chosen], mesh.normals[chosen], mesh.uv[chosen]
    sign = np.ones(len(chosen))
    sign[copies[left]] = -1
    weights = _angles(positions, triangles)
    summed = np.zeros((len(chosen), 3))
    _, same = np.unique(
        np.concatenate((positions, normals, uv, sign[:, None]), 1).round(9), axis=0, return_inverse=True
    )
    same = same.reshape(-1)
    for corner in range(3):
        at = triangles[:, corner]
        flat = along - (along * normals[at]).sum(1, keepdims=True) * normals[at]
        flat /= np.linalg.norm(flat, axis=1, keepdims=True).clip(1e-12)
        np.add.at(summed, same[at], weights[:, corner, None] * flat)
    tangents = summed[same]
    tangents -= (tangents * normals).sum(1, keepdims=True) * normals
    length = np.linalg.norm(tangents, axis=1, keepdims=True)
    # A vertex whose triangles have no area in the texture has no direction of u.
    tangents = np.where(length > 1e-9, tangents / length.clip(1e-9), frames(normals)[:, 0])
    found = np.concatenate((tangents, sign[:, None]), 1)
    return replace(mesh, positions=positions, normals=normals, triangles=triangles, uv=uv, tangents=found)


def _growing(positions: np.ndarray, uv: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return unit directions (T, 3) of increasing u, and handedness (T,) 1 or −1; both 0 for degenerate triangles."""
    a, b = (positions[triangles[:, k]] - positions[triangles[:, 0]] for k in (1, 2))
    p, q = (uv[triangles[:, k]] - uv[triangles[:, 0]] for k in (1, 2))
    area = p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]
    along = (a * q[:, 1:] - b * p[:, 1:]) * np.sign(area)[:, None]
    along /= np.linalg.norm(along, axis=1, keepdims=True).clip(1e-300)
    # Triangles are wound to the side of their normals.
    return along, -np.sign(area).astype(np.int64)


def _angles(positions: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return the corner angles (T, 3) of triangles, in radians."""
    found = []
    for k in range(3):
        edges = [positions[triangles[:, (k + step) % 3]] - positions[triangles[:, k]] for step in (1, 2)]
        one, other = (each / np.linalg.norm(each, axis=1, keepdims=True).clip(1e-300) for each in edges)
        found.append(np.arccos((one * other).sum(1).clip(-1, 1)))
    return np.stack(found, 1)
