"""The inner problem in the form that solvers need: weighted samples, smoothing rows and ridge.

Minimise over texels y (T, C)

    Σn wn |fn − (By)n|² + λ' |Ly|² + δ |y|².

λ' = λ · (Σ w)/T, in samples per texel, so that one λ means the same at every size. δ is 1e-9 of the mean diagonal: it
selects the smallest texels where nothing else determines them, and is far too weak to change the fit. A fit whose
textures cancel each other has a stronger one (`relative_ridge`).

A constant can move from one texture to another without changing the sum, and so can a ramp if projections overlap;
Laplacian rows do not penalise either. If the rows Zᵀ of all such directions are given (orthonormal columns Z, `gauge`),
the term μ |Zᵀy|², with μ the mean diagonal, fixes them at zero. The other terms do not depend on these directions, so
their minimum stays the same, and the system is as well posed as without them.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse
import torch
from torch import Tensor

from homofact.linear.definite import penalised_lower, solve_lower
from homofact.linear.laplacian import laplacian
from homofact.linear.layout import TexelLayout
from homofact.linear.normal import Lookup, NormalEquations, accumulate, accumulate_lower, stencil_rows
from homofact.linear.size import ROWS, is_dense

RELATIVE_RIDGE = 1e-9


@dataclass(frozen=True)
class Roughness:
    """Sparse smoothing rows L (T, T) of all textures; LᵀL is computed once for all problems that share them."""

    rows: scipy.sparse.csr_matrix

    @classmethod
    def of(cls, layout: TexelLayout, masks: tuple[Tensor, ...]) -> "Roughness":
        """Return the Laplacian rows of all textures inside their masks (rows, columns)."""
        blocks = [laplacian(mask, axes) for mask, axes in zip(masks, layout.axes, strict=True)]
        return cls(scipy.sparse.csr_matrix(scipy.sparse.block_diag(blocks)))

    @cached_property
    def gram(self) -> scipy.sparse.csr_matrix:
        """LᵀL (T, T), sparse with about a dozen entries per row."""
        return scipy.sparse.csr_matrix(self.rows.T @ self.rows)

    @cached_property
    def places(self) -> tuple[Tensor, Tensor, Tensor]:
        """Row and column numbers (E,) and values (E,) of LᵀL's entries."""
        gram = self.gram.tocoo()
        row, column = (torch.from_numpy(numbers.astype(np.int64)) for numbers in (gram.row, gram.col))
        return row, column, torch.from_numpy(gram.data)


