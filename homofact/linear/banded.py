"""Banded Cholesky factors of the diagonal block of each texture, as a preconditioner of a large system.

Texels are numbered row by row, and coupled texels are at most two rows apart. So bilinear lookups and smoothing give
each texture a band matrix whose bandwidth is twice its number of columns. The few entries outside the band (at a
periodic axis or a pole) are dropped, and their absolute values are added to the diagonal, which keeps the block
positive definite.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import scipy.linalg
import scipy.sparse

from homofact.errors import SolverFailure

# At most this share of a block's entries beside the diagonal lies outside of its band.
_OUTSIDE = 0.1
_SHIFTS = (0.0, 1e-12, 1e-9, 1e-6)


class BlockBanded:
    """The upper triangular R such that RᵀR are the diagonal blocks of a sparse symmetric matrix (K, K)."""

    def __init__(self, matrix: scipy.sparse.csr_matrix, edges: Sequence[int]) -> None:
        """`edges` are the block's first rows, and K. Raises SolverFailure where a block is not positive definite."""
        self._parts = [
            (slice(begin, end), _factor(matrix[begin:end, begin:end].tocoo(), end - begin))
            for begin, end in pairwise(edges)
            if end > begin
        ]
        (self._forward,) = scipy.linalg.get_lapack_funcs(("tbtrs",), (np.zeros(1),))

    def times(self, x: np.ndarray) -> np.ndarray:
        """Return R x."""
        result = np.empty_like(x)
        for own, band in self._parts:
            # LAPACK's rows of an upper band are the diagonals, each beginning at its own column.
            diagonals = scipy.sparse.dia_matrix((band, np.arange(len(band))[::-1]), shape=(band.shape[1],) * 2)
            result[own] = diagonals @ x[own]
        return result

    def back(self, z: np.ndarray) -> np.ndarray:
        """Return R⁻¹ z."""
        return self._turned(z, "N")

    def forth(self, x: np.ndarray) -> np.ndarray:
        """Return R⁻ᵀ x."""
        return self._turned(x, "T")

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """Return (RᵀR)⁻¹ rhs."""
        result = np.empty_like(rhs)
        for own, band in self._parts:
            result[own] = scipy.linalg.cho_solve_banded((band, False), rhs[own], check_finite=False)
        return result

    def _turned(self, x: np.ndarray, trans: str) -> np.ndarray:
        result = np.empty_like(x)
        for own, band in self._parts:
            result[own], _ = self._forward(band, x[own], uplo="U", trans=trans)
        return result


def _factor(block: scipy.sparse.coo_matrix, count: int) -> np.ndarray:
    """R of one block (K, K), K = `count`, as LAPACK stores an upper band: (width + 1, K)."""
    upper = block.row <= block.col
    row, column, value = block.row[upper], block.col[upper], block.data[upper]
    apart = column - row
    beside = np.sort(apart[apart > 0])
    width = int(beside[int((1 - _OUTSIDE) * (len(beside) - 1))]) if len(beside) else 0
    near = apart <= width
    band = np.zeros((width + 1, count))
    np.add.at(band, (width - apart[near], column[near]), value[near])
    for place in (row, column):
        np.add.at(band[-1], place[~near], np.abs(value[~near]))
    for shift in _SHIFTS:
        shifted = band.copy()
        shifted[-1] += shift * band[-1].max()
        try:
            return scipy.linalg.cholesky_banded(shifted, overwrite_ab=True, check_finite=False)
        except np.linalg.LinAlgError:
            continue
    raise SolverFailure("a texture's own equations are not positive definite: more smoothing or more samples")
