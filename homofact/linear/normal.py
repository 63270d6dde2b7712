"""Normal equations of the texels, accumulated in one pass over the samples without forming B.

Row n of B holds the bilinear weights of all lookups of sample n; B is N × T with 4 weights per lookup. Minimising Σ wn
(fn − (By)n)² needs only BᵀWB (T × T), BᵀWf (T × C) and, for the value at the minimum, Σ wn fn² (C): memory T², whatever
N. There are two implementations, which tests compare. The compiled one for the CPU splits the samples into a fixed
number of ranges, each with a private matrix, and adds these in order, so the result is bit-identical for any number of
threads. The torch implementation runs on any device, in chunks.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import torch
from torch import Tensor

from homofact.linear.bilinear import stencil
from homofact.linear.definite import make_symmetric
from homofact.linear.kernels import kernel
from homofact.linear.layout import CLAMPED, Axes, Axis, Shape
from homofact.linear.threads import in_parallel

# Multiply-adds under which a second range of samples costs more than a second thread saves.
_WORTH_A_RANGE = 1_000_000
_RANGES = 2


@dataclass(frozen=True)
class Lookup:
    """A bilinear lookup: uv = matrix · x[start : start + k], in a texture of `shape` with first unknown `offset`.

    `fractions` is the number of steps into which a sampler divides a texel (256 on most hardware); 0 is exact. `axes`
    are the kinds of the texture's axes.
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

        The rounding error is about 1e-15 of the energy Σ w f², far below the errors on measured data.
        """
        quadratic = (texels * (self.matrix @ texels - 2 * self.rhs)).sum(0) + self.energy
        return float(quadratic.clamp_min(0).mean()) / self.weight


def total(parts: Sequence[NormalEquations]) -> NormalEquations:
    """Return the equations of all samples of `parts`, added in their order."""
    matrix, rhs, energy = parts[0].matrix.clone(), parts[0].rhs, parts[0].energy
    for part in parts[1:]:
        matrix += part.matrix
        rhs, energy = rhs + part.rhs, energy + part.energy
    return NormalEquations(matrix, rhs, energy, sum(part.weight for part in parts))


def accumulate(
    coordinates: Tensor, lookups: tuple[Lookup, ...], targets: Tensor, weights: Tensor, unknowns: int
) -> NormalEquations:
    """Accumulate the equations of coordinates (N, D), targets (N, C) and weights (N,), on their device."""
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
    """Accumulate the equations on any device by scattered outer products, `chunk` samples at a time."""
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
    """Return the non-zeros of B: indices (N, 4L) int64 and weights (N, 4L); an index may occur twice in a row."""
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
    """Accumulate the equations on the CPU in compiled code, which computes the stencils without storing them."""
    matrix, part, rhs, energy = accumulate_lower(coordinates, lookups, targets, weights, unknowns)
    make_symmetric(matrix, part)
    return NormalEquations(
        torch.from_numpy(matrix), torch.from_numpy(rhs), torch.from_numpy(energy), float(weights.sum())
    )


def accumulate_lower(
    coordinates: Tensor, lookups: tuple[Lookup, ...], targets: Tensor, weights: Tensor, unknowns: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return two lower triangles (T, T) whose sum is that of BᵀWB, BᵀWf (T, C) and Σ w f² (C,), on the CPU.

    The second triangle is empty (0, 0) for small problems.
    """
    entries = 4 * len(lookups)
    arrays = (coordinates.contiguous().numpy(), *pack(lookups), targets.contiguous().numpy())
    weighting = weights.contiguous().numpy()
    ranges = _ranges(coordinates.shape[0], entries * entries)
    halves = [np.zeros((unknowns, unknowns)) for _ in ranges]
    rest = in_parallel(lambda place: _accumulate(*arrays, weighting, halves[place], *ranges[place]), range(len(ranges)))
    rhs, energy = (np.sum([part[number] for part in rest], axis=0) for number in (0, 1))
    return halves[0], halves[1] if len(halves) > 1 else np.zeros((0, 0)), rhs, energy


