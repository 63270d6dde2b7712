"""What the readers of meshes give."""

from typing import NamedTuple

import numpy as np


class Parsed(NamedTuple):
    """`positions` (V, 3) and, where the file has them, `normals` (V, 3) of any length; `triangles` (T, 3) int64.

    Parts of a glTF scene have `uv` (V, 2), texture coordinates, v downwards as glTF has them, and may have `tangents`
    (V, 4) with the sign of the binormal.
    """

    positions: np.ndarray
    normals: np.ndarray | None
    triangles: np.ndarray
    uv: np.ndarray | None = None
    tangents: np.ndarray | None = None
