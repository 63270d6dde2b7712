"""Define the result of the mesh readers."""

from typing import NamedTuple

import numpy as np


class Parsed(NamedTuple):
    """`positions` (V, 3) and, where the file has them, `normals` (V, 3) of any length; `triangles` (T, 3) int64.

    Parts of a glTF scene may have texture coordinates `uv` (V, 2), with v downwards as in glTF, and `tangents` (V, 4)
    with the sign of the binormal.
    """

    positions: np.ndarray
    normals: np.ndarray | None
    triangles: np.ndarray
    uv: np.ndarray | None = None
    tangents: np.ndarray | None = None
