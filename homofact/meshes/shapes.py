"""Generate meshes: a sphere, a torus knot, and a ground plane."""

import math

import numpy as np

from homofact.errors import BadInput
from homofact.meshes.mesh import Mesh

NEAR = 4.0


def sphere(rings: int = 32) -> Mesh:
    """Return the unit sphere, y up, with `rings` bands of latitude and twice as many of longitude."""
    _at_least("rings", rings, 3)
    theta = np.linspace(0, math.pi, rings + 1)[:, None]
    phi = np.linspace(0, 2 * math.pi, 2 * rings + 1)[None]
    x, y, z = np.sin(theta) * np.sin(phi), np.cos(theta) + 0 * phi, np.sin(theta) * np.cos(phi)
    points = np.stack((x, y, z), -1)
    return _closed(points, points, "sphere")


def torus_knot(around: int = 192, across: int = 24, p: int = 2, q: int = 3, thickness: float = 0.28) -> Mesh:
    """Return a tube along the torus knot (p, q) in the unit sphere; it shadows itself under light from any side."""
    _at_least("around", around, 8)
    _at_least("across", across, 3)
    t = np.linspace(0, 2 * math.pi, around + 1)

    def curve(s: np.ndarray) -> np.ndarray:
        radius = 2 + np.cos(q * s)
        return np.stack((radius * np.cos(p * s), radius * np.sin(p * s), -np.sin(q * s)), 1) / 3

    step = 1e-4
    along = curve(t + step) - curve(t - step)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    # The torus's own normal at the curve turns with it and closes on itself, unlike a frame carried along.
    radial = np.stack((np.cos(p * t) * np.cos(q * t), np.sin(p * t) * np.cos(q * t), -np.sin(q * t)), 1)
    up = radial - (radial * along).sum(1, keepdims=True) * along
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    side = np.cross(along, up)
    angle = np.linspace(0, 2 * math.pi, across + 1)
    normals = up[:, None] * np.cos(angle)[None, :, None] + side[:, None] * np.sin(angle)[None, :, None]
    points = curve(t)[:, None] + thickness / 2 * normals
    # The knot stands: its axis, z, becomes the horizontal one, and it fits into the unit sphere.
    return _closed(points / np.linalg.norm(points, axis=-1).max(), normals, f"torus knot {p},{q}")


def ground(half: float = 2.0, height: float = 0.0, steps: int = 64) -> Mesh:
    """Return a square plane at y = `height`, 2·`half` across, of steps × steps squares, facing +y.

    If `half` exceeds `NEAR`, the squares are smaller in the middle: their size there is that of a plane with `half` =
    `NEAR` / 2.
    """
    _at_least("steps", steps, 1)
    if not half > 0:
        raise BadInput(where="ground", found=f"a half width of {half:g}", expected="above 0")
    along = np.linspace(-1, 1, steps + 1)
    even = NEAR / (2 * half) if half > NEAR else 1.0
    along = half * (even * along + (1 - even) * along**3)
    x, z = np.meshgrid(along, along, indexing="ij")
    points = np.stack((x, np.full_like(x, height), z), -1)
    normals = np.broadcast_to((0.0, 1.0, 0.0), points.shape)
    return Mesh(points.reshape(-1, 3), normals.reshape(-1, 3).copy(), _grid(steps, steps), "ground")


def _closed(points: np.ndarray, normals: np.ndarray, name: str) -> Mesh:
    """Return the mesh of a grid whose last row and column may repeat the first, without zero-area triangles."""
    rows, columns = points.shape[0] - 1, points.shape[1] - 1
    triangles = _grid(rows, columns)
    flat, directions = points.reshape(-1, 3), normals.reshape(-1, 3)
    _, first, place = np.unique(flat.round(9), axis=0, return_index=True, return_inverse=True)
    triangles = place.reshape(-1)[triangles]
    a, b, c = triangles.T
    triangles = triangles[(a != b) & (b != c) & (a != c)]
    flat, directions = flat[first], directions[first]
    corners = [flat[triangles[:, k]] for k in range(3)]
    facing = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    away = (facing * directions[triangles].sum(1)).sum(1) < 0
    return Mesh(flat, directions, np.where(away[:, None], triangles[:, ::-1], triangles), name)


def _grid(rows: int, columns: int) -> np.ndarray:
    """Return two triangles for each square of a grid of (rows + 1) × (columns + 1) points, (T, 3)."""
    corner = np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)
    a, b, c, d = corner, corner + columns + 1, corner + columns + 2, corner + 1
    # x along the rows, z along the columns: counter-clockwise from above is a, d, c.
    return np.concatenate((np.stack((a, d, c), -1).reshape(-1, 3), np.stack((a, c, b), -1).reshape(-1, 3)))


def _at_least(what: str, found: int, least: int) -> None:
    if found < least:
        raise BadInput(where=what, found=found, expected=f"at least {least}")
