"""A tournament of mixes: many starts descend a few steps, the better half some more, and the last few are judged."""

import math

from homofact.methods.mix import Mix, is_movable, scale_of
from homofact.methods.trials import DESCENTS, Trials

BEAM = 4  # fixed mixes that the next step goes on from
_FINALISTS = 3  # mixes that are judged in full at the end of a tournament; the best of them is polished
FIRST_STEPS, LAST_STEPS = 6, 24  # iterations of the first and the last round of descents
_LEAST_PLACES = 6  # starts that descend in a tournament, whatever is left of the budget
LOOKS = 4  # starts that are looked at for every one that may descend


def tournament(trials: Trials, starts: list[Mix], until: float) -> list[Mix]:
    """Return the best few of `starts`, best first: all descend a few steps, the better half some more, and so on.

    The number of starts is limited so that the total work stays within `until` units, but at least `_LEAST_PLACES`
    descend. All descents use the same λ.
    """
    if not starts:
        return []
    searched = [mix for mix in starts if is_movable(mix)]
    rest = [mix for mix in starts if not is_movable(mix)]
    # Where projections have moved into place there is less for λ to smooth over.
    scale = 0.1 * scale_of(starts[0].smoothing)
    steps, spare = FIRST_STEPS, until - trials.budget.spent
    if searched:
        # A round costs about as much as the one before it, half of the starts with twice the steps; of the rest a
        # third is for looking at more starts than can descend, and a third for judging.
        descent = max(trials.cost(mix, DESCENTS) for mix in searched) * (1 + FIRST_STEPS)
        places = max(_LEAST_PLACES, int(spare / (3 * descent)))
        searched = searched[: LOOKS * places]
        if len(searched) > places:
            looks = trials.beside(lambda mix: trials.looked(mix, scale), searched)
            order = sorted(range(len(searched)), key=lambda place: looks[place])
            searched = [searched[place] for place in sorted(order[:places])]
    while searched:
        ranked = trials.beside(lambda mix, steps=steps: trials.descended(mix, scale, steps, DESCENTS), searched)
        ranked.sort(key=lambda pair: pair[0])
        searched = [mix for _, mix in ranked]
        if steps >= LAST_STEPS or trials.budget.late:
            break
        searched = searched[: max(2, math.ceil(len(searched) / 2))]
        steps *= 2
    mixes = trials.beside(lambda mix: trials.judge(mix, scale), [*searched[:_FINALISTS], *rest[:BEAM]])
    best = min(mixes, key=lambda mix: mix.error)
    rest = [mix for mix in mixes if mix is not best]
    return sorted((*trials.beside(trials.polished, [best]), *rest), key=lambda mix: mix.error)
