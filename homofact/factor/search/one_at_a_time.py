"""Powell's method as a search: it optimises one projection at a time, in rounds.

A direct search is inefficient for all projections at once, since each has six dimensions, or three in R³. So each
projection is optimised in turn while the others are fixed, until a round no longer lowers the error.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

from torch import Tensor

from homofact.factor.search.minimize import MeasuredObjective, SearchEnding
from homofact.factor.search.powell import Powell
from homofact.geometry.rotation import Rotation


@dataclass(frozen=True)
class OneAtATime:
    """Rounds of `powell` over all searched projections; ends at a relative gain of `tolerance` a round."""

    powell: Powell = field(default_factory=Powell)
    rounds: int = 4
    tolerance: float = 3e-3

    @property
    def independent(self) -> bool:
        """Whether several searches may run in parallel."""
        return True

    @property
    def name(self) -> str:
        """The name in reports and charts."""
        return "powell"

    def limited(self, steps: int) -> "OneAtATime":
        """Return the same search with fewer sweeps: one for every four gradient iterations."""
        return replace(self, rounds=1, powell=replace(self.powell, sweeps=max(1, steps // 4)))

    def descend(self, measured: MeasuredObjective, start: Tensor, seed: int) -> SearchEnding:
        """See `minimize.Minimizer`."""
        vector = start.clone()
        before = measured.value(vector)
        for number in range(1, self.rounds + 1):
            for part in measured.objective.parts():
                vector = self._improve(measured.value, vector, part, seed)
            if before - measured.best <= self.tolerance * before:
                return SearchEnding(True, number)
            before = measured.best
        return SearchEnding(False, self.rounds)

    def _improve(self, measure: Callable[[Tensor], float], vector: Tensor, part: slice, seed: int) -> Tensor:
        def joined(rotation: Rotation) -> Tensor:
            result = vector.clone()
            result[part] = rotation.numbers
            return result

        here = Rotation.of_numbers(vector[part])
        rotation, report = self.powell.minimize(lambda rotation: measure(joined(rotation)), here, seed)
        return joined(rotation) if report.residual <= measure(vector) else vector
