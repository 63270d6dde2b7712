"""A cube map with levels: the directions of its texels, and lookups as by a texture sampler.

Faces have the order of KTX2, DDS, OpenGL, Direct3D and WebGPU: +x, −x, +y, −y, +z, −z. On each, s grows along a row and
t from row to row, both from −1 to 1; with (s, t) the direction is, up to its length (OpenGL ES 3.0, table 3.21),

    +x (1, −t, −s)   −x (−1, −t, s)   +y (s, 1, t)   −y (s, −1, −t)   +z (s, −t, 1)   −z (−s, −t, −1).

Lookups are bilinear on two levels and linear between them. Texels beyond an edge are those of the adjacent face, and a
texel beyond a corner is the mean of the three that meet there, as in all current graphics interfaces.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from homofact.linear.kernels import kernel

FACES = 6


def directions_of(side: int) -> Tensor:
    """Return unit directions (6, N, N, 3) of the texels' centres."""
    ticks = (torch.arange(side, dtype=torch.float64) + 0.5) * (2 / side) - 1
    t, s = torch.meshgrid(ticks, ticks, indexing="ij")
    one = torch.ones_like(s)
    faces = [(one, -t, -s), (-one, -t, s), (s, one, t), (s, -one, -t), (s, -t, one), (-s, -t, -one)]
    d = torch.stack([torch.stack(face, -1) for face in faces])
    return d / d.norm(dim=-1, keepdim=True)


class Cube(NamedTuple):
    """Levels ready to be read: `texels` (T, 3) float64, each level face by face and row by row with a rim of one texel.

    Level k begins at `starts`[k] and has `sides`[k] texels per side without the rim.
    """

    texels: np.ndarray
    starts: np.ndarray
    sides: np.ndarray

    @classmethod
    def of(cls, levels: Sequence[Tensor]) -> "Cube":
        """From levels (6, N, N, 3), largest first."""
        parts = [_rimmed(level.to(torch.float64).numpy()).reshape(-1, 3) for level in levels]
        starts = np.cumsum([0, *(len(part) for part in parts[:-1])])
        return cls(np.concatenate(parts), starts, np.array([level.shape[1] for level in levels]))

    def read(self, directions: Tensor, level: Tensor) -> Tensor:
        """Light (N, 3) from directions (N, 3) of any length above 0 at levels (N,), which may lie between two."""
        where = np.ascontiguousarray(directions.to(torch.float64).numpy())
        return torch.from_numpy(_read(*self, where, np.ascontiguousarray(level.to(torch.float64).numpy())))


def _rimmed(faces: np.ndarray) -> np.ndarray:
    """(6, N + 2, N + 2, 3): with the texels of the faces on the other side of each edge."""
    side = faces.shape[1]
    whole = np.empty((FACES, side + 2, side + 2, 3))
    whole[:, 1:-1, 1:-1] = faces
    ticks, out = (np.arange(side) + 0.5) * (2 / side) - 1, np.full(side, 1 + 1e-9)
    for face in range(FACES):
        edges = ((0, slice(1, -1), ticks, -out), (-1, slice(1, -1), ticks, out))
        for row, column, s, t in edges:
            whole[face, row, column] = faces[_texel(face, s, t, side)]
            whole[face, column, row] = faces[_texel(face, t, s, side)]
    for row in (0, -1):
        for column in (0, -1):
            inner = (1 if row == 0 else -2), (1 if column == 0 else -2)
            beside = whole[:, row, inner[1]] + whole[:, inner[0], column] + whole[:, inner[0], inner[1]]
            whole[:, row, column] = beside / 3
    return whole


def _texel(face: int, s: np.ndarray, t: np.ndarray, side: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(face, row, column) of the texels at places on a face's plane, which may lie a little beyond its edges."""
    one = np.ones_like(s)
    planes = [(one, -t, -s), (-one, -t, s), (s, one, t), (s, -one, -t), (s, -t, one), (-s, -t, -one)]
    places = [_place(*point) for point in zip(*planes[face], strict=True)]
    where = np.array(places)
    rows, columns = (np.clip(((where[:, k] + 1) / 2 * side).astype(int), 0, side - 1) for k in (2, 1))
    return where[:, 0].astype(int), rows, columns


@kernel(nogil=True, inline="always")
def _place(x, y, z):  # pragma: no cover (compiled)
    """(face, s, t) of a direction."""
    a, b, c = abs(x), abs(y), abs(z)
    if a >= b and a >= c:
        return (0, -z / a, -y / a) if x > 0 else (1, z / a, -y / a)
    if b >= c:
        return (2, x / b, z / b) if y > 0 else (3, x / b, -z / b)
    return (4, x / c, -y / c) if z > 0 else (5, -x / c, -y / c)


@kernel(nogil=True)
def _read(texels, starts, sides, directions, level):  # pragma: no cover (compiled)
    colours = np.zeros((len(directions), 3))
    for k in range(len(directions)):
        face, s, t = _place(directions[k, 0], directions[k, 1], directions[k, 2])
        whole = min(max(level[k], 0.0), len(sides) - 1.0)
        low = min(int(whole), max(len(sides) - 2, 0))
        part = whole - low
        for step in range(2):
            share = part if step else 1 - part
            if share == 0:
                continue
            side = sides[low + step]
            column, row = (s + 1) * 0.5 * side + 0.5, (t + 1) * 0.5 * side + 0.5
            i, j = int(column), int(row)
            right, up = column - i, row - j
            first = starts[low + step] + (face * (side + 2) + j) * (side + 2) + i
            above = first + side + 2
            for channel in range(3):
                lower = (1 - right) * texels[first, channel] + right * texels[first + 1, channel]
                upper = (1 - right) * texels[above, channel] + right * texels[above + 1, channel]
                colours[k, channel] += share * ((1 - up) * lower + up * upper)
    return colours
