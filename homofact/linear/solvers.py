"""Linear solvers of the inner problem with a common interface: they map a problem to a `Solution`.

* cholesky: dense factorization of the normal equations, all channels at once; where the matrix is not positive definite
  to working precision, it returns the minimum-norm solution of the eigen-decomposition and reports this. With more than
  `size.MOST_DENSE` unknowns, it factors only the diagonal blocks of the textures, as a preconditioner of conjugate
  gradients (`sparse_solve`).
* qr: orthogonal factorization of the weighted rows, in blocks. It does not square the condition number, unlike the
  normal equations.
* lsmr: Fong and Saunders' iteration on the rows, one channel at a time (scipy).
* cg, qmr: conjugate gradients and quasi-minimal residual on the normal equations BᵀB as sparse products
  (scipy), a channel at a time. QMR on BᵀB is what the thesis used (3.2.6, eq. 3.7).

The iterative solvers scale the columns to unit length and stop at 1e-14 of their residual. At 1e-10 they stopped with
an error of 1e-5 of the texels and reported convergence (`docs/stability.md`).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.linalg
import scipy.sparse.linalg
import torch
from torch import Tensor

from homofact.errors import BadInput, SolverFailure, Status
from homofact.linear.condition import condition_of_factor
from homofact.linear.definite import solve_lower
from homofact.linear.least_squares import LeastSquares, minimum_norm
from homofact.linear.names import SOLVER_NAMES
from homofact.linear.size import ROWS, is_dense
from homofact.linear.sparse_solve import conjugate

TOLERANCE = 1e-14
BLOCK = 4096


@dataclass(frozen=True)
class Solution:
    """The texels (T, C), 0 outside the mask, the status of the solver, and its iterations, summed over channels.

    `condition` is the 1-norm condition number of the system if its Cholesky factor was computed. For a system that is
    too large for a factor, it is a lower bound of the 2-norm condition number. `factor` is the Cholesky factor, if it
    was kept: U (K, K) with UᵀU the matrix; ignore the entries below its diagonal.
    """

    texels: Tensor
    status: Status
    iterations: int
    condition: float | None = None
    factor: np.ndarray | None = None


def cholesky(problem: LeastSquares) -> Solution:
    """Solve by dense Cholesky of the normal equations; if it fails, by minimum norm with status FALLBACK.

    Large problems are solved by conjugate gradients: status CONVERGED, or BUDGET.
    """
    if not is_dense(problem.unknowns):
        answer = conjugate(problem)
        texels = problem.expand(torch.from_numpy(answer.texels))
        return Solution(texels, answer.status, answer.steps, answer.condition)
    matrix, rhs = problem.normal()
    if matrix.device.type == "cpu":
        norm, factor = _norm(matrix), matrix.numpy()
        # In the matrix's own place: a copy of a large one would be half a gigabyte.
        solution = solve_lower(factor, rhs.numpy())
        if solution is not None:
            condition = condition_of_factor(factor, norm)
            return Solution(problem.expand(torch.from_numpy(solution)), Status.DIRECT, 0, condition, factor.T)
        matrix, rhs = problem.normal()
    solution, status = solve_definite(matrix, rhs)
    return Solution(problem.expand(solution), status, 0)


def _norm(matrix: Tensor) -> float:
    """The 1-norm of a matrix, some rows at a time."""
    columns = torch.zeros(matrix.shape[1], dtype=matrix.dtype)
    for rows in matrix.split(ROWS):
        columns += rows.abs().sum(0)
    return float(columns.max())


def solve_definite(matrix: Tensor, rhs: Tensor) -> tuple[Tensor, Status]:
    """Return (x, status) of a positive definite system; x is the minimum-norm solution if it is only semidefinite."""
    if matrix.device.type == "cpu":
        solution = solve_lower(matrix.numpy().copy(), rhs.numpy())
        if solution is not None:
            return torch.from_numpy(solution), Status.DIRECT
    else:
        factor, info = torch.linalg.cholesky_ex(matrix)
        if int(info) == 0:
            return torch.cholesky_solve(rhs, factor), Status.DIRECT
    return minimum_norm(matrix, rhs), Status.FALLBACK


def qr(problem: LeastSquares) -> Solution:
    """Solve by QR: compute R of all rows, block after block, then substitute back."""
    rows, targets = problem.rows()
    width = int(problem.kept.sum())
    top = np.zeros((0, width + targets.shape[1]))
    for begin in range(0, len(targets), BLOCK):
        piece = slice(begin, begin + BLOCK)
        block = np.hstack([np.asarray(rows[piece].todense()), targets[piece]])
        reduced = scipy.linalg.qr(np.vstack([top, block]), mode="r", check_finite=False)[0]
        top = np.asarray(reduced)[: width + targets.shape[1]]
    factor, right = top[:width, :width], top[:width, width:]
    diagonal = np.abs(np.diag(factor))
    if diagonal.min() <= diagonal.max() * width * np.finfo(float).eps:
        shortest = torch.linalg.lstsq(torch.from_numpy(factor), torch.from_numpy(right), driver="gelsd").solution
        return Solution(problem.expand(shortest), Status.FALLBACK, 0)
    solution = scipy.linalg.solve_triangular(factor, right)
    return Solution(problem.expand(torch.from_numpy(np.ascontiguousarray(solution))), Status.DIRECT, 0)


def lsmr(problem: LeastSquares) -> Solution:
    """Solve by LSMR on the rows, one channel at a time; BUDGET if a channel reaches the iteration limit."""
    rows, targets, scale = _equilibrated(problem)
    limit = 20 * int(problem.kept.sum())
    answers = [
        scipy.sparse.linalg.lsmr(rows, target, atol=TOLERANCE, btol=TOLERANCE, conlim=0, maxiter=limit)
        for target in targets.T
    ]
    stopped = any(answer[1] == 7 for answer in answers)
    solution = torch.from_numpy(np.stack([answer[0] for answer in answers], 1) / scale[:, None])
    status = Status.BUDGET if stopped else Status.CONVERGED
    return Solution(problem.expand(solution), status, sum(int(answer[2]) for answer in answers))


def _equilibrated(problem: LeastSquares) -> tuple[scipy.sparse.csr_matrix, np.ndarray, np.ndarray]:
    """(rows with columns of unit length, targets, the columns' lengths (K,)): texels read often and seldom alike.

    Without it an iteration stops when the often read texels are right, whatever the others are. No column is zero:
    the ridge is in every one.
    """
    rows, targets = problem.rows()
    lengths = np.sqrt(np.asarray(rows.multiply(rows).sum(0)).ravel())
    return scipy.sparse.csr_matrix(rows @ scipy.sparse.diags(1 / lengths)), targets, lengths


def cg(problem: LeastSquares) -> Solution:
    """Conjugate gradients on the normal equations, a channel at a time."""
    return _krylov(problem, scipy.sparse.linalg.cg)


def qmr(problem: LeastSquares) -> Solution:
    """Quasi-minimal residual on the normal equations, a channel at a time: the thesis's solver."""
    return _krylov(problem, scipy.sparse.linalg.qmr)


def _krylov(problem: LeastSquares, method: Callable) -> Solution:
    rows, targets, scale = _equilibrated(problem)
    matrix = (rows.T @ rows).tocsr()
    rhs = rows.T @ targets
    steps = 0

    def count(_: object) -> None:
        nonlocal steps
        steps += 1

    answers = [method(matrix, column, rtol=TOLERANCE, maxiter=10 * matrix.shape[0], callback=count) for column in rhs.T]
    solution = torch.from_numpy(np.stack([answer[0] for answer in answers], 1) / scale[:, None])
    status = Status.CONVERGED if all(answer[1] == 0 for answer in answers) else Status.BUDGET
    return Solution(problem.expand(solution), status, steps)


SOLVERS: dict[str, Callable[[LeastSquares], Solution]] = dict(
    zip(SOLVER_NAMES, (cholesky, qr, lsmr, cg, qmr), strict=True)
)


def solve(problem: LeastSquares, solver: str = "cholesky") -> Solution:
    """Solve by the solver of that name.

    Raises BadInput for an unknown name and SolverFailure where the texels are not finite.
    """
    if solver not in SOLVERS:
        raise BadInput(where="solver", found=repr(solver), expected=f"one of {', '.join(SOLVERS)}")
    solution = SOLVERS[solver](problem)
    if not bool(torch.isfinite(solution.texels).all()):
        raise SolverFailure(f"{solver}: the texels are not finite: more smoothing, fewer textures or more samples")
    return solution
