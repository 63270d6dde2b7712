"""The layout of the unknowns: the texels of all textures in one vector, texture after texture, each row by row.

A texture axis has one of three kinds. On a clamped axis, the M texels are at −1 + 2k/(M − 1), the first at −1 and the
last at +1, and values are constant beyond them. On a periodic axis, the M texels are at −1 + 2k/M. −1 and +1 are the
same point, at which the first texel lies, and the neighbour of the last texel is the first. A polar axis is clamped,
and its first texel is a pole, at which all texels of the other axis represent one point (as all azimuths do at angle
0).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate

import torch
from torch import Tensor

from homofact.linear.names import CLAMPED, Axes, Axis, Shape


def texel_centres(count: int, axis: Axis) -> Tensor:
    """Return the centres of `count` texels of an axis (count,), float64; a single texel of a clamped axis is at 0."""
    number = torch.arange(count, dtype=torch.float64, device="cpu")
    if axis is Axis.PERIODIC:
        return number * (2 / count) - 1
    return number * (2 / (count - 1)) - 1 if count > 1 else number


@dataclass(frozen=True)
class TexelLayout:
    """The textures of one problem: their shapes (rows, columns) and the kinds of their axes (default: clamped)."""

    shapes: tuple[Shape, ...]
    axes: tuple[Axes, ...] = ()

    def __post_init__(self) -> None:
        """One pair of axes a texture."""
        if not self.axes:
            object.__setattr__(self, "axes", (CLAMPED,) * len(self.shapes))

    @cached_property
    def counts(self) -> tuple[int, ...]:
        """Texels of each texture."""
        return tuple(rows * columns for rows, columns in self.shapes)

    @cached_property
    def offsets(self) -> tuple[int, ...]:
        """The number of each texture's first texel."""
        return tuple(accumulate(self.counts, initial=0))[:-1]

    @property
    def unknowns(self) -> int:
        """T, the number of texels of all textures."""
        return sum(self.counts)

    def split(self, texels: Tensor) -> tuple[Tensor, ...]:
        """Return the textures (rows, columns, …) of a texel vector (T, …)."""
        parts = texels.split(self.counts)
        return tuple(part.reshape(*shape, *texels.shape[1:]) for part, shape in zip(parts, self.shapes, strict=True))

    @staticmethod
    def join(textures: Sequence[Tensor]) -> Tensor:
        """Return the texel vector (T, …) of textures, or of masks, (rows, columns, …): the inverse of `split`."""
        return torch.cat([texture.flatten(0, 1) for texture in textures])

    def owners(self, device: torch.device | str = "cpu") -> Tensor:
        """Return the number of the texture that each texel belongs to (T,), int64."""
        return self.spread(torch.arange(len(self.shapes), device=device))

    def spread(self, values: Tensor) -> Tensor:
        """Expand one value per texture (J,) to one value per texel (T,)."""
        return torch.cat([value.expand(count) for value, count in zip(values, self.counts, strict=True)])

    def whole(self, device: torch.device | str = "cpu") -> tuple[Tensor, ...]:
        """Return masks that contain every texel."""
        return tuple(torch.ones(shape, dtype=torch.bool, device=device) for shape in self.shapes)