@dataclass(frozen=True)
class LeastSquares:
    """One inner problem: coordinates (N, D), lookups, targets (N, C), weights (N,), and its penalties.

    `kept` (T,) marks the unknowns to solve for; the others are left out and are 0 in the solution. `roughness` contains
    L, which is zero outside `kept`. `smoothing` is λ, a single number or one per unknown (T,), equal within a texture.
    `gauge` is Z (T, G) of the module docstring, zero outside `kept`; None means no gauge term. `sibling` is a problem
    with the same samples, whose normal equations are reused. `relative_ridge` is δ divided by the mean diagonal.
    """

    coordinates: Tensor
    lookups: tuple[Lookup, ...]
    targets: Tensor
    weights: Tensor
    kept: Tensor
    roughness: Roughness
    smoothing: float | Tensor
    gauge: Tensor | None = None
    sibling: "LeastSquares | None" = None
    relative_ridge: float = RELATIVE_RIDGE

    @property
    def unknowns(self) -> int:
        """T, masked texels included."""
        return int(self.kept.shape[0])

    @cached_property
    def data(self) -> NormalEquations:
        """Return BᵀWB, BᵀWf and the energy of the samples (no smoothing) for all unknowns, accumulated on first use."""
        if self.sibling is not None and self._has_samples_of(self.sibling):
            return self.sibling.data
        return accumulate(self.coordinates, self.lookups, self.targets, self.weights, self.unknowns)

    @property
    def diagonal(self) -> Tensor:
        """The diagonal (T,) of BᵀWB, also for problems that are too large for `data`."""
        if is_dense(self.unknowns):
            return self.data.matrix.diagonal()
        squares = design_of(*stencil_rows(self.coordinates, self.lookups), self.unknowns)
        squares.data **= 2
        return torch.from_numpy(squares.T @ _array(self.weights)).to(self.weights.device)

    @property
    def penalty_scale(self) -> Tensor:
        """λ' (T, 1), the weight of every smoothing row."""
        return _penalty_scale(self.smoothing, self.weights, float(self.weights.sum()), self.kept)

    @property
    def ridge(self) -> float:
        """δ, the weight of the texels themselves."""
        return _ridge(float(self.weights.sum()), len(self.lookups), int(self.kept.sum()), self.relative_ridge)

    @property
    def gauge_scale(self) -> float:
        """μ, the weight of the gauge rows."""
        return self.ridge / self.relative_ridge

    def within(self, kept: Tensor, roughness: Roughness, gauge: Tensor | None) -> "LeastSquares":
        """Return a problem with the same samples and other `kept` unknowns, which reuses the normal equations."""
        return replace(self, kept=kept, roughness=roughness, gauge=gauge, sibling=self)

    def _has_samples_of(self, other: "LeastSquares") -> bool:
        """Whether both were made from the same tensors, and have as many unknowns."""
        mine = (self.coordinates, self.lookups, self.targets, self.weights)
        theirs = (other.coordinates, other.lookups, other.targets, other.weights)
        return self.unknowns == other.unknowns and all(own is same for own, same in zip(mine, theirs, strict=True))

    def penalty(self, texels: Tensor) -> float:
        """λ'|Ly|² + δ|y|² of texels (T, C), summed over channels."""
        rough = torch.from_numpy(self.roughness.gram @ _array(texels)).to(texels)
        return float((texels * self.penalty_scale * rough).sum()) + self.ridge * float(texels.square().sum())

    def normal(self) -> tuple[Tensor, Tensor]:
        """Return the dense (BᵀWB + λ'LᵀL + δI + μZZᵀ, BᵀWf) of the kept unknowns, (K, K) and (K, C)."""
        kept = None if bool(self.kept.all()) else self.kept
        matrix = self.data.matrix.clone() if kept is None else _among(self.data.matrix, kept)
        _add_penalty(matrix, self.roughness, self.penalty_scale, self.ridge, kept)
        if self.gauge is not None:
            gauge = self.gauge if kept is None else self.gauge[kept]
            matrix.addmm_(gauge, gauge.T, alpha=self.gauge_scale)
        return matrix, self.data.rhs if kept is None else self.data.rhs[kept]

    def rows(self) -> tuple[scipy.sparse.csr_matrix, np.ndarray]:
        """The stacked sparse rows [√W B; √λ' L; √δ I; √μ Zᵀ] (·, K) and targets [√W f; 0; 0; 0] (·, C), on the CPU."""
        numbers, values = stencil_rows(self.coordinates, self.lookups)
        count = len(numbers)
        root = self.weights.sqrt()[:, None]
        design = design_of(numbers, values * root, self.unknowns)
        kept = np.flatnonzero(_array(self.kept))
        smooth = scipy.sparse.diags(_array(self.penalty_scale.sqrt()).ravel()) @ self.roughness.rows
        identity = scipy.sparse.identity(self.unknowns, format="csr") * np.sqrt(self.ridge)
        gauge = np.zeros((0, self.unknowns)) if self.gauge is None else _array(self.gauge).T * np.sqrt(self.gauge_scale)
        held = scipy.sparse.csr_matrix(gauge)
        stacked = scipy.sparse.csr_matrix(scipy.sparse.vstack([design, smooth, identity, held]))[:, kept]
        targets = np.zeros((stacked.shape[0], self.targets.shape[1]))
        targets[:count] = _array(self.targets * root)
        return scipy.sparse.csr_matrix(stacked), targets

    def expand(self, solution: Tensor) -> Tensor:
        """Return texels (T, C) with the kept unknowns, and zeros elsewhere, on the device of the samples."""
        result = torch.zeros(self.unknowns, solution.shape[1], dtype=torch.float64, device=self.kept.device)
        result[self.kept] = solution.to(result.device)
        return result

    def residuals(self, texels: Tensor) -> Tensor:
        """Return f − By (N, C), by a pass over the samples."""
        numbers, values = stencil_rows(self.coordinates, self.lookups)
        return self.targets - (texels[numbers] * values[..., None]).sum(1)

    def mean_error(self, texels: Tensor) -> float:
        """Weighted mean over samples and channels of (f − By)²."""
        squares = self.residuals(texels) ** 2
        return float((self.weights[:, None] * squares).sum() / self.weights.sum()) / squares.shape[1]


def solve_penalised(
    data: NormalEquations,
    roughness: Roughness,
    smoothing: float | Tensor,
    lookups: int,
    without: NormalEquations | None = None,
) -> Tensor:
    """Return texels (T, C) of accumulated samples, optionally `without` a part of them; all texels are unknowns.

    If the matrix is not positive definite to working precision, the result is the minimum-norm solution.
    """
    unknowns = data.matrix.shape[0]
    weight = data.weight - (0.0 if without is None else without.weight)
    scale = _penalty_scale(smoothing, data.matrix, weight, torch.ones_like(data.rhs[:, 0]))
    ridge = _ridge(weight, lookups, unknowns)
    rhs = data.rhs if without is None else data.rhs - without.rhs
    if data.matrix.device.type == "cpu":
        part = np.zeros((0, 0)) if without is None else without.matrix.numpy()
        gram = roughness.gram
        weights = scale.numpy().ravel()
        sparse = (gram.indptr, gram.indices, gram.data)
        lower = penalised_lower(data.matrix.numpy(), part, -1.0, *sparse, weights, ridge)
        solution = solve_lower(lower, rhs.numpy())
        if solution is not None:
            return torch.from_numpy(solution)
    matrix = data.matrix.clone() if without is None else data.matrix - without.matrix
    _add_penalty(matrix, roughness, scale, ridge)
    factor, info = torch.linalg.cholesky_ex(matrix)
    return minimum_norm(matrix, rhs) if int(info) else torch.cholesky_solve(rhs, factor)


