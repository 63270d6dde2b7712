"""Systems too large for a dense matrix: conjugate gradients with a preconditioner of two levels.

The normal matrix A = BᵀWB + λ'LᵀL + δI + μZZᵀ is never formed. Products with it are cheap, since B has four entries per
lookup. Two effects make A ill-conditioned, and the preconditioner has a part for each:

    M⁻¹ = D⁻¹ + R (RᵀAR)⁻¹ Rᵀ.

D has the diagonal blocks of the textures (`linear.banded`). It handles smoothing, and texels with uneven numbers of
samples. R handles functions that can move between textures. If projections share a direction, any function of this
coordinate can move from one texture to the other, and only interpolation and smoothing oppose that. These functions are
smooth, so coarse textures with a few thousand texels in total represent them: R interpolates coarse texels bilinearly,
and RᵀAR is dense. Without R, the error of the texels of three 48² textures was still above 70% after 1500 steps. With
R, 150 steps reach an error of 1e-5.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.linalg
import scipy.sparse
import torch

from homofact.errors import Status
from homofact.linear.banded import BlockBanded
from homofact.linear.bilinear import stencil
from homofact.linear.layout import Axes, Shape, texel_centres
from homofact.linear.least_squares import LeastSquares, design_of
from homofact.linear.normal import stencil_rows

COARSE = 3072  # texels of all coarse textures
TOLERANCE = 1e-6  # of the residual in the preconditioner's norm
GAIN, WINDOW = 1e-6, 20  # or a smaller share of the penalised sum of squares that so many steps take away
MOST_STEPS = 600
_POWER_STEPS = 20
# A coarse texel counts where fine ones read it with more than this in all.
_READ = 1e-3


@dataclass(frozen=True)
class Sparse:
    """The system of a `LeastSquares` restricted to its kept unknowns (K), as sparse matrices on the CPU.

    `design` (N, K) contains the rows of B without weights.
    """

    problem: LeastSquares
    design: scipy.sparse.csr_matrix
    penalty: scipy.sparse.csr_matrix
    gauge: np.ndarray

    @classmethod
    def of(cls, problem: LeastSquares) -> "Sparse":
        """Return the matrices of a problem, made in one pass over its samples."""
        kept = problem.kept.cpu().numpy()
        design = design_of(*stencil_rows(problem.coordinates, problem.lookups), problem.unknowns)[:, kept]
        scale = scipy.sparse.diags(problem.penalty_scale.cpu().numpy().ravel())
        penalty = (scale @ problem.roughness.gram)[kept][:, kept]
        penalty += problem.ridge * scipy.sparse.identity(int(kept.sum()))
        gauge = np.zeros((len(kept), 0)) if problem.gauge is None else problem.gauge.cpu().numpy()
        return cls(problem, scipy.sparse.csr_matrix(design), scipy.sparse.csr_matrix(penalty), gauge[kept])

    @cached_property
    def weighted(self) -> scipy.sparse.csr_matrix:
        """BᵀW (K, N)."""
        return scipy.sparse.csr_matrix(self.design.T @ scipy.sparse.diags(self.problem.weights.cpu().numpy()))

    @property
    def rhs(self) -> np.ndarray:
        """BᵀWf (K, C)."""
        return self.weighted @ self.problem.targets.cpu().numpy()

    @property
    def energy(self) -> np.ndarray:
        """Σ w f² (C,), the sum of squares without any texture."""
        weights = self.problem.weights.cpu().numpy()
        return weights @ self.problem.targets.cpu().numpy() ** 2

    def times(self, texels: np.ndarray) -> np.ndarray:
        """Return the product A y for texels y (K, C)."""
        held = self.problem.gauge_scale * (self.gauge @ (self.gauge.T @ texels))
        return self.weighted @ (self.design @ texels) + self.penalty @ texels + held


def own_blocks(problem: LeastSquares, weights: np.ndarray, penalty: scipy.sparse.csr_matrix) -> BlockBanded:
    """Return the factors of the diagonal block of each texture, in which each lookup is treated separately.

    `weights` (N,) replace those of the problem, and `penalty` (K, K) is added.
    """
    kept = problem.kept.cpu().numpy()
    numbers, values = stencil_rows(problem.coordinates, problem.lookups)
    total = penalty
    for number in range(len(problem.lookups)):
        own = slice(4 * number, 4 * number + 4)
        rows = design_of(numbers[:, own], values[:, own], problem.unknowns)[:, kept]
        total = total + rows.T @ (scipy.sparse.diags(weights) @ rows)
    before = np.concatenate(([0], np.cumsum(kept)))
    edges = [int(before[offset]) for offset, _, _ in textures_of(problem)]
    return BlockBanded(scipy.sparse.csr_matrix(total), [*edges, int(before[-1])])


@dataclass(frozen=True)
class Answer:
    """The texels (K, C), the status, the number of steps, and a lower bound of the condition number."""

    texels: np.ndarray
    status: Status
    steps: int
    condition: float


def conjugate(problem: LeastSquares) -> Answer:
    """Solve a large problem; the status is CONVERGED (`TOLERANCE` or `GAIN`) or BUDGET (after `MOST_STEPS`).

    A random right-hand side g is solved together with the channels. v = A⁻¹g consists mostly of eigenvectors of the
    smallest eigenvalues, so vᵀAv/vᵀv is an upper bound of the smallest eigenvalue. The power method gives a lower bound
    of the largest eigenvalue.
    """
    system = Sparse.of(problem)
    blocks = own_blocks(problem, problem.weights.cpu().numpy(), system.penalty)
    coarse = _Coarse(system)

    def preconditioned(residual: np.ndarray) -> np.ndarray:
        return blocks.solve(residual) + coarse.solve(residual)

    drawn = np.random.default_rng(0).standard_normal((len(system.gauge), 1))
    rhs = np.hstack((system.rhs, drawn))
    answer, steps, done = _steps(system, preconditioned, rhs, system.energy)
    texels, probe = answer[:, :-1], answer[:, -1:]
    least = float((probe * system.times(probe)).sum() / np.square(probe).sum())
    for _ in range(_POWER_STEPS):
        drawn = system.times(drawn / np.linalg.norm(drawn))
    status = Status.CONVERGED if done else Status.BUDGET
    return Answer(np.ascontiguousarray(texels), status, steps, float(np.linalg.norm(drawn)) / max(least, 1e-300))


def condition_from_below(problem: LeastSquares) -> float:
    """Estimate the condition number, as `conjugate` does, of a problem that another solver has solved."""
    return conjugate(replace(problem, targets=problem.targets[:, :1])).condition


def _steps(
    system: Sparse, preconditioned: Callable[[np.ndarray], np.ndarray], rhs: np.ndarray, energy: np.ndarray
) -> tuple[np.ndarray, int, bool]:
    """(x, steps, whether all columns but the last are done): the columns side by side.

    A step takes length · size away from a column's sum of squares, which begins at `energy`.
    """
    x, residual = np.zeros_like(rhs), rhs.copy()
    values = [energy]
    turned = preconditioned(residual)
    direction = turned.copy()
    size = first = (residual * turned).sum(0)
    for step in range(MOST_STEPS):
        wanted = size > TOLERANCE**2 * first
        settled = step >= WINDOW and values[-WINDOW - 1] - values[-1] < GAIN * values[-1]
        if not np.any(wanted[:-1] & np.logical_not(settled)):
            return x, step, True
        product = system.times(direction)
        along = (direction * product).sum(0)
        # A column that is done stands still.
        length = np.where(wanted & (along > 0), size / np.where(along > 0, along, 1), 0)
        values.append(values[-1] - (length * size)[:-1])
        x += length * direction
        residual -= length * product
        turned = preconditioned(residual)
        size, before = (residual * turned).sum(0), size
        direction = turned + np.where(before > 0, size / np.where(before > 0, before, 1), 0) * direction
    return x, MOST_STEPS, False


class _Coarse:
    """The system on coarse textures: R and the Cholesky factor of RᵀAR."""

    def __init__(self, system: Sparse) -> None:
        kept = system.problem.kept.cpu().numpy()
        share = min(1.0, np.sqrt(COARSE / len(kept)))
        parts = [_interpolation(shape, axes, share) for _, shape, axes in textures_of(system.problem)]
        finer = scipy.sparse.csr_matrix(scipy.sparse.block_diag(parts))[kept]
        finer = finer[:, np.asarray(finer.sum(0)).ravel() > _READ]
        self._finer, self._coarser = scipy.sparse.csr_matrix(finer), scipy.sparse.csr_matrix(finer.T)
        across = system.design @ self._finer
        coarse = scipy.sparse.csr_matrix(self._coarser @ system.weighted @ across).toarray()
        coarse += scipy.sparse.csr_matrix(self._coarser @ system.penalty @ self._finer).toarray()
        held = self._coarser @ system.gauge
        coarse += system.problem.gauge_scale * (held @ held.T)
        # To working precision the coarse textures have the null space that the gauge and the ridge hold.
        coarse[np.diag_indices_from(coarse)] *= 1 + 1e-12
        self._factor = scipy.linalg.cho_factor(coarse, lower=True, overwrite_a=True, check_finite=False)

    def solve(self, residual: np.ndarray) -> np.ndarray:
        """Return R (RᵀAR)⁻¹ Rᵀ residual."""
        return self._finer @ scipy.linalg.cho_solve(self._factor, self._coarser @ residual, check_finite=False)


def textures_of(problem: LeastSquares) -> list[tuple[int, Shape, Axes]]:
    """Return (first unknown, shape, axes) of every texture, in order; several lookups may share one."""
    textures = {lookup.offset: (lookup.shape, lookup.axes) for lookup in problem.lookups}
    return [(offset, *textures[offset]) for offset in sorted(textures)]


def _interpolation(shape: Shape, axes: Axes, share: float) -> scipy.sparse.csr_matrix:
    """(fine texels, coarse texels): bilinear values of a texture with a `share` of the texels along each axis."""
    coarse = tuple(count if count == 1 else min(count, max(2, round(count * share))) for count in shape)
    places = [texel_centres(count, axis) for count, axis in zip(shape, axes, strict=True)]
    numbers, values = stencil(torch.cartesian_prod(*places).flip(-1), (coarse[0], coarse[1]), axes=axes)
    return design_of(numbers, values, coarse[0] * coarse[1])
