"""The names of direction maps and decompositions, in a module that does not import torch."""

import math

MAP_NAMES = ("parabolic", "orthographic", "polar")
# What makes the two axes of each (`geometry.axes`) coordinates in [−1, 1].
_PLAIN = ((1.0, 0.0), (1.0, 0.0))
MAP_SCALES: dict[str, tuple[tuple[float, float], ...]] = {
    "parabolic": _PLAIN,
    "orthographic": _PLAIN,
    "polar": ((1 / math.pi, 0.0), (2.0, -1.0)),
}
DECOMPOSITIONS = ("eigen", "svd", "power", "normalized")
# Those that need the symmetry of a reciprocal in-out matrix.
SYMMETRIC = ("eigen", "power")
# What the two sides of a matrix are indexed by.
SIDES = ("in-out", "half-diff")
