"""Bilinear tables on the unit square, and the warp that spreads a density evenly over it.

A table has its R × C nodes at the ends and equal steps between them, row index along the second
coordinate, so that u = (0, 0) is the first node and (1, 1) the last. The marginal-conditional warp of a
density p (Dupuy and Jakob 2018, section 4) takes u = (x, y) to

    s = ( ∫₀ˣ p(x', y) dx' / ∫₀¹ p(x', y) dx',  ∫₀ʸ ∫₀¹ p(x', y') dx' dy' ),

so that equal areas of s bear equal shares of p. p is bilinear between its nodes; the integrals below are
exact for it.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

# The share of a density that is left out at its end, so that an inverse lies where there is some.
_ALMOST = 1e-12


def cell(coordinate: Tensor, nodes: int) -> tuple[Tensor, Tensor]:
    """(index of the cell, place in it in [0, 1]) of coordinates (N,) in [0, 1] among `nodes` ≥ 2 nodes."""
    place = coordinate.clamp(0, 1) * (nodes - 1)
    index = place.floor().clamp_max(nodes - 2)
    return index.long(), place - index


def bilinear(table: Tensor, u: Tensor, slices: Tensor | None = None) -> Tensor:
    """Values (N, ...) in float64 at u (N, 2) of a table (R, C, ...), or of table `slices` (N,) of (P, R, C, ...)."""
    if slices is None:
        table, slices = table[None], torch.zeros(len(u), dtype=torch.long, device=u.device)
    _, rows, columns = table.shape[:3]
    flat = table.reshape(-1, *table.shape[3:])
    column, x = cell(u[:, 0], columns)
    row, y = cell(u[:, 1], rows)
    first = (slices * rows + row) * columns + column
    total = torch.zeros(len(u), *flat.shape[1:], dtype=torch.float64, device=u.device)
    corners = ((0, (1 - x) * (1 - y)), (1, x * (1 - y)), (columns, (1 - x) * y), (columns + 1, x * y))
    for step, weight in corners:
        total += weight.reshape(-1, *[1] * (flat.dim() - 1)) * flat[first + step]
    return total


@dataclass(frozen=True)
class MarginalConditional:
    """The warp of P densities, blended by weights that sum to 1.

    `density` (P, R, C) is scaled so that each integrates to 1 over the unit square; `along` (P, R, C) is its
    integral along a row up to each node, `marginal` (P, R) that of the whole row, `up` (P, R) the integral of
    `marginal` up to each row. All float64.
    """

    density: Tensor
    along: Tensor
    marginal: Tensor
    up: Tensor

    @classmethod
    def of(cls, density: Tensor) -> "MarginalConditional":
        """The warp of densities (P, R, C) ≥ 0 of any scale, R, C ≥ 2, each with an integral above 0."""
        density = density.double()
        _, rows, columns = density.shape
        along = _integral(density) / (columns - 1)
        up = _integral(along[..., -1]) / (rows - 1)
        whole = up[:, -1:]
        return cls(density / whole[..., None], along / whole[..., None], along[..., -1] / whole, up / whole)

    def invert(self, u: Tensor, slices: Tensor, weights: Tensor) -> Tensor:
        """s (N, 2) of u (N, 2) under the blend of the densities `slices` (N, K) by `weights` (N, K).

        A row without any density keeps its x: there is nothing that it could be spread by.
        """
        _, rows, columns = self.density.shape
        column, x = cell(u[:, 0], columns)
        row, y = cell(u[:, 1], rows)
        lower, upper = self._row(slices, weights, row, column, x), self._row(slices, weights, row + 1, column, x)
        part = torch.lerp(lower[0], upper[0], y)
        whole = torch.lerp(lower[1], upper[1], y)
        across = torch.where(whole > 0, part / torch.where(whole > 0, whole, 1), u[:, 0])
        below = (weights * self.up[slices, row[:, None]]).sum(1)
        up = below + y * (lower[1] + y / 2 * (upper[1] - lower[1])) / (rows - 1)
        return torch.stack((across, up), 1).clamp(0, 1)

    def sample(self, s: Tensor, number: int) -> Tensor:
        """u (N, 2) of s (N, 2) in the unit square under density `number` alone: `invert` undone.

        Where nothing lies before the first or behind the last point with density, that point is the answer.
        """
        _, rows, columns = self.density.shape
        below = s.clamp(0, 1 - _ALMOST)
        up, marginal = self.up[number], self.marginal[number]
        row = _last_not_above(up.expand(len(s), -1), below[:, 1])
        y = _part(marginal[row], marginal[row + 1], (below[:, 1] - up[row]) * (rows - 1))
        whole = torch.lerp(marginal[row], marginal[row + 1], y)
        along = torch.lerp(self.along[number, row], self.along[number, row + 1], y[:, None])
        wanted = below[:, 0] * whole
        column = _last_not_above(along, wanted)
        ends = [
            torch.lerp(self.density[number, row, k], self.density[number, row + 1, k], y) for k in (column, column + 1)
        ]
        x = _part(ends[0], ends[1], (wanted - along.gather(1, column[:, None])[:, 0]) * (columns - 1))
        across = torch.where(whole > 0, (column + x) / (columns - 1), s[:, 0])
        return torch.stack((across, (row + y) / (rows - 1)), 1).clamp(0, 1)

    def _row(self, slices: Tensor, weights: Tensor, row: Tensor, column: Tensor, x: Tensor) -> tuple[Tensor, Tensor]:
        """(integral up to x, integral of the whole row) (N,) of the blended densities in their `row`."""
        row, column, x = row[:, None], column[:, None], x[:, None]
        here, there = self.density[slices, row, column], self.density[slices, row, column + 1]
        step = x * (here + x / 2 * (there - here)) / (self.density.shape[2] - 1)
        return (weights * (self.along[slices, row, column] + step)).sum(1), (weights * self.marginal[slices, row]).sum(
            1
        )


def _last_not_above(rising: Tensor, value: Tensor) -> Tensor:
    """The last cell (N,) of rows (N, n) of rising numbers that begins at or below `value` (N,)."""
    cell = torch.searchsorted(rising.contiguous(), value[:, None].contiguous(), right=True)[:, 0] - 1
    return cell.clamp(0, rising.shape[1] - 2)


def _part(left: Tensor, right: Tensor, area: Tensor) -> Tensor:
    """The place in [0, 1] up to which a density that goes from `left` to `right` over a unit cell holds `area`."""
    # The root of (right − left)/2 x² + left x = area in the form that does not cancel.
    root = (left**2 + 2 * (right - left) * area).clamp_min(0).sqrt()
    return torch.where(left + root > 0, 2 * area / (left + root).clamp_min(1e-300), torch.zeros_like(area)).clamp(0, 1)


def _integral(values: Tensor) -> Tensor:
    """Trapezoids of step 1 summed along the last axis, 0 at the first node; same shape."""
    halves = (values[..., 1:] + values[..., :-1]) / 2
    return torch.cat((torch.zeros_like(values[..., :1]), halves.cumsum(-1)), -1)
