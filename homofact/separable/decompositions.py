"""Decompositions of a BRDF matrix M (rows: texels of one direction, columns: of the other) into K products.

* `svd`: the best rank-K approximation in the Frobenius norm (Eckart and Young), for any M.
* `eigen`: for a symmetric M (a reciprocal BRDF with equal maps of ωi and ωo), Σ sk uk ukᵀ with the K eigenvalues of
  largest absolute value; sk = −1 for a negative eigenvalue (Wang, Tran and Luebke 2004, 3.2). It is as accurate as the
  SVD, with one texture per term instead of two.
* `power`: the same decomposition by power iteration with deflation (ibid., appendix).
* `normalized`: one term, for any M ≥ 0. It is the product of each row's norm and the mean of the normalised rows (Kautz
  and McCool 1999). homofact uses the 1-norm, so the sum of every row of M is preserved.

As in the papers, both factors of a term are scaled by the square root of its singular value.
"""

from dataclasses import dataclass

import torch
from scipy.sparse.linalg import eigsh
from torch import Tensor

from homofact.errors import BadInput

# Dense up to this many rows, Lanczos above: the same eigenvectors, in seconds instead of minutes.
DENSE_ROWS = 1200
# Products of a power iteration between two recombinations.
POWERS = 4


@dataclass(frozen=True)
class Factors:
    """M ≈ left diag(signs) rightᵀ.

    `left` is (n, K). `right` is (m, K), or None if it equals `left`. `signs` (K,) are ±1. `converged` is True if an
    iterative method met its tolerance, and `iterations` is its number of iterations.
    """

    left: Tensor
    right: Tensor | None
    signs: Tensor
    converged: bool = True
    iterations: int = 0

    def product(self) -> Tensor:
        """Return the approximation (n, m)."""
        return (self.left * self.signs) @ (self.left if self.right is None else self.right).T


def svd(matrix: Tensor, terms: int) -> Factors:
    """Return the K = `terms` leading singular triples of (n, m); fewer where the matrix has fewer."""
    u, s, vh = torch.linalg.svd(_finite(matrix), full_matrices=False)
    terms = min(terms, len(s))
    root = s[:terms].sqrt()
    return Factors(u[:, :terms] * root, vh[:terms].T * root, matrix.new_ones(terms))


def eigen(matrix: Tensor, terms: int) -> Factors:
    """Return the `terms` eigenvectors of largest |eigenvalue| of a symmetric (n, n).

    Raises BadInput if the matrix is not symmetric.
    """
    _check_symmetric(matrix)
    n = matrix.shape[0]
    terms = min(terms, n)
    if n <= DENSE_ROWS or terms >= n - 1:
        values, vectors = torch.linalg.eigh(matrix)
    else:
        # A start that is never orthogonal to a pattern of the texels by chance, and the same in every run.
        start = torch.rand(n, dtype=matrix.dtype, generator=torch.Generator().manual_seed(0)).numpy()
        found, basis = eigsh(matrix.cpu().numpy(), k=terms, which="LM", v0=start)
        values, vectors = torch.from_numpy(found).to(matrix), torch.from_numpy(basis).to(matrix)
    order = values.abs().argsort(descending=True, stable=True)[:terms]
    values, vectors = values[order], vectors[:, order]
    return Factors(vectors * values.abs().sqrt(), None, torch.where(values < 0, -1.0, 1.0).to(matrix.dtype))


def power(
    matrix: Tensor, terms: int, generator: torch.Generator, tolerance: float = 1e-9, most: int = 20_000
) -> Factors:
    """As `eigen`, by power iteration with deflation.

    The iteration for a vector v ends if ‖Mv − λv‖ ≤ `tolerance` |λ1|, with λ = vᵀMv and λ1 the first eigenvalue, or
    after `most` products, in which case `converged` is False. (The paper stops when λ no longer changes. With two
    eigenvalues of nearly the same size, this happens long before v converges.) After every four products, the next v is
    the best combination of v and its last images (Rayleigh-Ritz); the paper uses the last image. BRDF matrices have
    eigenvalues of equal size and opposite sign, between whose vectors the plain iteration oscillates forever. A
    remainder at the level of rounding is not decomposed further.
    """
    _check_symmetric(matrix)
    rest = matrix.clone()
    n = matrix.shape[0]
    floor = 1e-14 * float(matrix.norm())
    vectors, values = [], []
    converged, total, largest = True, 0, 0.0
    for _ in range(min(terms, n)):
        if vectors and float(rest.norm()) <= floor:
            break
        v = torch.randn(n, dtype=matrix.dtype, generator=generator).to(matrix)
        v = v / v.norm()
        products = 0
        while True:
            v, value, residual = _recombined(rest, v)
            products += POWERS
            largest = max(largest, abs(value))
            if residual <= max(tolerance * largest, floor):
                break
            if products + POWERS > most:
                converged = False
                break
        total += products
        vectors.append(v)
        values.append(value)
        rest -= value * torch.outer(v, v)
    found = matrix.new_tensor(values)
    # Two of nearly one size may be found in the other order.
    order = found.abs().argsort(descending=True, stable=True)
    signs = torch.where(found < 0, -1.0, 1.0).to(matrix.dtype)
    return Factors((torch.stack(vectors, 1) * found.abs().sqrt())[:, order], None, signs[order], converged, total)


