"""The names of the coordinates, apart from their formulas, so that checks and help need not load them."""

COORDINATE_NAMES = IN_OUT, HALF_DIFF, ISOTROPIC_HALF_DIFF, ISOTROPIC_IN_OUT = (
    "in-out",
    "half-diff",
    "isotropic-half-diff",
    "isotropic-in-out",
)
