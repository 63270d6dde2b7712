"""Powell's method behind the protocol of all searches: one projection at a time, round and round.

A direct search cannot well move all projections at once: each has six dimensions, or three in R³. So each is
minimised in its turn with the others still, until a round no longer helps.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace

from torch import Tensor

from homofact.errors import Report, Status
from homofact.factor.objective import Objective
from homofact.factor.search.best import Best, BudgetSpent
from homofact.factor.search.powell import Powell
from homofact.geometry.rotation import Rotation


@dataclass(frozen=True)
class OneAtATime:
    """Rounds of `powell` over all searched projections; ends at a relative gain of `tolerance` a round."""

    powell: Powell = field(default_factory=Powell)
    rounds: int = 4
    tolerance: float = 3e-3

    @property
    def name(self) -> str:
        """The name in reports and charts."""
        return "powell"

    def limited(self, steps: int) -> "OneAtATime":
        """The same with fewer sweeps: one for every four gradient iterations."""
        return replace(self, rounds=1, powell=replace(self.powell, sweeps=max(1, steps // 4)))

    def minimize(
        self, objective: Objective, start: Tensor, *, seconds: float = float("inf"), seed: int = 0
    ) -> tuple[Tensor, Report]:
        """The best vector met and the report; see `best.Search`."""
        best = Best(seconds)
        began = time.perf_counter()
        vector, status, number = start.clone(), Status.BUDGET, 0

        def measure(candidate: Tensor) -> float:
            value = objective.error(candidate)
            best.offer(value, candidate)
            return value

        try:
            before = measure(vector)
            for number in range(1, self.rounds + 1):  # noqa: B007 (the count is reported)
                for part in objective.parts():
                    vector = self._improve(measure, vector, part, seed)
                if before - best.value <= self.tolerance * before:
                    status = Status.CONVERGED
                    break
                before = best.value
        except BudgetSpent:
            status = Status.BUDGET
        except KeyboardInterrupt:
            if best.vector is None:
                raise
            status = Status.INTERRUPTED
        return best.finish(status, number, time.perf_counter() - began, seed)

    def _improve(self, measure: Callable[[Tensor], float], vector: Tensor, part: slice, seed: int) -> Tensor:
        def joined(rotation: Rotation) -> Tensor:
            result = vector.clone()
            result[part] = rotation.numbers
            return result

        here = Rotation.of_numbers(vector[part])
        found, report = self.powell.minimize(lambda rotation: measure(joined(rotation)), here, seed)
        return joined(found) if report.residual <= measure(vector) else vector