def minimum(problem: LeastSquares) -> tuple[Tensor, float]:
    """Return (texels (T, C), the penalised sum of squares at the minimum) of a problem, without other results.

    All texels are unknowns and there is no gauge. On the CPU, only the lower triangle of the matrix is computed. The
    value is Σ w f² − yᵀBᵀWf.
    """
    if problem.weights.device.type == "cpu":
        whole, part, rhs, energy = accumulate_lower(
            problem.coordinates, problem.lookups, problem.targets, problem.weights, problem.unknowns
        )
        gram, scale = problem.roughness.gram, problem.penalty_scale.numpy().ravel()
        lower = penalised_lower(whole, part, 1.0, gram.indptr, gram.indices, gram.data, scale, problem.ridge)
        solution = solve_lower(lower, rhs)
        if solution is not None:
            return torch.from_numpy(solution), max(float(energy.sum() - (solution * rhs).sum()), 0.0)
    data = problem.data
    texels = solve_penalised(data, problem.roughness, problem.smoothing, len(problem.lookups))
    return texels, max(float(data.energy.sum() - (texels * data.rhs).sum()), 0.0)


def _among(matrix: Tensor, kept: Tensor) -> Tensor:
    """A copy of the rows and columns of `matrix` (T, T) that are `kept` (T,), without another one beside it."""
    places = kept.nonzero()[:, 0]
    found = matrix.new_empty(len(places), len(places))
    for begin in range(0, len(places), ROWS):
        piece = slice(begin, begin + ROWS)
        found[piece] = matrix[places[piece]][:, places]
    return found


def _add_penalty(matrix: Tensor, roughness: Roughness, scale: Tensor, ridge: float, kept: Tensor | None = None) -> None:
    """Add λ'LᵀL + δI in place, with λ' (T, 1), to `matrix` (T, T), or (K, K) of the unknowns `kept` (T,)."""
    # L is block diagonal and λ' constant within a block, so diag(λ') LᵀL is symmetric.
    row, column, values = (entries.to(matrix.device) for entries in roughness.places)
    added = scale[row, 0] * values
    if kept is not None:
        both, number = kept[row] & kept[column], kept.cumsum(0) - 1
        row, column, added = number[row[both]], number[column[both]], added[both]
    matrix[row, column] += added
    matrix.diagonal().add_(ridge)


def minimum_norm(matrix: Tensor, rhs: Tensor) -> Tensor:
    """Return the shortest x (T, C) of a symmetric system that is only semidefinite to working precision."""
    values, vectors = torch.linalg.eigh(matrix)
    # Directions under the rounding of the largest eigenvalue carry no information.
    sound = values > values[-1] * matrix.shape[0] * torch.finfo(matrix.dtype).eps
    inverse = torch.where(sound, 1 / values.clamp_min(torch.finfo(values.dtype).tiny), torch.zeros_like(values))
    return vectors @ (inverse[:, None] * (vectors.T @ rhs))


def design_of(numbers: Tensor, values: Tensor, unknowns: int) -> scipy.sparse.csr_matrix:
    """Return the sparse rows (N, T) of stencils (N, k), on the CPU; repeated texels of a row are summed."""
    count, width = numbers.shape
    entries = (_array(values).ravel(), _array(numbers).ravel(), np.arange(count + 1) * width)
    made = scipy.sparse.csr_matrix(entries, shape=(count, unknowns))
    made.sum_duplicates()
    return made


def _array(tensor: Tensor) -> np.ndarray:
    return tensor.cpu().numpy()


def _penalty_scale(smoothing: float | Tensor, like: Tensor, weight: float, kept: Tensor) -> Tensor:
    """λ' (T, 1) = λ · Σw/K, K of the T unknowns being kept; float64 on the device of `like`."""
    value = smoothing.to(like) if isinstance(smoothing, Tensor) else like.new_full((), smoothing)
    return value.expand(len(kept))[:, None] * (weight / float(kept.sum()))


def _ridge(weight: float, lookups: int, unknowns: int, relative: float = RELATIVE_RIDGE) -> float:
    """δ from Σw · lookups/T: about the mean diagonal of BᵀWB, and needs no accumulation."""
    return relative * weight * lookups / unknowns
