"""What every search over a vector of projections has: one signature, a budget, best-so-far and a trace."""

import time
from typing import Protocol

from torch import Tensor

from homofact.errors import BadInput, Report, Status
from homofact.factor.objective import Objective


class BudgetSpent(Exception):
    """Raised inside an evaluation to leave a library's loop; never seen outside of a search."""


class Search(Protocol):
    """A way to minimise an objective from a start, a frozen dataclass of its own settings."""

    @property
    def name(self) -> str:
        """The name in reports and charts."""
        ...

    def limited(self, steps: int) -> "Search":
        """The same search with at most so many iterations (or, where it counts those, evaluations)."""
        ...

    def minimize(
        self, objective: Objective, start: Tensor, *, seconds: float = float("inf"), seed: int = 0
    ) -> tuple[Tensor, Report]:
        """The best vector (V,) met within `seconds`, and a report whose residual is its R.

        At least one evaluation is made whatever the budget. Ctrl-C ends the search as INTERRUPTED with the
        best so far, or is raised again where there is none.
        """
        ...


class Best:
    """The best vector so far, the trace of how it got better, and the clock that ends the search."""

    def __init__(self, seconds: float) -> None:
        if not seconds > 0:
            raise BadInput(f"budget: found {seconds} seconds, expected more than 0")
        self._seconds = seconds
        self._began = time.perf_counter()
        self.vector: Tensor | None = None
        self.value = float("inf")
        self.evaluations = 0
        self.trace: list[tuple[float, int, float]] = []

    def offer(self, value: float, vector: Tensor) -> None:
        """Note an evaluation. Raises BudgetSpent once the time is up."""
        self.evaluations += 1
        elapsed = time.perf_counter() - self._began
        if value < self.value:
            self.value, self.vector = value, vector.clone()
            self.trace.append((elapsed, self.evaluations, value))
        if elapsed > self._seconds:
            raise BudgetSpent

    def finish(self, status: Status, iterations: int, seconds: float, seed: int) -> tuple[Tensor, Report]:
        """The best vector and its report."""
        if self.vector is None:
            raise BadInput("search: no evaluation gave a finite value, expected finite samples")
        return self.vector, Report(status, iterations, self.evaluations, seconds, self.value, seed, tuple(self.trace))
