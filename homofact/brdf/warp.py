"""Bilinear tables on the unit square, and the warp that spreads a density evenly over it.

A table has its R × C nodes at the ends and equal steps between them, row index along the second
coordinate, so that u = (0, 0) is the first node and (1, 1) the last. The marginal-conditional warp of a
density p (Dupuy and Jakob 2018, section 4) takes u = (x, y) to

    s = ( ∫₀ˣ p(x', y) dx' / ∫₀¹ p(x', y) dx',  ∫₀ʸ ∫₀¹ p(x', y') dx' dy' ),

so that equal areas of s contain equal shares of p. p is bilinear between its nodes, and the integrals in this module
are exact for it.

Both are compiled (numba): a measurement is evaluated some million times before it is fitted, and each lookup with
tensor operations would write and read a dozen arrays.
"""

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from homofact.linear.kernels import kernel

# The share of a density that is left out at its end, so that an inverse lies where there is some.
_ALMOST = 1e-12


def bilinear(table: Tensor, u: Tensor, slices: Tensor | None = None, weights: Tensor | None = None) -> Tensor:
    """Return values (N, ...) in float64 at u (N, 2) of a table (R, C, ...), or of (P, R, C, ...) at `slices` (N,).

    With `slices` (N, K), the result is the sum over K tables with `weights` (N, K).
    """
    if slices is None:
        table, slices = table[None], torch.zeros(len(u), dtype=torch.long, device=u.device)
    shape = table.shape[3:]
    if weights is None:
        slices, weights = slices[:, None], torch.ones(len(u), 1, dtype=torch.float64, device=u.device)
    flat = table.reshape(*table.shape[:3], -1)
    out = np.zeros((len(u), flat.shape[3]))
    _bilinear(_array(flat), _array(u.double()), _array(slices), _array(weights), out)
    return torch.from_numpy(out).reshape(len(u), *shape).to(u.device)


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
        """Return the warp of densities (P, R, C) ≥ 0 of any scale, R, C ≥ 2, each with an integral above 0."""
        density = density.double()
        _, rows, columns = density.shape
        along = _integral(density) / (columns - 1)
        up = _integral(along[..., -1]) / (rows - 1)
        whole = up[:, -1:]
        return cls(density / whole[..., None], along / whole[..., None], along[..., -1] / whole, up / whole)

    def invert(self, u: Tensor, slices: Tensor, weights: Tensor) -> Tensor:
        """Return s (N, 2) for u (N, 2), for the mix of the densities `slices` (N, K) with `weights` (N, K).

        In a row whose density is zero everywhere, x is unchanged.
        """
        out = np.zeros((len(u), 2))
        arrays = (_array(each) for each in (self.density, self.along, self.marginal, self.up))
        _invert(*arrays, _array(u.double()), _array(slices), _array(weights), out)
        return torch.from_numpy(out).to(u.device)

    def sample(self, s: Tensor, number: int) -> Tensor:
        """Return u (N, 2) for s (N, 2) in the unit square, for the density `number`: the inverse of `invert`.

        The result is never before the first or after the last point with a density above 0.
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


def _array(values: Tensor) -> np.ndarray:
    return np.ascontiguousarray(values.detach().cpu().numpy())


@kernel(nogil=True, inline="always")
def _cell(coordinate: float, nodes: int) -> tuple:
    """(index of the cell, place in it in [0, 1]) of a coordinate in [0, 1] among `nodes` ≥ 2 nodes."""
    place = min(max(coordinate, 0.0), 1.0) * (nodes - 1)
    # What is no number has no cell: it must not become a place in memory.
    index = min(int(place), nodes - 2) if place >= 0 else 0
    return index, place - index


@kernel(nogil=True, inline="always")
def _between(one: float, other: float, part: float) -> float:
    """Linear interpolation that is exact at both ends."""
    return one + part * (other - one) if part < 0.5 else other - (other - one) * (1 - part)


@kernel(nogil=True)
def _bilinear(table: np.ndarray, u: np.ndarray, slices: np.ndarray, weights: np.ndarray, out: np.ndarray) -> None:
    """Adds to `out` (N, Q) the blended values of a table (P, R, C, Q) at u (N, 2)."""
    _, rows, columns, channels = table.shape
    for n in range(len(u)):
        column, x = _cell(u[n, 0], columns)
        row, y = _cell(u[n, 1], rows)
        w00, w01, w10, w11 = (1 - x) * (1 - y), x * (1 - y), (1 - x) * y, x * y
        for k in range(slices.shape[1]):
            p, weight = slices[n, k], weights[n, k]
            for q in range(channels):
                value = w00 * table[p, row, column, q] + w01 * table[p, row, column + 1, q]
                value += w10 * table[p, row + 1, column, q]
                value += w11 * table[p, row + 1, column + 1, q]
                out[n, q] += weight * value


@kernel(nogil=True)
def _invert(
    density: np.ndarray,
    along: np.ndarray,
    marginal: np.ndarray,
    up: np.ndarray,
    u: np.ndarray,
    slices: np.ndarray,
    weights: np.ndarray,
    out: np.ndarray,
) -> None:
    """`MarginalConditional.invert` into `out` (N, 2)."""
    _, rows, columns = density.shape
    for n in range(len(u)):
        column, x = _cell(u[n, 0], columns)
        row, y = _cell(u[n, 1], rows)
        # Of the blended densities in the rows below and above: the integral up to x, and that of the whole row.
        part0, part1, whole0, whole1, below = 0.0, 0.0, 0.0, 0.0, 0.0
        for k in range(slices.shape[1]):
            p, weight = slices[n, k], weights[n, k]
            here, there = density[p, row, column], density[p, row, column + 1]
            part0 += weight * (along[p, row, column] + x * (here + x / 2 * (there - here)) / (columns - 1))
            here, there = density[p, row + 1, column], density[p, row + 1, column + 1]
            part1 += weight * (along[p, row + 1, column] + x * (here + x / 2 * (there - here)) / (columns - 1))
            whole0 += weight * marginal[p, row]
            whole1 += weight * marginal[p, row + 1]
            below += weight * up[p, row]
        part, whole = _between(part0, part1, y), _between(whole0, whole1, y)
        across = part / whole if whole > 0 else u[n, 0]
        out[n, 0] = min(max(across, 0.0), 1.0)
        out[n, 1] = min(max(below + y * (whole0 + y / 2 * (whole1 - whole0)) / (rows - 1), 0.0), 1.0)
