"""A BRDF in a tensor tree, Radiance's representation of variable resolution: constant over the leaves of a tree.

The map of Shirley and Chiu (1997) maps a direction to a point of the unit square and preserves projected solid angle. A
tree of four dimensions has two such squares: one for the direction opposite to the light, one for the viewer. A tree of
three dimensions, for isotropic materials, has (1 − sinθi)/2, of which only half of the range is used, and the square of
the viewer, rotated until the direction opposite to the light has azimuth 0. A node has 2ⁿ branches or a grid of values.
Bit i of a branch's number selects the half of dimension i. In a grid, dimension 0 varies slowest, as in Radiance's
bsdf_t.c.
"""

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from homofact.brdf.in_kind import answering_in_kind
from homofact.brdf.klems import opposite, planar
from homofact.brdf.tristimulus import from_xyz
from homofact.errors import BadInput

# Places in the square stay below 1.
_INSIDE = 1 - 1e-9


@dataclass(frozen=True)
class Tree:
    """Values over the unit cube of `dimensions`.

    Attributes
    ----------
    children : (B, 2^dimensions) whole numbers: a branch from 0, or −1 − k for grid k. The root is the last branch, or
        grid 0 where there is no branch.
    sides : (L,) log2 of the side of each grid.
    starts : (L,) where each grid begins in `values`.
    values : (V,) all grids, one after the other.
    depth : log2 of the finest side of all.
    """

    dimensions: int
    children: Tensor
    sides: Tensor
    starts: Tensor
    values: Tensor
    depth: int

    @property
    def leaves(self) -> int:
        """The number of values."""
        return len(self.values)

    @property
    def nbytes(self) -> int:
        """Bytes of values and branches."""
        return self.values.nbytes + self.children.nbytes + self.sides.nbytes + self.starts.nbytes

    def at(self, place: Tensor) -> Tensor:
        """Return values (N,) at places (N, dimensions) in [0, 1)."""
        place = place.clamp(0, _INSIDE)
        bits = 2 ** torch.arange(self.dimensions)
        node = torch.full((len(place),), len(self.children) - 1 if len(self.children) else -1)
        while bool((inner := node >= 0).any()):
            doubled = 2 * place[inner]
            upper = doubled >= 1
            place = place.index_put((inner,), doubled - upper.to(place.dtype))
            node = node.index_put((inner,), self.children[node[inner], (upper * bits).sum(1)])
        grid = -1 - node
        side = self.sides[grid]
        index = torch.zeros_like(grid)
        for k in range(self.dimensions):
            index = (index << side) + torch.floor(place[:, k] * (1 << side)).long()
        return self.values[self.starts[grid] + index]


