"""Normal equations of the texels, accumulated in one pass over the samples without forming B.

Row n of B holds the bilinear weights of all lookups of sample n; B is N × T with 4 weights a lookup.
Minimising Σ wn (fn − (By)n)² needs only BᵀWB (T × T), BᵀWf (T × C) and, for the value at the minimum,
Σ wn fn² (C): memory T², whatever N. Two paths, tested to agree: a compiled one for the CPU (one private
matrix a thread, summed in order, so the result depends on the number of threads only in rounding) and
one in torch for any device, in chunks.
"""

import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numba
import numpy as np
import torch
from torch import Tensor

from homofact.linear.bilinear import stencil
from homofact.linear.layout import CLAMPED, Axes, Axis, Shape

# Multiply-adds under which a second thread costs more than it saves.
WORTH_A_THREAD = 1_000_000


@dataclass(frozen=True)
class Lookup:
    """A bilinear lookup: uv = matrix · x[start : start + k], in a texture of `shape` with first unknown `offset`.

    `fractions` is how many steps a sampler divides a texel into (256 on most hardware); 0 is exact. `axes` are the
    kinds of the texture's axes.
    """

    start: int
    matrix: Tensor
    shape: Shape
    offset: int
    fractions: int = 0
    axes: Axes = CLAMPED


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
        texels, weights = stencil(x @ lookup.matrix.to(x).T, lookup.shape, lookup.fractions, lookup.axes)
        numbers.append(texels + lookup.offset)
        values.append(weights)
    return torch.cat(numbers, 1), torch.cat(values, 1)


def accumulate_compiled(
    coordinates: Tensor, lookups: tuple[Lookup, ...], targets: Tensor, weights: Tensor, unknowns: int
) -> NormalEquations:
    """The same on the CPU, compiled: stencils are made and used sample by sample, none is stored."""
    entries = 4 * len(lookups)
    arrays = (coordinates.contiguous().numpy(), *pack(lookups), targets.contiguous().numpy())
    parts = _on_threads(
        lambda begin, end: _accumulate(*arrays, weights.contiguous().numpy(), unknowns, begin, end),
        coordinates.shape[0],
        entries * entries,
    )
    half = _total([part[0] for part in parts])
    return NormalEquations(
        half + half.T, _total([part[1] for part in parts]), _total([part[2] for part in parts]), float(weights.sum())
    )


