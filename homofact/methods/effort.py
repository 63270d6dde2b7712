"""The effort of a search, counted instead of timed, so that its result does not depend on the machine's speed.

The unit is one inner evaluation: the normal equations of two 16² textures from 8000 samples, solved, with the gradient.
A cost model converts all other work to this unit,

    evaluation   a + N (b L + c L²) + d T² + e T³        N samples, L lookups, T texels
    solve            d T² + e T³

with constants fitted to timings on one core (`scripts/speed/cost_model.py` shows how far they are off). They decide
what a search tries. The time that a unit takes depends on the machine.
"""

import math
import time

from homofact.errors import BadInput

LEVELS = {"quick": 12.0, "normal": 50.0, "thorough": 400.0}
_FIXED, _LOOKUP, _PAIR, _SQUARE, _CUBE = 2e-3, 1e-7, 8e-9, 5e-9, 1.2e-11


def _seconds(samples: int, lookups: int, unknowns: int) -> float:
    return _FIXED + samples * lookups * (_LOOKUP + _PAIR * lookups) + unknowns**2 * (_SQUARE + _CUBE * unknowns)


_UNIT = _seconds(8000, 2, 512)


def cost_of_evaluation(samples: int, lookups: int, unknowns: int) -> float:
    """Return units of one evaluation of the reduced objective with its gradient."""
    return _seconds(samples, lookups, unknowns) / _UNIT


def cost_of_solve(unknowns: int) -> float:
    """Return units of assembling one system from accumulated equations and solving it, as for a left-out fold."""
    return unknowns**2 * (_SQUARE + _CUBE * unknowns) / _UNIT


def units(effort: str | float, textures: int) -> float:
    """Return the units of an effort: a named level grants its own units times the square of `textures`.

    A mix of more textures has more projections to search, and each evaluation costs more. A number is returned
    unchanged.

    Raises BadInput that lists the levels.
    """
    if isinstance(effort, str):
        if effort not in LEVELS:
            raise BadInput(
                where="effort", found=repr(effort), expected=f"{', '.join(LEVELS)} or a number of inner evaluations"
            )
        return LEVELS[effort] * textures**2
    if not 0 < effort < math.inf:
        raise BadInput(where="effort", found=repr(effort), expected="a number of inner evaluations above 0")
    return float(effort)


class FitBudget:
    """Units granted and spent; the deadline is only a guard.

    Parallel tasks have their own budgets, which are added to this one after all tasks are done. The result therefore
    does not depend on the order of the threads.
    """

    def __init__(self, granted: float = math.inf, deadline: float = math.inf) -> None:
        """Create a budget of `granted` units of work, valid until `deadline` on the clock of time.perf_counter."""
        self.granted, self.deadline = granted, deadline
        self.spent = 0.0
        self.evaluations = 0

    def spend(self, cost: float, evaluations: int = 1) -> None:
        """Note work that is done."""
        self.spent += cost
        self.evaluations += evaluations

    def add(self, other: "FitBudget") -> None:
        """Add the work of a parallel task's budget."""
        self.spend(other.spent, other.evaluations)

    def beside(self) -> "FitBudget":
        """Return a budget for a parallel task, with the same deadline and no limit of units."""
        return FitBudget(deadline=self.deadline)

    @property
    def left(self) -> float:
        """Units not yet spent; 0 after the deadline."""
        return 0.0 if self.late else max(self.granted - self.spent, 0.0)

    @property
    def late(self) -> bool:
        """Whether the deadline has passed."""
        return time.perf_counter() > self.deadline

    @property
    def over(self) -> bool:
        """Whether no more work may start."""
        return self.left <= 0
