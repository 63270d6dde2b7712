"""What the readers of meshes give."""

from typing import NamedTuple

import numpy as np


class Parsed(NamedTuple):
    """`positions` (V, 3) and, where the file has them, `normals` (V, 3) of any length; `triangles` (T, 3) int64.

    `uv` (V, 2), texture coordinates of a part of a glTF scene, v downwards as glTF has them.
    """

    positions: np.ndarray
    normals: np.ndarray | None
    triangles: np.ndarray
    uv: np.ndarray | None = None
