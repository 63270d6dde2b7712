"""Distribute a budget of bytes over all materials so that the error of the picture is smallest.

The picture's error is Σ share · error, with errors in units of the tolerance and each material's share of the picture.
Every material gets one rung. The best choice within the budget is found exactly as a multiple-choice knapsack: material
by material, a partial choice with more bytes is kept only if its error is smaller. Rungs that were not measured have
the error that the model of the search expects (`plan.search`). If the best choice contains such rungs, they are
measured and the choice is repeated, until all its rungs are measured.
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
    """One material: its share of the picture, its candidate rungs, and the function that measures a rung.

    `asked` has the outcomes so far; `allocate` adds to it. `most_fetches` limits the fetches of one evaluation.
    """

    share: float
    rungs: Sequence[Candidate]
    asked: dict[Candidate, LadderOutcome]
    ask: Callable[[Candidate], LadderOutcome]
    channels: int
    isotropic: bool
    most_fetches: float = math.inf

    def offers(self) -> list[tuple[int, float, Candidate | None]]:
        """Return (bytes, error, rung) of all candidates, including a rung None for no representation."""
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
    """Return each buyer's rung, all measured; None for buyers that get no representation within the budget."""
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
