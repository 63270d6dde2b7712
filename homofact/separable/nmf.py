"""Non-negative matrix factorization by weighted multiplicative updates (Lee and Seung 2001).

Minimises Σ wij (mij − (W H)ij)² over W, H ≥ 0. Each update multiplies a factor by the ratio of the negative to the
positive part of the gradient, so nothing becomes negative and the objective never rises. Lawrence, Rusinkiewicz and
Ramamoorthi 2004 factor a BRDF like this, with half-angle coordinates on one side. The start is the non-negative part of
the SVD (Boutsidis and Gallopoulos 2008, NNDSVD). Its zeros are replaced by positive numbers, since the updates never
change a zero. So the result is deterministic.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from homofact.errors import BadInput


@dataclass(frozen=True)
class NonNegative:
    """M ≈ left rightᵀ with left (n, K) and right (m, K) ≥ 0; both factors of a term have the same norm.

    `objectives` are Σ w (M − left rightᵀ)² at the start and after every update of both; `converged` is True if the last
    values changed by less than the tolerance.
    """

    left: Tensor
    right: Tensor
    objectives: tuple[float, ...]
    converged: bool

    def product(self) -> Tensor:
        """Return the approximation (n, m)."""
        return self.left @ self.right.T


def nmf(
    matrix: Tensor, terms: int, weights: Tensor | None = None, most: int = 600, tolerance: float = 1e-5
) -> NonNegative:
    """Factor a matrix (n, m) ≥ 0 with weights (n, m) ≥ 0 (None: all 1) into K = `terms` products.

    The iteration ends after `most` rounds, or when ten rounds lower the objective by less than `tolerance` times its
    initial value. Raises BadInput for negative or non-finite entries, for weights of another shape, and for fewer than
    one term.
    """
    for name, found in (("matrix", matrix), ("weights", weights)):
        if found is not None and not bool((torch.isfinite(found) & (found >= 0)).all()):
            raise BadInput(where=name, found="a negative entry or one that is not finite", expected="numbers >= 0")
    if weights is not None and weights.shape != matrix.shape:
        raise BadInput(where="weights", found=f"shape {tuple(weights.shape)}", expected=tuple(matrix.shape))
    if terms < 1:
        raise BadInput(where="terms", found=terms, expected="at least 1")
    left, right = _start(matrix, min(terms, *matrix.shape))
    weighted = matrix if weights is None else weights * matrix
    constant = float((weighted * matrix).sum())
    tiny = torch.finfo(matrix.dtype).tiny

    def predicted(of: Tensor, by: Tensor, transposed: bool) -> Tensor:
        """The positive part of a gradient: (w ∘ left rightᵀ) right, or its counterpart."""
        if weights is None:
            return of @ (by.T @ by)
        return (weights.T * (of @ by.T)) @ by if transposed else (weights * (of @ by.T)) @ by

    def objective(numerator: Tensor, denominator: Tensor) -> float:
        # ‖M‖² − 2⟨M, P⟩ + ‖P‖², from the products that the update of `right` needs anyway.
        return constant - 2 * float((numerator * right).sum()) + float((denominator * right).sum())

    objectives: list[float] = []
    converged = False
    for step in range(most + 1):
        above = weighted.T @ left
        below = predicted(right, left, True)
        objectives.append(max(objective(above, below), 0.0))
        if step >= 10 and objectives[-11] - objectives[-1] <= tolerance * objectives[0]:
            converged = True
            break
        if step == most:
            break
        right = right * above / below.clamp_min(tiny)
        above = weighted @ right
        left = left * above / predicted(left, right, False).clamp_min(tiny)
    norms = left.norm(dim=0).clamp_min(tiny), right.norm(dim=0).clamp_min(tiny)
    share = (norms[0] / norms[1]).sqrt()
    return NonNegative(left / share, right * share, tuple(objectives), converged)


def _start(matrix: Tensor, terms: int) -> tuple[Tensor, Tensor]:
    u, s, vh = torch.linalg.svd(matrix, full_matrices=False) if max(matrix.shape) <= 600 else _leading(matrix, terms)
    left, right = [u[:, 0].abs() * s[0].sqrt()], [vh[0].abs() * s[0].sqrt()]
    for k in range(1, terms):
        a, b = u[:, k], vh[k]
        sides = [((sign * a).clamp_min(0), (sign * b).clamp_min(0)) for sign in (1, -1)]
        x, y = max(sides, key=lambda pair: float(pair[0].norm() * pair[1].norm()))
        scale = (s[k] * x.norm() * y.norm()).sqrt()
        left.append(scale * x / x.norm().clamp_min(1e-300))
        right.append(scale * y / y.norm().clamp_min(1e-300))
    floor = (matrix.mean() / terms).sqrt() * 0.1
    return torch.stack(left, 1).clamp_min(floor), torch.stack(right, 1).clamp_min(floor)


def _leading(matrix: Tensor, terms: int) -> tuple[Tensor, Tensor, Tensor]:
    """The leading singular triples by subspace iteration: a start need not be exact."""
    start = torch.rand(matrix.shape[1], terms + 8, dtype=matrix.dtype, generator=torch.Generator().manual_seed(0))
    basis = start.to(matrix)
    for _ in range(8):
        basis = torch.linalg.qr(matrix.T @ torch.linalg.qr(matrix @ basis).Q).Q
    u, s, vh = torch.linalg.svd(matrix @ basis, full_matrices=False)
    return u, s, vh @ basis.T
