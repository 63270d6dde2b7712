"""Bilinear stencils: the texels and weights of a lookup at a point of the texture square (thesis 3.2.7).

Coordinate −1 is the centre of the first texel and +1 the centre of the last, clamped; a GPU sampler
therefore reads at (x + ½)/M with x = (u + 1)(M − 1)/2 in 0 … M − 1. On a periodic axis (`linear.layout`)
x = (u + 1)M/2, and the texel after the last is the first. Texels are numbered row by row, the first coordinate
running along a row. A texture of one row is one-dimensional.
"""

import torch
from torch import Tensor

from homofact.linear.layout import CLAMPED, Axes, Axis, Shape


def stencil(uv: Tensor, shape: Shape, fractions: int = 0, axes: Axes = CLAMPED) -> tuple[Tensor, Tensor]:
    """Texel numbers (N, 4) int64 and weights (N, 4), summing to 1, of points (N, 2).

    `shape` is (rows, columns), `axes` their kinds. The last cell's right and upper neighbours are the texels
    themselves, or the first ones on a periodic axis, so an index never leaves the texture. `fractions` above 0 rounds
    the position within a cell to that many steps, as a GPU's sampler does. Vulkan and Direct3D require at least 256
    steps (8 bits).
    """
    rows, columns = shape
    column, right, u = _cell(uv[:, 0], columns, axes[1])
    row, above, v = _cell(uv[:, 1], rows, axes[0])
    if fractions > 0:
        u, v = (torch.floor(part * fractions + 0.5) / fractions for part in (u, v))
    numbers = torch.stack(
        (row * columns + column, row * columns + right, above * columns + column, above * columns + right), 1
    )
    weights = torch.stack(((1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v), 1)
    return numbers, weights


def _cell(coordinate: Tensor, size: int, axis: Axis) -> tuple[Tensor, Tensor, Tensor]:
    """The lower texel and the next (int64), and the fraction in [0, 1] towards it."""
    if axis is Axis.PERIODIC:
        position = (coordinate + 1) * (0.5 * size)
        below = position.floor()
        number = below.to(torch.int64)
        return number % size, (number + 1) % size, position - below
    position = ((coordinate + 1) * (0.5 * (size - 1))).clamp(0, size - 1)
    lower = position.floor().clamp_max(max(size - 2, 0))
    number = lower.to(torch.int64)
    return number, (number + 1).clamp_max(size - 1), position - lower


def lookup(texture: Tensor, uv: Tensor, axes: Axes = CLAMPED) -> Tensor:
    """Return values (N, C) of a texture (rows, columns, C) at points (N, 2)."""
    rows, columns, channels = texture.shape
    numbers, weights = stencil(uv.to(texture.dtype), (rows, columns), axes=axes)
    return (texture.reshape(-1, channels)[numbers] * weights[..., None]).sum(1)
