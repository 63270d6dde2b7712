"""Bilinear stencils: which texels a point of the texture square reads, with which weights (thesis 3.2.7).

Coordinate −1 is the centre of the first texel and +1 the centre of the last, clamped; a GPU sampler
therefore reads at (x + ½)/M with x = (u + 1)(M − 1)/2 in 0 … M − 1. Texels are numbered row by row, the
first coordinate running along a row. A texture of one row is one-dimensional.
"""

import torch
from torch import Tensor


def stencil(uv: Tensor, shape: tuple[int, int], fractions: int = 0) -> tuple[Tensor, Tensor]:
    """Texel numbers (N, 4) int64 and weights (N, 4), summing to 1, of points (N, 2).

    `shape` is (rows, columns). The last cell's right and upper neighbours are the texels themselves, so
    an index never leaves the texture. `fractions` above 0 rounds the place within a cell to that many steps, as a
    GPU's sampler does (256 of them is what Vulkan and Direct3D ask for at least: 8 bits).
    """
    rows, columns = shape
    column, u = _cell(uv[:, 0], columns)
    row, v = _cell(uv[:, 1], rows)
    if fractions > 0:
        u, v = (torch.floor(part * fractions + 0.5) / fractions for part in (u, v))
    right = (column + 1).clamp_max(columns - 1)
    above = (row + 1).clamp_max(rows - 1)
    numbers = torch.stack(
        (row * columns + column, row * columns + right, above * columns + column, above * columns + right), 1
    )
    weights = torch.stack(((1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v), 1)
    return numbers, weights


def _cell(coordinate: Tensor, size: int) -> tuple[Tensor, Tensor]:
    """The lower texel (int64) and the fraction in [0, 1] towards the next."""
    position = ((coordinate + 1) * (0.5 * (size - 1))).clamp(0, size - 1)
    lower = position.floor().clamp_max(max(size - 2, 0))
    return lower.to(torch.int64), position - lower


def lookup(texture: Tensor, uv: Tensor) -> Tensor:
    """Values (N, C) of a texture (rows, columns, C) at points (N, 2)."""
    rows, columns, channels = texture.shape
    numbers, weights = stencil(uv.to(texture.dtype), (rows, columns))
    return (texture.reshape(-1, channels)[numbers] * weights[..., None]).sum(1)
