"""Points of a surface with a normal map: their shading frames, and the view directions in these frames."""

import numpy as np

from homofact.meshes.tangents import frames
from homofact.relighting.lobe import SurfacePoints
from homofact.scene.normal_map import SurfaceNormals

LEAST_COSINE = 0.02


def bent_back(normals: np.ndarray, towards: np.ndarray) -> np.ndarray:
    """Unit normals (S, 3), those turned away from `towards` (S, 3) bent back until they are seen."""
    found = normals + (LEAST_COSINE - (normals * towards).sum(1, keepdims=True)).clip(0) * towards
    return found / np.linalg.norm(found, axis=1, keepdims=True)


def mapped_points(
    bumps: SurfaceNormals | None, corners: np.ndarray, shares: np.ndarray, normals: np.ndarray, towards: np.ndarray
) -> SurfacePoints:
    """Return points with mapped normals, interpolated from `corners` (S, 3) with the weights `shares` (S, 3).

    `normals` (S, 3) are the surface's unit normals, and `towards` (S, 3) the directions to the viewer. A mapped normal
    that faces away from the viewer is bent towards the viewer, so that no point is black.
    """
    shown = normals if bumps is None else bent_back(bumps.between(corners, shares, normals), towards)
    rows = frames(shown)
    views = np.einsum("sij,sj->si", rows, towards)
    return SurfacePoints(rows, views, corners, shares, None if bumps is None else normals)
