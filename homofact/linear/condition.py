"""How trustworthy a positive definite system is: its condition number, and how many unknowns the data hold."""

import numpy as np
import scipy.linalg
from torch import Tensor


def condition_estimate(matrix: Tensor) -> float:
    """The 1-norm condition number of a symmetric positive definite matrix (K, K), as LAPACK's pocon estimates it.

    From its Cholesky factor, at the price of one; infinite where it is not positive definite to working precision.
    """
    array = np.asarray(matrix.cpu().numpy())
    factorize, estimate = scipy.linalg.get_lapack_funcs(("potrf", "pocon"), (array,))
    factor, info = factorize(array.T, lower=1, clean=0)
    if info != 0:
        return float("inf")
    reciprocal, _ = estimate(factor, np.abs(array).sum(0).max(), uplo="L")
    return 1 / float(reciprocal) if reciprocal > 0 else float("inf")


def condition_of_factor(lower: np.ndarray, norm: float) -> float:
    """As `condition_estimate`, from the matrix's 1-norm and its Cholesky factor in a row-major lower triangle."""
    (estimate,) = scipy.linalg.get_lapack_funcs(("pocon",), (lower,))
    reciprocal, _ = estimate(lower.T, norm, uplo="U")
    return 1 / float(reciprocal) if reciprocal > 0 else float("inf")


def determined_share(data: Tensor, weight: float) -> float:
    """Return share of unknowns that samples hold, and not smoothing alone.

    From the diagonal (K,) of BᵀWB: an unknown counts where it has at least what one sample of this weight gives each
    of the four texels round it when it falls in their middle, weight/16 twice over.
    """
    return float((data >= weight / 8).double().mean())