def _recombined(matrix: Tensor, v: Tensor) -> tuple[Tensor, float, float]:
    """(v, λ, ‖Mv − λv‖): the largest Ritz pair of v and its images under 1 … `POWERS` − 1 products."""
    basis = v[:, None]
    images = (matrix @ v)[:, None]
    for _ in range(POWERS - 1):
        new = images[:, -1]
        # Twice, so that it is orthogonal to the last digits.
        for _ in range(2):
            new = new - basis @ (basis.T @ new)
        if float(new.norm()) <= 1e-13 * float(images[:, -1].norm()):
            break
        new = new / new.norm()
        basis = torch.cat((basis, new[:, None]), 1)
        images = torch.cat((images, (matrix @ new)[:, None]), 1)
    small = basis.T @ images
    values, turns = torch.linalg.eigh((small + small.T) / 2)
    # Of several of one size, the one that v is nearest to: else the choice changes sides with every rounding.
    sizes = values.abs()
    best = int(torch.where(sizes >= (1 - 1e-9) * sizes.max(), turns[0].abs(), -1.0).argmax())
    v, image, value = basis @ turns[:, best], images @ turns[:, best], float(values[best])
    residual = float((image - value * v).norm())
    return v / v.norm(), value, residual


def imputed(matrix: Tensor, valid: Tensor, terms: int, rounds: int = 60) -> Tensor:
    """Return (n, m) with invalid entries replaced by a rank-`terms` approximation of the valid ones.

    The given values of the invalid entries are the start. Each round fits the factors to the current matrix and sets
    the invalid entries to their product, clipped to the range of the valid entries. So the approximation spends no
    terms on entries without data.
    """
    if bool(valid.all()) or not bool(valid.any()):
        return matrix
    low, high = float(matrix[valid].min()), float(matrix[valid].max())
    filled = matrix
    start = torch.rand(matrix.shape[1], min(terms, *matrix.shape), generator=torch.Generator().manual_seed(0))
    right = filled.T @ (filled @ start.to(matrix))
    for _ in range(rounds):
        left = torch.linalg.qr(filled @ right).Q
        right = filled.T @ left
        filled = torch.where(valid, matrix, (left @ right.T).clamp(low, high))
    return filled


def normalized(matrix: Tensor) -> Factors:
    """Return the one non-negative term of the normalized decomposition. Raises BadInput for a negative entry."""
    if bool((_finite(matrix) < 0).any()):
        raise BadInput(where="matrix", found=f"{float(matrix.min()):.4g}", expected="no negative entry to normalize")
    norms = matrix.sum(1, keepdim=True)
    lit = norms[:, 0] > 0
    if not bool(lit.any()):
        return Factors(norms, matrix.new_zeros(matrix.shape[1], 1), matrix.new_ones(1))
    mean = (matrix[lit] / norms[lit]).mean(0)[:, None]
    # Both factors alike in size, as the others'.
    share = (norms.norm() / mean.norm()).sqrt()
    return Factors(norms / share, mean * share, matrix.new_ones(1))


def _finite(matrix: Tensor) -> Tensor:
    if matrix.ndim != 2 or 0 in matrix.shape or not bool(torch.isfinite(matrix).all()):
        raise BadInput(
            where="matrix", found=f"shape {tuple(matrix.shape)} or entries that are not finite", expected="a matrix"
        )
    return matrix


def _check_symmetric(matrix: Tensor) -> None:
    _finite(matrix)
    if matrix.shape[0] != matrix.shape[1] or float((matrix - matrix.T).abs().max()) > 1e-12 * float(matrix.abs().max()):
        raise BadInput(
            where="matrix", found=f"{tuple(matrix.shape)}, not symmetric", expected="M = Mᵀ, or the dense SVD"
        )
