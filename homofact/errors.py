"""What can go wrong, and what every fit and search reports when it is done.

`BadInput` is the user's to mend and ends a command with exit code 2. `Status` says how a computation
ended and what to do about it; `Report` carries it with the cost.
"""

from dataclasses import dataclass, field
from enum import Enum
from typing import Any


class HomofactError(Exception):
    """Base of every error that homofact raises on purpose."""


class BadInput(HomofactError):
    """A file, argument or setting that cannot be used: one line saying which, what was found, what is expected."""


class MissingDependency(BadInput):
    """An optional library is not installed: the message says which extra brings it."""


class SolverFailure(HomofactError):
    """A linear system could not be solved, or its solution is not finite."""


class Status(Enum):
    """How a fit, search or solve ended. The value is the word in reports; `remedy` says what to do."""

    CONVERGED = "converged"
    BUDGET = "budget"
    GUARD = "guard"
    INTERRUPTED = "interrupted"
    DIRECT = "direct"
    FALLBACK = "fallback"

    @property
    def remedy(self) -> str:
        """One line for the user: what to change where this ending is not good enough."""
        return _REMEDIES[self]


_REMEDIES = {
    Status.CONVERGED: "nothing: the search stopped by its own tolerance",
    Status.BUDGET: "the effort was used up: give it more for a better fit",
    Status.GUARD: "the clock ended the search: another run may end elsewhere; give it a larger --budget, or none",
    Status.INTERRUPTED: "the search was interrupted: the best so far was kept; run again for the whole search",
    Status.DIRECT: "nothing: the projections are fixed, one linear solve",
    Status.FALLBACK: "the system was singular to working precision: more smoothing, fewer textures or more samples",
}


@dataclass(frozen=True)
class Report:
    """The frozen account of one fit, search or solve.

    `seconds` is wall time, `residual` the value of the objective at the end (its meaning is the
    producer's), `trace` (seconds, evaluations, best so far) triples.
    """

    status: Status
    iterations: int
    evaluations: int
    seconds: float
    residual: float
    seed: int
    trace: tuple[tuple[float, int, float], ...] = ()
    notes: tuple[str, ...] = ()
    details: dict[str, Any] = field(default_factory=dict)
