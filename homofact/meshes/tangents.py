"""Compute surface frames at the vertices of a mesh without tangents.

Wang, Tran and Luebke (2004, section 3.2) compute the tangent from the normal by stereographic projection of the unit
sphere from (0, −1, 0). This field is singular in one direction; longitude and latitude would be singular in two: s =
norm((n_y + 1)² + n_z² − n_x², −2 (n_y + 1) n_x, −2 n_x n_z), t = n × s.
"""

import numpy as np


def frames(normals: np.ndarray) -> np.ndarray:
    """Return frames (V, 3, 3) of unit normals (V, 3), rows tangent, binormal, normal: frame @ w is w in local axes.

    At (0, −1, 0), where the formula is singular, the tangent is the x axis.
    """
    x, y, z = np.asarray(normals, np.float64).T
    tangent = np.stack(((y + 1) ** 2 + z**2 - x**2, -2 * (y + 1) * x, -2 * x * z), 1)
    length = np.linalg.norm(tangent, axis=1, keepdims=True)
    # The length is (1 + y)² + x² + z² = 2 (1 + y), nothing at the singular direction.
    tangent = np.where(length > 1e-12, tangent / np.maximum(length, 1e-300), (1.0, 0.0, 0.0))
    # Rounding near the singular direction leaves a small part along the normal.
    tangent -= (tangent * normals).sum(1, keepdims=True) * normals
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    return np.stack((tangent, np.cross(normals, tangent), normals), 1)