@dataclass(frozen=True)
class TensorTree:
    """A `Reflectance` of one tree, Y, or of three: Y and CIE 1976 u' and v'.

    `flipped` is set if the x axis of the surface points to the left in the file's axes (`klems.planar`). Raises
    BadInput for another number of trees, and trees of different dimensions or of neither three nor four.
    """

    trees: tuple[Tree, ...]
    flipped: bool = False

    def __post_init__(self) -> None:
        """Refuse trees that do not go together."""
        dimensions = {tree.dimensions for tree in self.trees}
        if len(self.trees) not in (1, 3) or len(dimensions) != 1 or not dimensions <= {3, 4}:
            raise BadInput(f"{len(self.trees)} trees of {sorted(dimensions)} dimensions", expected="1 or 3, of 3 or 4")

    @property
    def channels(self) -> tuple[str, ...]:
        """("Y",), or ("R", "G", "B") of three trees."""
        return ("Y",) if len(self.trees) == 1 else ("R", "G", "B")

    @property
    def isotropic(self) -> bool:
        """Whether the trees have three dimensions."""
        return self.trees[0].dimensions == 3

    @property
    def nbytes(self) -> int:
        """Bytes of all trees."""
        return sum(tree.nbytes for tree in self.trees)

    @property
    def fetches(self) -> int:
        """Nodes read for one value, down to the finest leaf."""
        return sum(tree.depth + 1 for tree in self.trees)

    @answering_in_kind
    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Return BRDF values (N, C) in sr⁻¹, without the cosine; 0 where a direction is under the horizon."""
        above = (wi[:, 2] >= 0) & (wo[:, 2] >= 0)
        light = opposite(planar(wi[above].double(), self.flipped))
        view = planar(wo[above].double(), self.flipped)
        place = places(light, view, self.trees[0].dimensions)
        found = torch.stack([tree.at(place) for tree in self.trees], 1)
        values = torch.zeros(len(wi), len(self.channels), dtype=wi.dtype)
        values[above] = (found if len(self.trees) == 1 else from_yuv(found).clamp_min(0)).to(values)
        return values


def places(light: Tensor, view: Tensor, dimensions: int) -> Tensor:
    """Return tree coordinates (N, dimensions) of the directions opposite to the light and to the viewer (N, 3)."""
    if dimensions == 4:
        return torch.cat((to_square(light[:, :2]), to_square(view[:, :2])), 1)
    radius = torch.hypot(light[:, 0], light[:, 1])
    phi = torch.atan2(light[:, 1], light[:, 0])
    cos, sin = torch.cos(phi), torch.sin(phi)
    turned = torch.stack((cos * view[:, 0] + sin * view[:, 1], cos * view[:, 1] - sin * view[:, 0]), 1)
    # Light at the normal belongs to the half that is used.
    return torch.cat((((1 - radius) / 2).clamp_max(0.5 - 1e-9)[:, None], to_square(turned)), 1)


def to_square(disk: Tensor) -> Tensor:
    """Return points of the unit disk (N, 2) in the unit square, by Shirley and Chiu's map with azimuth −π/4 first."""
    radius, phi = torch.hypot(disk[:, 0], disk[:, 1]), torch.atan2(disk[:, 1], disk[:, 0])
    phi = torch.where(phi < -math.pi / 4, phi + 2 * math.pi, phi)
    region = torch.floor((phi + math.pi / 4) / (math.pi / 2)).long().clamp(0, 3)
    along = (phi - region * (math.pi / 2)) * radius / (math.pi / 4)
    a = torch.where(region == 0, radius, torch.where(region == 1, -along, torch.where(region == 2, -radius, along)))
    b = torch.where(region == 0, along, torch.where(region == 1, radius, torch.where(region == 2, -along, -radius)))
    return (torch.stack((a, b), 1) + 1) / 2


def to_disk(square: Tensor) -> Tensor:
    """Return points of the unit square (N, 2) in the unit disk: the inverse of `to_square`."""
    a, b = (2 * square - 1).unbind(1)
    wide = a.abs() > b.abs()
    radius = torch.where(wide, a, b)
    ratio = torch.where(wide, b, a) / torch.where(radius == 0, 1.0, radius)
    phi = torch.where(wide, math.pi / 4 * ratio, math.pi / 2 - math.pi / 4 * ratio)
    return radius[:, None] * torch.stack((torch.cos(phi), torch.sin(phi)), 1)


def from_yuv(yuv: Tensor) -> Tensor:
    """Return linear sRGB (N, 3) of Y and CIE 1976 u' and v' (N, 3); negative where a colour leaves the gamut."""
    y, u, v = yuv.unbind(1)
    scale = y / (4 * v.clamp_min(1e-6))
    return from_xyz(torch.stack((9 * u * scale, y, (12 - 3 * u - 20 * v) * scale), 1))


def to_yuv(xyz: Tensor) -> Tensor:
    """Return Y and CIE 1976 u' and v' (N, 3) of CIE XYZ (N, 3); black gets the chromaticity of D65."""
    x, y, z = xyz.unbind(1)
    total = x + 15 * y + 3 * z
    black = (total <= 0) | (y <= 0)
    total = torch.where(black, 1.0, total)
    u = torch.where(black, 0.1978, 4 * x / total)
    v = torch.where(black, 0.4683, 9 * y / total)
    return torch.stack((y, u, v), 1)
