"""Points of a surface as a normal map has them: the frames that they are shaded in, and the view there."""

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
    """Points mixed of `corners` (S, 3) by `shares` (S, 3), with unit `normals` (S, 3), seen from `towards` (S, 3).

    A mapped normal that is turned away from the viewer is bent back until it is seen, so that no point is black.
    """
    shown = normals if bumps is None else bent_back(bumps.between(corners, shares, normals), towards)
    rows = frames(shown)
    views = np.einsum("sij,sj->si", rows, towards)
    return SurfacePoints(rows, views, corners, shares, None if bumps is None else normals)
