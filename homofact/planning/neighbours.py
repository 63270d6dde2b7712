"""The neighbours of a choice: a smaller representation, and a larger one with a smaller error.

Measured rungs have priority. If no larger rung was measured, the model of the ladder's errors (`planning.search`) gives
the cheapest rung that should have a clearly smaller error, with the median of this error. `measure_larger` fits that
rung, because a prediction from a few fits can be wrong, above all for sampled sources, where larger textures may have
larger errors.
"""

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import Any

from homofact.planning.ladder import Candidate
from homofact.planning.material_fits import rungs_for
from homofact.planning.plan import MaterialPlan, ScenePlan
from homofact.planning.search import LadderOutcome, expected_errors

# A larger representation is a step where its error falls at least to this part of the choice's. One that was only
# expected to is named for at most so many times the bytes.
CLEARLY, NEAR = 0.9, 16
# A far smaller representation has at most this part of the choice's bytes, and an error of at most so many limits, or
# errors of a choice that misses the limit.
FAR_FEWER, ALIKE = 1 / 8, 1.5
# How many larger representations are fitted for a material, at most, to find one that errs less.
TRIES = 2


@dataclass(frozen=True)
class Neighbour:
    """A representation that is a smaller or larger alternative to the choice.

    `error` is the share of the tolerance that it uses, margins included. If `measured` is false, it was not fitted:
    `error` is predicted, and `bytes` is an upper bound. `trusted` as in `LadderOutcome`.
    """

    candidate: Candidate
    bytes: int
    error: float
    measured: bool
    trusted: bool = True

    def record(self) -> dict[str, Any]:
        """Return the JSON form."""
        return asdict(self.candidate) | {"bytes": self.bytes, "of_tolerance": self.error, "measured": self.measured}


def smaller(plan: MaterialPlan) -> Neighbour | None:
    """Return the measured representation of fewer bytes with the smallest error; None if there is none."""
    chosen = plan.outcome
    if chosen is None:
        return None
    # One that its verdict does not trust is within the limits: nearer to the tolerance than one that misses them.
    below = [
        (answer.error if answer.trusted else 1.0, answer.bytes, rung, answer.trusted)
        for rung, answer in plan.walk.asked.items()
        if answer.bytes < chosen.bytes and math.isfinite(answer.error) and _allowed(plan, answer)
    ]
    if not below:
        return None
    error, size, rung, trusted = min(below)
    return Neighbour(rung, size, error, True, trusted)


def far_smaller(plan: MaterialPlan) -> Neighbour | None:
    """Return the smallest measured representation that misses the tolerance by little; None if there is none.

    It has at most `FAR_FEWER` of the choice's bytes. Its error is at most `ALIKE` times the limit. If the choice misses
    the limit, it is at most `ALIKE` times the choice's error.
    """
    chosen = plan.outcome
    if chosen is None:
        return None
    most = ALIKE * max(chosen.error, 1.0)
    found = [
        Neighbour(rung, answer.bytes, answer.error, True, answer.trusted)
        for rung, answer in plan.walk.asked.items()
        if answer.bytes <= FAR_FEWER * chosen.bytes and answer.error <= most and _allowed(plan, answer)
    ]
    return min(found, key=lambda one: (one.bytes, one.error), default=None)


def larger(plan: MaterialPlan) -> Neighbour | None:
    """Return the cheapest larger representation with a clearly smaller error, measured or predicted, or None."""
    chosen = plan.outcome
    if chosen is None or chosen.error == 0:
        return None
    asked = plan.walk.asked
    above = [
        Neighbour(rung, answer.bytes, answer.error, True, answer.trusted)
        for rung, answer in asked.items()
        if answer.bytes > chosen.bytes and answer.error <= CLEARLY * chosen.error and _allowed(plan, answer)
    ]
    if above and plan.walk.stepped:
        return min(above, key=lambda one: (one.bytes, one.error))
    above += [one for one in _expected_above(plan) if one.error <= CLEARLY * chosen.error]
    return min(above, key=lambda one: (one.bytes, one.error), default=None)


def _expected_above(plan: MaterialPlan) -> list[Neighbour]:
    """Return larger unmeasured representations within `NEAR` times the bytes, with expected errors."""
    asked, pool, channels = plan.walk.asked, _above(plan), len(plan.fits.source.samples.channels)
    errors = expected_errors(pool, asked) if pool else []
    return [Neighbour(rung, rung.most_bytes(channels), error, False) for rung, error in zip(pool, errors, strict=True)]


