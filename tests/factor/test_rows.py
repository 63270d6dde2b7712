"""What the rows of a projection mean: how often its texture is read."""

import numpy as np
import pytest

from homofact.factor.rows import lookup_matrices
from homofact.geometry.coordinates import COORDINATES

# Unchanged where ωi and ωo are exchanged.
SYMMETRIC = np.array([[0.5, 0, 0.5, 0], [0, 0.5, 0, 0.5]])
WI = np.array([[1.0, 0, 0, 0], [0, 1, 0, 0]])
ANGLES = np.array([[1.0, 0, 0], [0, 1, 0]])


@pytest.mark.parametrize(
    ("matrix", "coordinates", "reciprocal", "searched", "lookups"),
    [
        (WI, "in-out", True, False, 2),
        (WI, "in-out", False, False, 1),
        (SYMMETRIC, "in-out", True, False, 1),
        # It moves, and counts twice even where it happens to be its own conjugate.
        (SYMMETRIC, "in-out", True, True, 2),
        # All are their own conjugates there.
        (ANGLES, "isotropic-half-diff", True, True, 1),
    ],
)
def test_a_texture_is_read_at_the_conjugate_too(
    matrix: np.ndarray, coordinates: str, reciprocal: bool, searched: bool, lookups: int
) -> None:
    found = lookup_matrices(matrix, COORDINATES[coordinates], reciprocal, searched)
    assert len(found) == lookups
    assert np.array_equal(found[0], matrix)
    if lookups == 2:
        assert np.array_equal(found[1], matrix[:, [2, 3, 0, 1]])
