"""The search among known mixes: evaluate each, descend briefly from the best few, and longer from the winner."""

from homofact.methods.effort import FitBudget
from homofact.methods.mix import Mix, is_movable
from homofact.methods.trials import DESCENTS, Trials

STEPS = 12  # iterations of the best few


def looked_at(trials: Trials, mixes: list[Mix]) -> list[Mix]:
    """Return the mixes with their errors on small textures with one fold left out, best first."""
    return sorted(trials.beside(trials.glanced, mixes), key=lambda mix: mix.error)


def finished(trials: Trials, looked: list[Mix]) -> Mix:
    """Descend briefly from the first few mixes, judge them at the search's size, and return the best one polished."""
    moved = trials.beside(lambda mix: _moved(trials, mix), looked[: trials.settings.descending])
    best = min(moved, key=lambda mix: mix.error)
    return trials.beside(lambda mix: trials.polished(mix, alike=False), [best])[0]


def _moved(trials: Trials, mix: Mix) -> tuple[Mix, FitBudget]:
    """Return the mix after a short descent, evaluated on one fold at the size of the search."""
    budget = trials.budget.beside()
    if is_movable(mix):
        (_, mix), more = trials.descended(mix, None, STEPS, DESCENTS)
        budget.add(more)
    mix, more = trials.glanced(mix, 1.0)
    budget.add(more)
    return mix, budget
