"""The names of direction maps and decompositions, apart from their formulas, so that checks and help load no torch."""

MAP_NAMES = ("parabolic", "orthographic", "polar")
DECOMPOSITIONS = ("eigen", "svd", "power", "normalized")
# Those that need the symmetry of a reciprocal in-out matrix.
SYMMETRIC = ("eigen", "power")
# What the two sides of a matrix are indexed by.
SIDES = ("in-out", "half-diff")
