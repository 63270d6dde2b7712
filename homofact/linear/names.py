"""The names of solvers and of a texture's kinds of axes, apart from what they do: checks and help load no torch."""

from enum import Enum

Shape = tuple[int, int]

SOLVER_NAMES = ("cholesky", "qr", "lsmr", "cg", "qmr")


class Axis(Enum):
    """The kind of one axis of a texture: `layout`."""

    CLAMPED = "clamped"
    PERIODIC = "periodic"
    POLAR = "polar"


# (along rows, along columns), in the order of a shape: the first is the axis on which the row number runs.
Axes = tuple[Axis, Axis]
CLAMPED: Axes = (Axis.CLAMPED, Axis.CLAMPED)