def _ranges(count: int, cost: int) -> list[tuple[int, int]]:
    """Ranges (begin, end) of samples that are worked on by themselves: as many for equal work on every machine."""
    number = max(1, min(_RANGES, count * cost // _WORTH_A_RANGE))
    edges = [place * count // number for place in range(number + 1)]
    return list(pairwise(edges))


def pack(lookups: tuple[Lookup, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Return the matrices (L, 2, 4) as float64 and the integers (L, 8) as int64, in the format of the kernels.

    The integers of each lookup are (start, k, rows, columns, offset, fractions, periodic rows, periodic columns).
    """
    matrices = np.zeros((len(lookups), 2, 4))
    layout = np.zeros((len(lookups), 8), dtype=np.int64)
    for number, lookup in enumerate(lookups):
        k = lookup.matrix.shape[1]
        matrices[number, :, :k] = lookup.matrix.numpy()
        rounds = (axis is Axis.PERIODIC for axis in lookup.axes)
        layout[number] = (lookup.start, k, *lookup.shape, lookup.offset, lookup.fractions, *rounds)
    return matrices, layout


@kernel(inline="always")
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


@kernel(inline="always")
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


@kernel(nogil=True)
def _accumulate(x, matrices, layout, targets, weights, matrix, begin, end):  # pragma: no cover (compiled)
    """Add the lower triangle of a range's BᵀWB to `matrix`; its BᵀWf and energy."""
    channels = targets.shape[1]
    lookups = layout.shape[0]
    rhs = np.zeros((matrix.shape[0], channels))
    energy = np.zeros(channels)
    # Unsigned numbers are never counted from the end, which would be asked of every one of them.
    numbers = np.empty(4 * lookups, dtype=np.uint64)
    values = np.empty(4 * lookups)
    # How many entries come first that are of textures before a lookup's own: their columns are left of all its rows.
    firsts = np.zeros(lookups, dtype=np.int64)
    for lookup in range(lookups):
        while firsts[lookup] < 4 * lookup and layout[firsts[lookup] // 4, 4] < layout[lookup, 4]:
            firsts[lookup] += 4
    for n in range(begin, end):
        w = weights[n]
        for lookup in range(lookups):
            _stencil(x, n, matrices, layout, lookup, numbers, values)
        for lookup in range(lookups):
            first = firsts[lookup]
            for a in range(4 * lookup, 4 * lookup + 4):
                row = numbers[a]
                weighted = w * values[a]
                own, own_rhs = matrix[row], rhs[row]
                for b in range(first):
                    own[numbers[b]] += weighted * values[b]
                for b in range(first, a):
                    column = numbers[b]
                    # Two entries of a sample that share a texel count once for each order.
                    share = 2.0 if column == row else 1.0
                    matrix[max(row, column), min(row, column)] += share * weighted * values[b]
                own[row] += weighted * values[a]
                for c in range(channels):
                    own_rhs[c] += weighted * targets[n, c]
        for c in range(channels):
            energy[c] += w * targets[n, c] ** 2
    return rhs, energy


def gradient(
    coordinates: Tensor, lookups: tuple[Lookup, ...], targets: Tensor, weights: Tensor, texels: Tensor
) -> tuple[Tensor, float]:
    """Return the derivative (L, 2, 4) of Σn wn |fn − (By)n|² by the matrices M at fixed texels, and the sum itself.

    The columns beyond a lookup's k are zero. A cell is 2/(M − 1) wide, or 2/M on a periodic axis. The derivative is 0
    where lookups are clamped. At the kinks between cells, it is that of the cell which the floor function selects. The
    code is compiled on the CPU and uses torch on other devices.
    """
    if coordinates.device.type != "cpu":
        return gradient_torch(coordinates, lookups, targets, weights, texels)
    arrays = (coordinates.contiguous().numpy(), *pack(lookups), targets.contiguous().numpy())
    more = (weights.contiguous().numpy(), texels.contiguous().numpy())
    parts = in_parallel(lambda both: _gradient(*arrays, *more, *both), _ranges(coordinates.shape[0], 64 * len(lookups)))
    return torch.from_numpy(sum(part[0] for part in parts)), sum(part[1] for part in parts)


def gradient_torch(
    coordinates: Tensor, lookups: tuple[Lookup, ...], targets: Tensor, weights: Tensor, texels: Tensor
) -> tuple[Tensor, float]:
    """Return the same as `gradient`, by automatic differentiation on any device."""
    matrices = [lookup.matrix.to(coordinates).clone().requires_grad_() for lookup in lookups]
    fitted = torch.zeros_like(targets)
    for lookup, matrix in zip(lookups, matrices, strict=True):
        x = coordinates[:, lookup.start : lookup.start + matrix.shape[1]]
        numbers, values = stencil(x @ matrix.T, lookup.shape, axes=lookup.axes)
        fitted = fitted + (texels[numbers + lookup.offset] * values[..., None]).sum(1)
    total = (weights[:, None] * (targets - fitted) ** 2).sum()
    result = torch.zeros(len(lookups), 2, 4, dtype=torch.float64, device=coordinates.device)
    for number, part in enumerate(torch.autograd.grad(total, matrices)):
        result[number, :, : part.shape[1]] = part
    return result, float(total.detach())


@kernel(nogil=True)
def _gradient(x, matrices, layout, targets, weights, texels, begin, end):  # pragma: no cover (compiled)
    """The derivative by every lookup's matrix (L, 2, 4) and the sum of squares, of a range."""
    channels = targets.shape[1]
    lookups = layout.shape[0]
    slopes = np.zeros((lookups, 2, 4))
    squares = 0.0
    numbers = np.empty(4 * lookups, dtype=np.uint64)
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
    """Compile the kernels, or load them from the cache, so that the first fit starts without this delay.

    Returns the seconds for compiling; 0 if the kernels were in the cache.
    """
    began = time.perf_counter()
    nothing = torch.zeros(4, 4, dtype=torch.float64, device="cpu")
    lookup = Lookup(0, nothing[:2, :2], (2, 2), 0)
    x, f, w = nothing[:1, :2], nothing[:1, :1], nothing[0, :1]
    accumulate_compiled(x, (lookup,), f, w, 4)
    gradient(x, (lookup,), f, w, nothing[:, :1].contiguous())
    compiled = any(kernel.stats.cache_misses for kernel in (_accumulate, _gradient))
    return time.perf_counter() - began if compiled else 0.0