def _on_threads(kernel: Callable[[int, int], Any], count: int, cost: int) -> list[Any]:
    """The kernel's results over ranges of samples, in order: one range a thread where the work is worth a thread.

    Plain threads round a kernel that lets go of the interpreter's lock, not a parallel loop: its waiting
    workers would take the cores from the factorization that follows.
    """
    threads = max(1, min(numba.get_num_threads(), count * cost // WORTH_A_THREAD))
    edges = [thread * count // threads for thread in range(threads + 1)]
    if threads == 1:
        return [kernel(0, count)]
    return list(_workers(threads).map(kernel, edges[:-1], edges[1:]))


@lru_cache(maxsize=1)
def _workers(threads: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(threads, thread_name_prefix="normal")


def _total(parts: list[np.ndarray]) -> Tensor:
    total = parts[0]
    for part in parts[1:]:
        total = total + part
    return torch.from_numpy(total)


def pack(lookups: tuple[Lookup, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Matrices (L, 2, 4) float64 and int64 (L, 8), as the kernels read them.

    Of each lookup (start, k, rows, columns, offset, fractions, whether rows go round, whether columns do).
    """
    matrices = np.zeros((len(lookups), 2, 4))
    layout = np.zeros((len(lookups), 8), dtype=np.int64)
    for number, lookup in enumerate(lookups):
        k = lookup.matrix.shape[1]
        matrices[number, :, :k] = lookup.matrix.numpy()
        rounds = (axis is Axis.PERIODIC for axis in lookup.axes)
        layout[number] = (lookup.start, k, *lookup.shape, lookup.offset, lookup.fractions, *rounds)
    return matrices, layout


@numba.njit(cache=True, inline="always")
def _cell(coordinate, size, periodic):  # pragma: no cover (compiled)
    """The lower texel, the next, and the fraction towards it: `bilinear._cell`."""
    if periodic:
        position = (coordinate + 1.0) * (0.5 * size)
        below = np.floor(position)
        lower = int(below) % size
        return lower, (lower + 1) % size, position - below
    position = min(max((coordinate + 1.0) * (0.5 * (size - 1)), 0.0), size - 1.0)
    lower = min(int(position), max(size - 2, 0))
    return lower, min(lower + 1, size - 1), position - lower


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
    column, right, fu = _cell(u, columns, layout[lookup, 7])
    row, above, fv = _cell(v, rows, layout[lookup, 6])
    steps = layout[lookup, 5]
    if steps > 0:
        fu = np.floor(fu * steps + 0.5) / steps
        fv = np.floor(fv * steps + 0.5) / steps
    place = 4 * lookup
    numbers[place] = offset + row * columns + column
    numbers[place + 1] = offset + row * columns + right
    numbers[place + 2] = offset + above * columns + column
    numbers[place + 3] = offset + above * columns + right
    values[place] = (1.0 - fu) * (1.0 - fv)
    values[place + 1] = fu * (1.0 - fv)
    values[place + 2] = (1.0 - fu) * fv
    values[place + 3] = fu * fv


@numba.njit(cache=True, nogil=True)
def _accumulate(x, matrices, layout, targets, weights, unknowns, begin, end):  # pragma: no cover (compiled)
    """BᵀWB without its mirrored half (pairs of entries once, the diagonal halved), BᵀWf and energy of a range."""
    channels = targets.shape[1]
    entries = 4 * layout.shape[0]
    matrix = np.zeros((unknowns, unknowns))
    rhs = np.zeros((unknowns, channels))
    energy = np.zeros(channels)
    numbers = np.empty(entries, dtype=np.int64)
    values = np.empty(entries)
    for n in range(begin, end):
        w = weights[n]
        for lookup in range(layout.shape[0]):
            _stencil(x, n, matrices, layout, lookup, numbers, values)
        for a in range(entries):
            row = numbers[a]
            weighted = w * values[a]
            for b in range(a):
                matrix[row, numbers[b]] += weighted * values[b]
            matrix[row, row] += 0.5 * weighted * values[a]
            for c in range(channels):
                rhs[row, c] += weighted * targets[n, c]
        for c in range(channels):
            energy[c] += w * targets[n, c] ** 2
    return matrix, rhs, energy


def gradient(
    coordinates: Tensor, lookups: tuple[Lookup, ...], targets: Tensor, weights: Tensor, texels: Tensor
) -> tuple[Tensor, float]:
    """(∂/∂M of Σn wn |fn − (By)n|² at fixed texels (L, 2, 4), that sum): compiled on the CPU, torch elsewhere.

    The columns past a lookup's k are zero. A cell is 2/(M − 1) wide, on a periodic axis 2/M. In the flat cells that
    clamping makes the derivative is 0; at the kinks between cells it is that of the cell the floor picks.
    """
    if coordinates.device.type != "cpu":
        return gradient_torch(coordinates, lookups, targets, weights, texels)
    arrays = (coordinates.contiguous().numpy(), *pack(lookups), targets.contiguous().numpy())
    parts = _on_threads(
        lambda begin, end: _gradient(*arrays, weights.contiguous().numpy(), texels.contiguous().numpy(), begin, end),
        coordinates.shape[0],
        64 * len(lookups),
    )
    return _total([part[0] for part in parts]), sum(part[1] for part in parts)


def gradient_torch(
    coordinates: Tensor, lookups: tuple[Lookup, ...], targets: Tensor, weights: Tensor, texels: Tensor
) -> tuple[Tensor, float]:
    """As `gradient`, by automatic differentiation on any device."""
    matrices = [lookup.matrix.to(coordinates).clone().requires_grad_() for lookup in lookups]
    found = torch.zeros_like(targets)
    for lookup, matrix in zip(lookups, matrices, strict=True):
        x = coordinates[:, lookup.start : lookup.start + matrix.shape[1]]
        numbers, values = stencil(x @ matrix.T, lookup.shape, axes=lookup.axes)
        found = found + (texels[numbers + lookup.offset] * values[..., None]).sum(1)
    total = (weights[:, None] * (targets - found) ** 2).sum()
    result = torch.zeros(len(lookups), 2, 4, dtype=torch.float64, device=coordinates.device)
    for number, part in enumerate(torch.autograd.grad(total, matrices)):
        result[number, :, : part.shape[1]] = part
    return result, float(total.detach())


@numba.njit(cache=True, nogil=True)
def _gradient(x, matrices, layout, targets, weights, texels, begin, end):  # pragma: no cover (compiled)
    """The derivative by every lookup's matrix (L, 2, 4) and the sum of squares, of a range."""
    channels = targets.shape[1]
    lookups = layout.shape[0]
    slopes = np.zeros((lookups, 2, 4))
    squares = 0.0
    numbers = np.empty(4 * lookups, dtype=np.int64)
    values = np.empty(4 * lookups)
    inside = np.empty((lookups, 2), dtype=np.bool_)
    difference = np.empty(channels)
    for n in range(begin, end):
        for lookup in range(lookups):
            _stencil(x, n, matrices, layout, lookup, numbers, values)
            start = layout[lookup, 0]
            for row in range(2):
                position = 0.0
                for axis in range(layout[lookup, 1]):
                    position += matrices[lookup, row, axis] * x[n, start + axis]
                # The matrix's first row runs along the columns.
                inside[lookup, row] = layout[lookup, 7 - row] or -1.0 <= position <= 1.0
        w = weights[n]
        for c in range(channels):
            total = targets[n, c]
            for entry in range(4 * lookups):
                total -= values[entry] * texels[numbers[entry], c]
            difference[c] = total
            squares += w * total * total
        for lookup in range(lookups):
            place = 4 * lookup
            # The fractions are sums of the weights of one side of the cell.
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
            start = layout[lookup, 0]
            cells_u = layout[lookup, 3] - 1.0 + layout[lookup, 7]
            cells_v = layout[lookup, 2] - 1.0 + layout[lookup, 6]
            slope_u *= -w * cells_u if inside[lookup, 0] else 0.0
            slope_v *= -w * cells_v if inside[lookup, 1] else 0.0
            for axis in range(layout[lookup, 1]):
                slopes[lookup, 0, axis] += slope_u * x[n, start + axis]
                slopes[lookup, 1, axis] += slope_v * x[n, start + axis]
    return slopes, squares


def warm_up() -> float:
    """Compile the kernels, or load them from their cache, so that the first fit need not pay for it.

    The seconds that compiling took; 0 where the cache had them.
    """
    began = time.perf_counter()
    nothing = torch.zeros(4, 4, dtype=torch.float64, device="cpu")
    lookup = Lookup(0, nothing[:2, :2], (2, 2), 0)
    x, f, w = nothing[:1, :2], nothing[:1, :1], nothing[0, :1]
    accumulate_compiled(x, (lookup,), f, w, 4)
    gradient(x, (lookup,), f, w, nothing[:, :1].contiguous())
    compiled = any(kernel.stats.cache_misses for kernel in (_accumulate, _gradient))
    return time.perf_counter() - began if compiled else 0.0
