"""Vary a material over a surface by a base-colour texture: by its colour divided by its mean colour."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from homofact.errors import BadInput


def read_texture(texels: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """Bilinear values (S, C) float64 of a texture (H, W, C), row 0 at v = 0, which repeats, at coordinates (S, 2)."""
    height, width = texels.shape[:2]
    # Without whole turns first: coordinates may be large.
    x, y = ((uv[:, k] % 1.0) * size - 0.5 for k, size in ((0, width), (1, height)))
    left, top = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    a, b = (x - left)[:, None], (y - top)[:, None]
    rows, columns = (top % height, (top + 1) % height), (left % width, (left + 1) % width)
    upper, lower = (texels[row, columns[0]] * (1 - a) + texels[row, columns[1]] * a for row in rows)
    return upper * (1 - b) + lower * b


@dataclass(frozen=True)
class SurfaceTint:
    """A texture on a mesh: `tints` (H, W, 3) float32, row 0 at v = 0, and the vertices' coordinates `uv` (V, 2).

    The texture repeats beyond [0, 1], as glTF's do unless they say otherwise, and is read bilinearly. Channels that
    are black throughout have the tint 1.
    """

    tints: np.ndarray
    uv: np.ndarray

    @classmethod
    def of(cls, picture: np.ndarray, uv: np.ndarray) -> "SurfaceTint":
        """Make the tint of a picture (H, W, 3) in linear light. Raises BadInput for other arrays."""
        if picture.ndim != 3 or picture.shape[2] != 3 or not picture.size:
            raise BadInput(where="texture", found=f"a picture of shape {picture.shape}", expected="(H, W, 3)")
        mean = picture.mean((0, 1))
        return cls((np.where(mean > 0, picture, 1.0) / np.where(mean > 0, mean, 1.0)).astype(np.float32), uv)

    @property
    def nbytes(self) -> int:
        """Return the bytes of the texture, three per texel as exported, and of the coordinates."""
        return self.tints.size + 8 * len(self.uv)

    def at(self, uv: np.ndarray) -> np.ndarray:
        """Tints (S, 3) float64 at texture coordinates (S, 2)."""
        return read_texture(self.tints, uv)

    @cached_property
    def at_vertices(self) -> np.ndarray:
        """Tints (V, 3) float64 of the vertices."""
        return self.at(self.uv)

    def between(self, corners: np.ndarray, shares: np.ndarray) -> np.ndarray:
        """Return tints (S, 3) at points that interpolate `corners` (S, 3) with weights `shares` (S, 3)."""
        return self.at((self.uv[corners] * shares[..., None]).sum(1))
