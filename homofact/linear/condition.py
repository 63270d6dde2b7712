"""Diagnose a positive definite system: its condition number, and the share of unknowns that the data determine."""

import numpy as np
import scipy.linalg
from torch import Tensor


def condition_estimate(matrix: Tensor) -> float:
    """Estimate the 1-norm condition number of a symmetric positive definite matrix (K, K) with LAPACK's pocon.

    This costs one Cholesky factorization. The result is infinite if the matrix is not positive definite to working
    precision.
    """
    array = np.asarray(matrix.cpu().numpy())
    factorize, estimate = scipy.linalg.get_lapack_funcs(("potrf", "pocon"), (array,))
    factor, info = factorize(array.T, lower=1, clean=0)
    if info != 0:
        return float("inf")
    reciprocal, _ = estimate(factor, np.abs(array).sum(0).max(), uplo="L")
    return 1 / float(reciprocal) if reciprocal > 0 else float("inf")


def condition_of_factor(lower: np.ndarray, norm: float) -> float:
    """Estimate the condition number from a matrix's 1-norm and its Cholesky factor, in a row-major lower triangle."""
    (estimate,) = scipy.linalg.get_lapack_funcs(("pocon",), (lower,))
    reciprocal, _ = estimate(lower.T, norm, uplo="U")
    return 1 / float(reciprocal) if reciprocal > 0 else float("inf")


def determined_share(data: Tensor, weight: float) -> float:
    """Return the share of unknowns that samples determine, not smoothing alone.

    `data` is the diagonal (K,) of BᵀWB, and `weight` is the mean weight of a sample. A sample in the middle of four
    texels adds weight/16 to the diagonal entry of each. An unknown counts if its entry is at least twice that,
    weight/8.
    """
    return float((data >= weight / 8).double().mean())
