"""Normal equations of the texels, accumulated in one pass over the samples without forming B.

Row n of B holds the bilinear weights of all lookups of sample n; B is N × T with 4 weights a lookup.
Minimising Σ wn (fn − (By)n)² needs only BᵀWB (T × T), BᵀWf (T × C) and, for the value at the minimum,
Σ wn fn² (C): memory T², whatever N. Two paths, tested to agree: a compiled one for the CPU (one private
matrix a thread, summed in order, so the result depends on the number of threads only in rounding) and
one in torch for any device, in chunks.
"""

from dataclasses import dataclass

import numba
import numpy as np
import torch
from torch import Tensor

from homofact.linear.bilinear import stencil


@dataclass(frozen=True)
class Lookup:
    """A bilinear lookup: uv = matrix · x[start : start + k], in a texture of `shape` with first unknown `offset`."""

    start: int
    matrix: Tensor
    shape: tuple[int, int]
    offset: int


@dataclass(frozen=True)
class NormalEquations:
    """BᵀWB (T, T), BᵀWf (T, C), Σ w f² (C,) and Σ w of one accumulation; all float64 on one device."""

    matrix: Tensor
    rhs: Tensor
    energy: Tensor
    weight: float

    def error(self, texels: Tensor) -> float:
        """Weighted mean over samples and channels of (f − By)², from the quadratic form alone.

        Rounding leaves about 1e-15 of the energy: far under any error met with measured data.
        """
        quadratic = (texels * (self.matrix @ texels - 2 * self.rhs)).sum(0) + self.energy
        return float(quadratic.clamp_min(0).mean()) / self.weight


def accumulate(
    coordinates: Tensor, lookups: tuple[Lookup, ...], targets: Tensor, weights: Tensor, unknowns: int
) -> NormalEquations:
    """Accumulate over coordinates (N, D), targets (N, C) and weights (N,), by the path of their device."""
    if coordinates.device.type == "cpu":
        return accumulate_compiled(coordinates, lookups, targets, weights, unknowns)
    return accumulate_torch(coordinates, lookups, targets, weights, unknowns)


def accumulate_torch(
    coordinates: Tensor,
    lookups: tuple[Lookup, ...],
    targets: Tensor,
    weights: Tensor,
    unknowns: int,
    chunk: int = 65_536,
) -> NormalEquations:
    """The same on any device: scattered outer products, `chunk` samples at a time."""
    device, size = coordinates.device, unknowns
    matrix = torch.zeros(size * size, dtype=torch.float64, device=device)
    rhs = torch.zeros(size, targets.shape[1], dtype=torch.float64, device=device)
    energy = torch.zeros(targets.shape[1], dtype=torch.float64, device=device)
    for begin in range(0, coordinates.shape[0], chunk):
        piece = slice(begin, begin + chunk)
        w, f = weights[piece, None], targets[piece]
        numbers, values = stencil_rows(coordinates[piece], lookups)
        weighted = values * w
        outer = weighted[:, :, None] * values[:, None, :]
        places = numbers[:, :, None] * size + numbers[:, None, :]
        matrix.index_add_(0, places.reshape(-1), outer.reshape(-1))
        rhs.index_add_(0, numbers.reshape(-1), (weighted[:, :, None] * f[:, None, :]).reshape(-1, f.shape[1]))
        energy += (w * f**2).sum(0)
    return NormalEquations(matrix.reshape(size, size), rhs, energy, float(weights.sum()))


def stencil_rows(coordinates: Tensor, lookups: tuple[Lookup, ...]) -> tuple[Tensor, Tensor]:
    """The non-zeros of B: unknown numbers (N, 4L) int64 and weights (N, 4L); a number may stand twice in a row."""
    numbers, values = [], []
    for lookup in lookups:
        x = coordinates[:, lookup.start : lookup.start + lookup.matrix.shape[1]]
        texels, weights = stencil(x @ lookup.matrix.to(x).T, lookup.shape)
        numbers.append(texels + lookup.offset)
        values.append(weights)
    return torch.cat(numbers, 1), torch.cat(values, 1)


