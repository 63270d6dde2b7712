"""Derive the axes and lookups of a texture from the two rows of its projection's matrix, without torch."""

import numpy as np

from homofact.errors import BadInput
from homofact.geometry.coordinates import CoordinateSystem
from homofact.linear.names import Axes, Axis


def check_rows(matrix: np.ndarray, system: CoordinateSystem) -> None:
    """Raise BadInput for a matrix that does not fit the coordinates, is not finite, or mixes a periodic axis."""
    expected = (2, system.dimension)
    if tuple(matrix.shape) != expected:
        raise BadInput(f"matrix has shape {tuple(matrix.shape)}", where="projection", expected=expected)
    if not np.isfinite(matrix).all():
        raise BadInput("matrix has entries that are not finite", where="projection", expected="finite numbers")
    for name in system.periodic:
        column = system.axes.index(name)
        rows = matrix[matrix[:, column] != 0]
        if (np.abs(rows[:, column]) != 1).any() or ((rows != 0).sum(1) != 1).any():
            raise BadInput(
                f"the matrix mixes or scales {name}, which is periodic", where="projection", expected="it alone"
            )


def axes_of_rows(matrix: np.ndarray, system: CoordinateSystem) -> Axes:
    """Return the kinds of the texture's axes (rows, columns): `linear.layout`."""
    read = [system.axes[int(np.abs(row).argmax())] if (row != 0).any() else "" for row in matrix]
    around = any(name in system.periodic for name in read)
    first = [
        Axis.PERIODIC if name in system.periodic
        else Axis.POLAR if around and name == system.pole and float(row.sum()) > 0
        else Axis.CLAMPED
        for name, row in zip(read, matrix, strict=True)
    ]  # fmt: skip
    return first[1], first[0]


def lookup_matrices(
    matrix: np.ndarray, system: CoordinateSystem, reciprocal: bool, searched: bool
) -> tuple[np.ndarray, ...]:
    """Return the matrix of every lookup: P alone, or P and its conjugate P S.

    A fixed projection that is its own conjugate is looked up once. A searched projection always has two lookups, even
    if it happens to be its own conjugate, since it changes during the search. (The exception is a coordinate system in
    which the swap changes nothing.)
    """
    swap = np.array(system.swap, dtype=matrix.dtype)
    swapped = matrix @ swap
    fixed = not searched or np.array_equal(swap, np.eye(len(swap)))
    if not reciprocal or (fixed and np.array_equal(swapped, matrix)):
        return (matrix,)
    return matrix, swapped