def _above(plan: MaterialPlan) -> list[Candidate]:
    """Return unmeasured representations with more bytes than the choice, but at most `NEAR` times as many."""
    chosen, channels = plan.outcome, len(plan.fits.source.samples.channels)
    assert chosen is not None
    return [
        rung
        for rung in rungs_for(plan.fits, plan.tolerance)
        if rung not in plan.walk.asked
        and chosen.bytes < rung.most_bytes(channels) <= NEAR * chosen.bytes
        and _may_be_allowed(plan, rung)
    ]


def best_larger(plan: MaterialPlan) -> Neighbour | None:
    """Return the larger representation with the least error, even if this is no less than the choice's.

    It is a measured one where there is one; else the one that is expected to err least. None where no larger one is
    among the candidates.
    """
    chosen = plan.outcome
    if chosen is None:
        return None
    asked, channels = plan.walk.asked, len(plan.fits.source.samples.channels)
    tried = [
        Neighbour(rung, answer.bytes, answer.error, True, answer.trusted)
        for rung, answer in asked.items()
        if answer.bytes > chosen.bytes and math.isfinite(answer.error) and _allowed(plan, answer)
    ]
    if not tried:
        pool = [
            rung
            for rung in rungs_for(plan.fits, plan.tolerance)
            if rung not in asked and rung.most_bytes(channels) > chosen.bytes and _may_be_allowed(plan, rung)
        ]
        tried = [
            Neighbour(rung, rung.most_bytes(channels), error, False)
            for rung, error in zip(pool, expected_errors(pool, asked) if pool else [], strict=True)
        ]
    return min(tried, key=lambda one: (one.error, one.bytes), default=None)


def _allowed(plan: MaterialPlan, answer: LadderOutcome) -> bool:
    return plan.budget.allows(answer.bytes, answer.fetches)


def _may_be_allowed(plan: MaterialPlan, rung: Candidate) -> bool:
    """Return whether a representation certainly fits the scene's budget; otherwise it is not offered."""
    samples = plan.fits.source.samples
    return plan.budget.allows(rung.most_bytes(len(samples.channels)), rung.most_fetches(samples.isotropic))


def sufficient(plan: MaterialPlan) -> Neighbour | None:
    """Return the smallest measured representation that meets a tolerance which the choice misses; None for none."""
    chosen = plan.outcome
    if chosen is None or plan.walk.met:
        return None
    enough = [
        Neighbour(rung, answer.bytes, answer.error, True, answer.trusted)
        for rung, answer in plan.walk.asked.items()
        if answer.bytes > chosen.bytes and answer.error <= 1
    ]
    return min(enough, key=lambda one: (one.bytes, one.error), default=None)


def measure_larger(plan: MaterialPlan) -> None:
    """Fit and measure the larger step if it is only predicted; try others if its error is not clearly smaller.

    Larger models come first, because they are fitted almost instantly. Next comes the cheapest larger representation
    whose predicted error is smaller at all, because the prediction of a clearly smaller error may be based on few fits.
    The outcomes are added to the plan's walk. The cheapest measured rung with a clearly smaller error is then the
    larger step. If `TRIES` more fits find none, the step remains a predicted one.
    """
    chosen = plan.outcome
    if plan.walk.stepped:
        return
    if chosen is not None and chosen.error > 0:
        for one in _above(plan):
            if one.lobes:
                plan.walk.asked[one] = plan.ask(one)
        less = [one for one in _expected_above(plan) if one.error < chosen.error]
        if less:
            nearest = min(less, key=lambda one: (one.bytes, one.error)).candidate
            plan.walk.asked[nearest] = plan.ask(nearest)
    for _ in range(TRIES):
        step = larger(plan)
        if chosen is None or step is None or step.measured:
            break
        plan.walk.asked[step.candidate] = plan.ask(step.candidate)
    plan.walk.stepped = True


def with_larger_measured(found: ScenePlan, tell: Callable[[str], None] = lambda _: None) -> ScenePlan:
    """Return the plan with the larger step of each material measured, and its fits counted."""
    fits = {id(each.fits): each.fits for each in found.distinct}.values()

    def count() -> int:
        return sum(len(each.made) + len(each.refused) for each in fits)

    before = count()
    for each in found.distinct:
        tell(f"fitting one step larger for {each.name}")
        measure_larger(each)
    return replace(found, fits=found.fits + count() - before)
