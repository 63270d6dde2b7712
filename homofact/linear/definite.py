"""Solve positive definite systems on the CPU, with LAPACK calls that can run in parallel threads.

A search solves thousands of systems of a few hundred unknowns, several of them at a time (`linear.threads`). scipy's
own wrappers hold the interpreter's lock while LAPACK works, so the same routines are called through their C pointers.
Matrices are built in one compiled pass as row-major lower triangles. For LAPACK, which is column-major, these are upper
triangles.
"""

import ctypes

import numpy as np
import scipy.linalg.cython_lapack  # noqa: F401 (registers the pointers that are looked up below)
from numba.extending import get_cython_function_address

from homofact.linear.kernels import kernel

_INT = ctypes.POINTER(ctypes.c_int)
_POTRF = ctypes.CFUNCTYPE(None, ctypes.c_char_p, _INT, ctypes.c_void_p, _INT, _INT)(
    get_cython_function_address("scipy.linalg.cython_lapack", "dpotrf")
)
_POTRS = ctypes.CFUNCTYPE(None, ctypes.c_char_p, _INT, _INT, ctypes.c_void_p, _INT, ctypes.c_void_p, _INT, _INT)(
    get_cython_function_address("scipy.linalg.cython_lapack", "dpotrs")
)


def solve_lower(matrix: np.ndarray, rhs: np.ndarray) -> np.ndarray | None:
    """Solve the system with lower triangle `matrix` (T, T) for x (T, C); return None if it is not definite.

    `matrix` and `rhs` must be C-contiguous float64. `matrix` is overwritten.
    """
    size, count, info = ctypes.c_int(matrix.shape[0]), ctypes.c_int(rhs.shape[1]), ctypes.c_int()
    _POTRF(b"U", size, matrix.ctypes.data, size, info)
    if info.value != 0:
        return None
    solution = np.asfortranarray(rhs, dtype=np.float64).copy(order="F")
    _POTRS(b"U", size, count, matrix.ctypes.data, size, solution.ctypes.data, size, info)
    return np.ascontiguousarray(solution)


@kernel(nogil=True)
def penalised_lower(whole, part, sign, first, columns, values, scale, ridge):  # pragma: no cover (compiled)
    """Return `whole` + `sign` `part` + diag(`scale`) G + `ridge` · I (T, T), with only the lower triangle set.

    G is sparse and symmetric, in CSR format with the arrays `first`, `columns` and `values`. `part` may be empty (0,
    0). Only the lower triangles of `whole` and `part` are used.
    """
    size = whole.shape[0]
    result = np.empty((size, size))
    for row in range(size):
        if part.shape[0] == 0:
            for column in range(row + 1):
                result[row, column] = whole[row, column]
        else:
            for column in range(row + 1):
                result[row, column] = whole[row, column] + sign * part[row, column]
        for entry in range(first[row], first[row + 1]):
            column = columns[entry]
            if column <= row:
                result[row, column] += scale[row] * values[entry]
        result[row, row] += ridge
    return result


@kernel(nogil=True)
def make_symmetric(matrix, part):  # pragma: no cover (compiled)
    """Add the lower triangle of `part` to that of `matrix` (T, T) and mirror the result, in place.

    `part` may be empty (0, 0).
    """
    size = matrix.shape[0]
    if part.shape[0] > 0:
        for row in range(size):
            for column in range(row + 1):
                matrix[row, column] += part[row, column]
    # Eight lines at a time: more of them, a power of two apart, would push each other out of the cache.
    for top in range(0, size, 8):
        for left in range(0, top + 8, 8):
            for row in range(top, min(top + 8, size)):
                for column in range(left, min(left + 8, row)):
                    matrix[column, row] = matrix[row, column]
