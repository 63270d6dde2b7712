"""A budget of bytes spent over all materials: the least error of the picture that it buys.

The picture's error is Σ share · error, errors in units of the tolerance, each material's by its share of the picture.
Every material takes one rung; of all choices within the budget the best is found exactly, material by material, keeping
of equal or more bytes only what errs less (a multiple-choice knapsack). Rungs that were not asked about count by what
the walk's belief expects of them (`plan.search`); those that the best choice takes are then asked, and it is made anew,
until it consists of measured ones.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from homofact.planning.ladder import Candidate
from homofact.planning.search import LadderOutcome, expected_errors

# Of a material without any representation, in units of the tolerance: more than any colour errs.
NOTHING = 1e6


@dataclass(frozen=True)
class Buyer:
    """One material: its share of the picture, the rungs that may serve it, and how one is asked about.

    `asked` holds the answers so far and is added to. `most_fetches` are those of one evaluation.
    """

    share: float
    rungs: Sequence[Candidate]
    asked: dict[Candidate, LadderOutcome]
    ask: Callable[[Candidate], LadderOutcome]
    channels: int
    isotropic: bool
    most_fetches: float = math.inf

    def offers(self) -> list[tuple[int, float, Candidate | None]]:
        """Return (bytes, error, rung) of all that may serve, None for nothing."""
        unasked = [
            rung
            for rung in self.rungs
            if rung not in self.asked and rung.most_fetches(self.isotropic) <= self.most_fetches
        ]
        expected = expected_errors(unasked, self.asked) if unasked else []
        return [
            (0, NOTHING, None),
            *((rung.most_bytes(self.channels), error, rung) for rung, error in zip(unasked, expected, strict=True)),
            *(
                (outcome.bytes, outcome.error, rung)
                for rung, outcome in self.asked.items()
                if outcome.fetches <= self.most_fetches and math.isfinite(outcome.error)
            ),
        ]


def allocate(buyers: Sequence[Buyer], most_bytes: float) -> list[Candidate | None]:
    """Return the rung of each buyer; all are asked about. None where even the smallest is beyond the budget."""
    while True:
        chosen = best_choice([(buyer.share, buyer.offers()) for buyer in buyers], most_bytes)
        unasked = [
            (buyer, candidate)
            for buyer, candidate in zip(buyers, chosen, strict=True)
            if candidate is not None and candidate not in buyer.asked
        ]
        if not unasked:
            return chosen
        for buyer, candidate in unasked:
            buyer.asked[candidate] = buyer.ask(candidate)


def best_choice(
    offers: Sequence[tuple[float, Sequence[tuple[int, float, Candidate | None]]]], most_bytes: float
) -> list[Candidate | None]:
    """Choose one rung for each (share, [(bytes, error, rung)]): Σ bytes ≤ `most_bytes`, Σ share · error least.

    Fewest bytes break ties.
    """
    states: list[tuple[int, float, list[Candidate | None]]] = [(0, 0.0, [])]
    for share, rungs in offers:
        grown = [
            (used + size, error + share * own, [*taken, rung])
            for used, error, taken in states
            for size, own, rung in rungs
            if used + size <= most_bytes
        ]
        grown.sort(key=lambda state: state[:2])
        states, least = [], math.inf
        for state in grown:
            if state[1] < least:
                states.append(state)
                least = state[1]
    return min(states, key=lambda state: (state[1], state[0]))[2]
