"""The names of solvers and of kinds of texture axes, in a module that does not import torch."""

from enum import Enum

Shape = tuple[int, int]

SOLVER_NAMES = ("cholesky", "qr", "lsmr", "cg", "qmr")


class Axis(Enum):
    """The kind of a texture axis (see `layout`)."""

    CLAMPED = "clamped"
    PERIODIC = "periodic"
    POLAR = "polar"


# (along rows, along columns), in the order of a shape: the first is the axis on which the row number runs.
Axes = tuple[Axis, Axis]
CLAMPED: Axes = (Axis.CLAMPED, Axis.CLAMPED)
