"""The names of the coordinates, without their formulas, so that checks and help need not import these."""

# Those that a projection may mix. Half angles have a periodic axis, which only stands by itself.
COORDINATE_NAMES = IN_OUT, HALF_DIFF, ISOTROPIC_HALF_DIFF, ISOTROPIC_IN_OUT, ISOTROPIC_ANGLES, ISOTROPIC_HALF_TILT = (
    "in-out",
    "half-diff",
    "isotropic-half-diff",
    "isotropic-in-out",
    "isotropic-angles",
    "isotropic-half-tilt",
)
HALF_ANGLES = "half-angles"
