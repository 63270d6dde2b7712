"""Trace rays against a mesh with Embree: whether light is blocked, and which triangle a camera sees first.

Embree's occlusion query stops at any hit and is about a third faster than its query for the nearest hit. Embree uses
float32. Callers therefore start rays `OFFSET` times the mesh's size above the surface, along the normal, so that a
coarsely triangulated smooth surface does not shadow itself. Embree is required, because the alternatives are hundreds
of times slower.
"""

import numpy as np

from homofact.errors import BadInput
from homofact.files import extras

OFFSET = 1e-4
_CHUNK, _FAR = 2**20, 1e37


class Occluder:
    """An Embree scene of triangles (T, 3) over positions (V, 3); several threads can trace rays in it at once.

    The attribute `offset`, the distance of ray origins from the surface, is proportional to `size`. Default `size`: the
    diagonal of the triangles' bounding box. Raises BadInput if embreex is not installed, and for a mesh without
    triangles.
    """

    def __init__(self, positions: np.ndarray, triangles: np.ndarray, size: float | None = None) -> None:
        TriangleMesh = extras.library("embreex.mesh_construction", "shadows").TriangleMesh
        EmbreeScene = extras.library("embreex.rtcore_scene", "shadows").EmbreeScene
        if not len(triangles):
            raise BadInput(where="shadows", found="no triangles", expected="a mesh")
        # Robust: a ray that runs along an edge or through a vertex must not slip between two triangles.
        self._scene = EmbreeScene(robust=True)
        self._mesh = TriangleMesh(
            self._scene, np.ascontiguousarray(positions, np.float32), np.ascontiguousarray(triangles, np.int32)
        )
        self.arrays = (np.asarray(positions), np.asarray(triangles))
        self.offset = OFFSET * (extent(np.asarray(positions), triangles) if size is None else size)

    def blocked(self, origins: np.ndarray, directions: np.ndarray, lengths: np.ndarray | None = None) -> np.ndarray:
        """Return whether (R,) rays from `origins` (R, 3) along `directions` (R, 3) are blocked.

        Rays with unit directions end after `lengths` (R,). By default they are unbounded.
        """
        found = []
        for first, part in enumerate(_parts(origins, directions)):
            ends = None
            if lengths is not None:
                ends = np.minimum(lengths[first * _CHUNK : (first + 1) * _CHUNK], _FAR).astype(np.float32)
            found.append(self._scene.run(*part, dists=ends, query="OCCLUDED") == 0)
        return np.concatenate(found) if found else np.zeros(0, bool)

    def first(self, origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the nearest hit's triangle (R,), −1 for none, and the barycentric weights (R, 3) of its corners."""
        triangles, weights = [], []
        for part in _parts(origins, directions):
            found = self._scene.run(*part, query="INTERSECT", output=True)
            u, v = found["u"].astype(np.float64), found["v"].astype(np.float64)
            triangles.append(found["primID"].astype(np.int64))
            weights.append(np.stack((1 - u - v, u, v), 1))
        return np.concatenate(triangles), np.concatenate(weights)


def extent(positions: np.ndarray, triangles: np.ndarray) -> float:
    """Return the diagonal of the bounding box of some triangles."""
    used = positions[np.unique(triangles)]
    return float(np.linalg.norm(used.max(0) - used.min(0)))


def _parts(origins: np.ndarray, directions: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    arrays = (np.ascontiguousarray(each, np.float32) for each in np.broadcast_arrays(origins, directions))
    first, second = arrays
    return [(first[k : k + _CHUNK], second[k : k + _CHUNK]) for k in range(0, len(first), _CHUNK)]
