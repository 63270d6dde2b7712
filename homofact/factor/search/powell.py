"""Powell's direction set method on unit quaternions, as the thesis uses it for pairs of quaternions (3.1.1).

A point is a rotation R (of R⁴, or of R³), a direction a rotation D, and the line through R along D is t ↦ D^t R.
Directions are scaled to one radian per unit of t: D^t rotates by t along the unit logarithm. The objective is the error
of the projection. −P has the same error as P (its texture is rotated by 180°), so the error along a basis direction has
the period π. Along a general line it need not be periodic, and the search is limited to 4π, as in the thesis.

After a sweep through the directions, the total move R_f R_s⁻¹ is tried as a new direction. If the error falls along it,
it replaces the last direction.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass

import torch

from homofact.errors import Report, Status
from homofact.factor.search.golden import golden_section
from homofact.geometry.rotation import Rotation, basis_rotations

PERIOD = 4 * torch.pi


@dataclass(frozen=True)
class Powell:
    """Settings: first step and tolerance of the line search (radians), relative gain at which it stops, sweeps."""

    step: float = 0.3
    line_tolerance: float = 0.1
    tolerance: float = 3e-3
    sweeps: int = 6

    def minimize(
        self, function: Callable[[Rotation], float], start: Rotation, seed: int = 0
    ) -> tuple[Rotation, Report]:
        """Return the best rotation found from `start`, and the report (residual: its error).

        The status is CONVERGED if a sweep lowered the error by less than the share `tolerance`, and BUDGET if the
        maximum of sweeps was reached. `seed` is only passed on to the report. The first directions are the thesis's
        six, or three in R³.
        """
        began = time.perf_counter()
        evaluations = 0
        trace: list[tuple[float, int, float]] = []

        def measure(point: Rotation) -> float:
            nonlocal evaluations
            evaluations += 1
            value = function(point)
            if not trace or value < trace[-1][2]:
                trace.append((time.perf_counter() - began, evaluations, value))
            return value

        def along(direction: Rotation, point: Rotation, error: float) -> tuple[Rotation, float]:
            t, value = golden_section(
                lambda t: measure((direction**t @ point).normalized()), error, self.step, self.line_tolerance, PERIOD
            )
            return ((direction**t @ point).normalized(), value) if value < error else (point, error)

        directions = [_unit_speed(direction) for direction in basis_rotations(start.dimension)]
        point, error = start, measure(start)
        status, sweep = Status.BUDGET, 0
        for sweep in range(1, self.sweeps + 1):  # noqa: B007 (the count is reported)
            begin_point, begin_error = point, error
            for direction in directions:
                point, error = along(direction, point, error)
            if begin_error - error <= self.tolerance * begin_error:
                status = Status.CONVERGED
                break
            average = _unit_speed(point @ begin_point.inverse())
            moved, lower = along(average, point, error)
            if lower < error:
                point, error = moved, lower
                directions[-1] = average
        seconds = time.perf_counter() - began
        return point, Report(status, sweep, evaluations, seconds, error, seed, tuple(trace))


def _unit_speed(direction: Rotation) -> Rotation:
    """Scale a direction about the same axes, so that its power t has a total quaternion angle of t radians."""
    q = direction.quaternions
    length = float(torch.atan2(q[:, 1:].norm(dim=1), q[:, 0]).norm())
    return direction if length < 1e-12 else direction ** (1 / length)
