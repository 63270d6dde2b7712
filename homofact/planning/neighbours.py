"""What one step down or up from a choice costs: a smaller representation, and a larger one that errs less.

Rungs that the plan has measured come first. Where no larger one was measured, the belief about the ladder
(`planning.search`) names the cheapest that should err clearly less, with the median of its error.
"""

import math
from dataclasses import asdict, dataclass
from typing import Any

from homofact.planning.ladder import Candidate
from homofact.planning.plan import MaterialPlan, rungs_for
from homofact.planning.search import expected_errors

# An error that was only expected is named where it falls at least to this part of the choice's, for at most so many
# times its bytes.
CLEARLY, NEAR = 0.9, 16


@dataclass(frozen=True)
class Neighbour:
    """A representation beside the choice.

    `error` is the part of the tolerance that it uses, margins included; `measured` tells whether it was fitted, or the
    error is expected and `bytes` are the most that it takes.
    """

    candidate: Candidate
    bytes: int
    error: float
    measured: bool

    def record(self) -> dict[str, Any]:
        """Return the JSON form."""
        return asdict(self.candidate) | {"bytes": self.bytes, "of_tolerance": self.error, "measured": self.measured}


def smaller(plan: MaterialPlan) -> Neighbour | None:
    """Return the best representation of fewer bytes that was measured; None where there is none."""
    chosen = plan.outcome
    if chosen is None:
        return None
    below = [
        (answer.error, answer.bytes, rung)
        for rung, answer in plan.walk.asked.items()
        if answer.bytes < chosen.bytes and math.isfinite(answer.error)
    ]
    if not below:
        return None
    error, size, rung = min(below)
    return Neighbour(rung, size, error, True)


def larger(plan: MaterialPlan) -> Neighbour | None:
    """The cheapest representation of more bytes that errs less, measured or expected; None where there is none."""
    chosen = plan.outcome
    if chosen is None or chosen.error == 0:
        return None
    asked, channels = plan.walk.asked, len(plan.fits.source.samples.channels)
    above = [
        Neighbour(rung, answer.bytes, answer.error, True)
        for rung, answer in asked.items()
        if answer.bytes > chosen.bytes and answer.error < chosen.error
    ]
    pool = [
        rung
        for rung in rungs_for(plan.fits, plan.tolerance)
        if rung not in asked and chosen.bytes < rung.most_bytes(channels) <= NEAR * chosen.bytes
    ]
    if pool:
        above += [
            Neighbour(rung, rung.most_bytes(channels), error, False)
            for rung, error in zip(pool, expected_errors(pool, asked), strict=True)
            if error <= CLEARLY * chosen.error
        ]
    return min(above, key=lambda one: (one.bytes, one.error), default=None)
