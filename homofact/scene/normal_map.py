"""A normal map on a mesh, which gives the shading normal at every point of the surface."""

from dataclasses import dataclass

import numpy as np

from homofact.scene.tint import read_texture

# The share of a map's texels that may be tilted by more than `reach`.
_BEYOND = 1e-3


@dataclass(frozen=True)
class SurfaceNormals:
    """Unit normals in tangent space, `vectors` (H, W, 3) float32, row 0 at v = 0, on a mesh with `uv` (V, 2).

    `tangents` (V, 4) are those of the vertices with the sign of the binormal (`meshes.tangent_space`). The map repeats
    beyond [0, 1] and is read bilinearly.
    """

    vectors: np.ndarray
    uv: np.ndarray
    tangents: np.ndarray

    @property
    def nbytes(self) -> int:
        """Return the bytes of the map, three per texel as in a file, and of the coordinates and tangents."""
        return self.vectors.size + 24 * len(self.uv)

    @property
    def sines(self) -> np.ndarray:
        """The sines (H·W,) of the angles by which the texels tilt the normal."""
        return np.hypot(self.vectors[..., 0], self.vectors[..., 1]).ravel()

    @property
    def reach(self) -> float:
        """Return the sine of the tilt that only a thousandth of the texels exceed."""
        return float(np.quantile(self.sines, 1 - _BEYOND))

    def between(self, corners: np.ndarray, shares: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """Return mapped normals (S, 3) at points that interpolate `corners` (S, 3) with weights `shares` (S, 3).

        `normals` (S, 3) are the surface's own there, of length 1.
        """
        mixed = (np.concatenate((self.uv, self.tangents), 1)[corners] * shares[..., None]).sum(1)
        x, y, z = read_texture(self.vectors, mixed[:, :2]).T[..., None]
        tangent = mixed[:, 2:5] - (mixed[:, 2:5] * normals).sum(1, keepdims=True) * normals
        tangent /= np.linalg.norm(tangent, axis=1, keepdims=True).clip(1e-12)
        binormal = np.where(mixed[:, 5:] < 0, -1.0, 1.0) * np.cross(normals, tangent)
        found = x * tangent + y * binormal + z * normals
        return found / np.linalg.norm(found, axis=1, keepdims=True).clip(1e-12)

    def at_vertices(self, normals: np.ndarray) -> np.ndarray:
        """Mapped unit normals (V, 3) of the vertices, whose own are `normals` (V, 3)."""
        corners = np.repeat(np.arange(len(self.uv))[:, None], 3, 1)
        return self.between(corners, np.broadcast_to(np.array([1.0, 0.0, 0.0]), corners.shape), normals)