def accumulate_compiled(
    coordinates: Tensor, lookups: tuple[Lookup, ...], targets: Tensor, weights: Tensor, unknowns: int
) -> NormalEquations:
    """The same on the CPU, compiled: stencils are made and used sample by sample, none is stored."""
    matrix, rhs, energy = _accumulate(
        coordinates.contiguous().numpy(),
        *pack(lookups),
        targets.contiguous().numpy(),
        weights.contiguous().numpy(),
        unknowns,
        max(1, min(numba.get_num_threads(), coordinates.shape[0] // 512)),
    )
    return NormalEquations(
        torch.from_numpy(matrix), torch.from_numpy(rhs), torch.from_numpy(energy), float(weights.sum())
    )


def pack(lookups: tuple[Lookup, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Matrices (L, 2, 4) float64 and (start, k, rows, columns, offset) (L, 5) int64, as the kernels read them."""
    matrices = np.zeros((len(lookups), 2, 4))
    layout = np.zeros((len(lookups), 5), dtype=np.int64)
    for number, lookup in enumerate(lookups):
        k = lookup.matrix.shape[1]
        matrices[number, :, :k] = lookup.matrix.numpy()
        layout[number] = (lookup.start, k, *lookup.shape, lookup.offset)
    return matrices, layout


@numba.njit(cache=True, inline="always")
def _stencil(x, n, matrices, layout, lookup, numbers, values):  # pragma: no cover (compiled)
    """Write the four texels and weights of one lookup of sample n at position 4·lookup; return (fu, fv)."""
    start, k = layout[lookup, 0], layout[lookup, 1]
    rows, columns, offset = layout[lookup, 2], layout[lookup, 3], layout[lookup, 4]
    u = 0.0
    v = 0.0
    for axis in range(k):
        u += matrices[lookup, 0, axis] * x[n, start + axis]
        v += matrices[lookup, 1, axis] * x[n, start + axis]
    u = min(max((u + 1.0) * (0.5 * (columns - 1)), 0.0), columns - 1.0)
    v = min(max((v + 1.0) * (0.5 * (rows - 1)), 0.0), rows - 1.0)
    column = min(int(u), max(columns - 2, 0))
    row = min(int(v), max(rows - 2, 0))
    fu = u - column
    fv = v - row
    right = 1 if column + 1 < columns else 0
    above = columns if row + 1 < rows else 0
    first = offset + row * columns + column
    place = 4 * lookup
    numbers[place] = first
    numbers[place + 1] = first + right
    numbers[place + 2] = first + above
    numbers[place + 3] = first + above + right
    values[place] = (1.0 - fu) * (1.0 - fv)
    values[place + 1] = fu * (1.0 - fv)
    values[place + 2] = (1.0 - fu) * fv
    values[place + 3] = fu * fv


@numba.njit(cache=True, parallel=True)
def _accumulate(x, matrices, layout, targets, weights, unknowns, threads):  # pragma: no cover (compiled)
    count = x.shape[0]
    channels = targets.shape[1]
    entries = 4 * layout.shape[0]
    matrix = np.zeros((threads, unknowns, unknowns))
    diagonal = np.zeros((threads, unknowns))
    rhs = np.zeros((threads, unknowns, channels))
    energy = np.zeros((threads, channels))
    for thread in numba.prange(threads):
        numbers = np.empty(entries, dtype=np.int64)
        values = np.empty(entries)
        mine = matrix[thread]
        mine_rhs = rhs[thread]
        for n in range(thread * count // threads, (thread + 1) * count // threads):
            w = weights[n]
            for lookup in range(layout.shape[0]):
                _stencil(x, n, matrices, layout, lookup, numbers, values)
            for a in range(entries):
                row = numbers[a]
                weighted = w * values[a]
                diagonal[thread, row] += weighted * values[a]
                for b in range(a):
                    mine[row, numbers[b]] += weighted * values[b]
                for c in range(channels):
                    mine_rhs[row, c] += weighted * targets[n, c]
            for c in range(channels):
                energy[thread, c] += w * targets[n, c] ** 2
    # A pair of entries was added once: its other half is the mirror image.
    total = np.empty((unknowns, unknowns))
    for row in numba.prange(unknowns):
        for column in range(unknowns):
            value = 0.0
            for thread in range(threads):
                value += matrix[thread, row, column] + matrix[thread, column, row]
            total[row, column] = value
        for thread in range(threads):
            total[row, row] += diagonal[thread, row]
    return total, rhs.sum(axis=0), energy.sum(axis=0)


def gradient(
    coordinates: Tensor, lookups: tuple[Lookup, ...], targets: Tensor, weights: Tensor, texels: Tensor
) -> tuple[Tensor, float]:
    """(∂/∂M of Σn wn |fn − (By)n|² at fixed texels (L, 2, 4), that sum): compiled on the CPU, torch elsewhere.

    The columns past a lookup's k are zero. In the flat cells that clamping makes the derivative is 0; at
    the kinks between cells it is that of the cell the floor picks.
    """
    if coordinates.device.type != "cpu":
        return gradient_torch(coordinates, lookups, targets, weights, texels)
    parts, sums = _gradient(
        coordinates.contiguous().numpy(),
        *pack(lookups),
        targets.contiguous().numpy(),
        weights.contiguous().numpy(),
        texels.contiguous().numpy(),
        max(1, min(numba.get_num_threads(), coordinates.shape[0] // 512)),
    )
    return torch.from_numpy(parts), float(sums)


def gradient_torch(
    coordinates: Tensor, lookups: tuple[Lookup, ...], targets: Tensor, weights: Tensor, texels: Tensor
) -> tuple[Tensor, float]:
    """As `gradient`, by automatic differentiation on any device."""
    matrices = [lookup.matrix.to(coordinates).requires_grad_() for lookup in lookups]
    found = torch.zeros_like(targets)
    for lookup, matrix in zip(lookups, matrices, strict=True):
        x = coordinates[:, lookup.start : lookup.start + matrix.shape[1]]
        numbers, values = stencil(x @ matrix.T, lookup.shape)
        found = found + (texels[numbers + lookup.offset] * values[..., None]).sum(1)
    total = (weights[:, None] * (targets - found) ** 2).sum()
    result = torch.zeros(len(lookups), 2, 4, dtype=torch.float64, device=coordinates.device)
    for number, part in enumerate(torch.autograd.grad(total, matrices)):
        result[number, :, : part.shape[1]] = part
    return result, float(total)


@numba.njit(cache=True, parallel=True)
def _gradient(x, matrices, layout, targets, weights, texels, threads):  # pragma: no cover (compiled)
    count = x.shape[0]
    channels = targets.shape[1]
    lookups = layout.shape[0]
    parts = np.zeros((threads, lookups, 2, 4))
    sums = np.zeros(threads)
    for thread in numba.prange(threads):
        numbers = np.empty(4 * lookups, dtype=np.int64)
        values = np.empty(4 * lookups)
        difference = np.empty(channels)
        for n in range(thread * count // threads, (thread + 1) * count // threads):
            for lookup in range(lookups):
                _stencil(x, n, matrices, layout, lookup, numbers, values)
            w = weights[n]
            for c in range(channels):
                total = targets[n, c]
                for entry in range(4 * lookups):
                    total -= values[entry] * texels[numbers[entry], c]
                difference[c] = total
                sums[thread] += w * total * total
            for lookup in range(lookups):
                place = 4 * lookup
                # 1 − fu and 1 − fv are sums of the weights of one side of the cell.
                fu = values[place + 1] + values[place + 3]
                fv = values[place + 2] + values[place + 3]
                slope_u = 0.0
                slope_v = 0.0
                for c in range(channels):
                    y00 = texels[numbers[place], c]
                    y01 = texels[numbers[place + 1], c]
                    y10 = texels[numbers[place + 2], c]
                    y11 = texels[numbers[place + 3], c]
                    slope_u += difference[c] * ((1.0 - fv) * (y01 - y00) + fv * (y11 - y10))
                    slope_v += difference[c] * ((1.0 - fu) * (y10 - y00) + fu * (y11 - y01))
                start, k = layout[lookup, 0], layout[lookup, 1]
                u = 0.0
                v = 0.0
                for axis in range(k):
                    u += matrices[lookup, 0, axis] * x[n, start + axis]
                    v += matrices[lookup, 1, axis] * x[n, start + axis]
                slope_u *= -w * (layout[lookup, 3] - 1.0) if -1.0 <= u <= 1.0 else 0.0
                slope_v *= -w * (layout[lookup, 2] - 1.0) if -1.0 <= v <= 1.0 else 0.0
                for axis in range(k):
                    parts[thread, lookup, 0, axis] += slope_u * x[n, start + axis]
                    parts[thread, lookup, 1, axis] += slope_v * x[n, start + axis]
    return parts.sum(axis=0), sums.sum()
