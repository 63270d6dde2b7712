"""The last step of a search: refine the projections at full size on all samples, then the λ of each material.

This step has its own effort. If the textures are too large for dense systems, the fit uses the search's λ, scaled to
their size.
"""

import time
from dataclasses import replace

from homofact.errors import Status
from homofact.factor.search.minimize import minimize
from homofact.factor.textures import texture_shape
from homofact.linear.layout import Shape
from homofact.linear.size import is_dense
from homofact.methods.effort import FitBudget, cost_of_solve
from homofact.methods.kinds import is_searched
from homofact.methods.materials import Materials
from homofact.methods.mix import Mix
from homofact.methods.search_task import SearchTask, search_named
from homofact.methods.structure_search import SearchOutcome
from homofact.methods.trials import rounded

FINE_STEPS, MOST_FINE_STEPS = 10, 40  # iterations at full size: fewer are not worth having, most


def at_full_size(
    task: SearchTask, outcome: SearchOutcome, shapes: tuple[Shape, ...], budget: FitBudget
) -> tuple[SearchOutcome, tuple[Mix, ...]]:
    """Refine projections and then each material's λ on all samples; return (outcome, the mix with each λ).

    `budget` limits the work of both.
    """
    count = len(task.materials)
    if outcome.status in (Status.INTERRUPTED, Status.GUARD):
        return outcome, (outcome.mix,) * count
    smoothing = task.smoothing_for(outcome.mix, shapes)
    if any(map(is_searched, outcome.mix.kinds)):
        outcome = _refined(task, outcome, shapes, smoothing, budget)
    mixes = [replace(outcome.mix, smoothing=smoothing)] * count
    if outcome.status in (Status.INTERRUPTED, Status.GUARD):
        return outcome, tuple(mixes)
    # A known mix has the λ that many fits agree on, which the search has scaled: another search for it, at full size,
    # took 30% of the fit's time and gained nothing in the median of ten measurements of RGL.
    if task.settings.smoothing is None and not outcome.known and _dense(shapes):
        for number, material in enumerate(task.full.materials):
            # What is left is shared evenly by those to come.
            own = FitBudget(budget.left / (count - number), budget.deadline)
            mixes[number] = _smoothed(mixes[number], Materials((material,)), shapes, own)
            budget.add(own)
    status = Status.GUARD if budget.late else outcome.status
    evaluations = outcome.evaluations + budget.evaluations
    error = sum(mix.error for mix in mixes) / count
    mix = replace(outcome.mix, error=error)
    return replace(outcome, mix=mix, status=status, evaluations=evaluations), tuple(mixes)


def _refined(
    task: SearchTask, outcome: SearchOutcome, shapes: tuple[Shape, ...], smoothing: tuple[float, ...], budget: FitBudget
) -> SearchOutcome:
    """Refine the projections of the outcome once more, on all samples.

    If evaluations at full size cost too much, the refinement uses textures of the search's size.
    """
    mix, settings, full = outcome.mix, task.settings, task.full
    cost = _cost(full, mix, shapes)
    steps = int(0.5 * budget.left / cost)
    if steps < FINE_STEPS or not _dense(shapes):
        shapes = tuple(texture_shape(projection, task.sizes.coarse) for projection in mix.projections)
        smoothing = mix.smoothing
        cost = _cost(full, mix, shapes)
        steps = int(0.5 * budget.left / cost)
    objective = full.objective(mix.projections, shapes, smoothing, settings.bound)
    left = max(budget.deadline - time.perf_counter(), 1e-3)
    search = search_named(settings.search).limited(min(max(steps, 1), MOST_FINE_STEPS))
    vector, report = minimize(search, objective, objective.start(), seconds=left, seed=settings.seed)
    outcome = replace(outcome, mix=replace(mix, projections=objective.projections(rounded(vector))))
    budget.spend(report.evaluations * cost, report.evaluations)
    if report.status is Status.INTERRUPTED:
        return replace(outcome, status=report.status, notes=(*outcome.notes, "interrupted while refining"))
    return replace(outcome, status=report.status) if report.status is Status.GUARD else outcome


def _dense(shapes: tuple[Shape, ...]) -> bool:
    """Return whether textures of these shapes lead to a dense linear system."""
    return is_dense(sum(rows * columns for rows, columns in shapes))


def _smoothed(mix: Mix, material: Materials, shapes: tuple[Shape, ...], budget: FitBudget) -> Mix:
    """Return the mix with the best λ for one material at full size, starting from the mix's own λ."""
    texels = sum(rows * columns for rows, columns in shapes)
    partitions = material.materials[0].partitions
    # Every λ is asked about at least twice: with all folds where that can be paid for, else with one.
    solves = 2 * len(mix.smoothing) * sum(int(partition.folds.max()) + 1 for partition in partitions)
    folds = None if solves * cost_of_solve(texels) < budget.left else 1
    folded = material.folded(mix.projections, shapes, folds)
    budget.spend(_cost(material, mix, shapes))
    smoothing, error = folded.best_smoothing(mix.smoothing, budget, 1)
    if folds is None:
        smoothing, error = folded.best_each(smoothing, budget, 1)
    return replace(mix, smoothing=smoothing, error=error)


def _cost(materials: Materials, mix: Mix, shapes: tuple[Shape, ...]) -> float:
    """Return the cost, in budget units, of one evaluation of a mix with textures of these shapes."""
    texels = sum(rows * columns for rows, columns in shapes)
    return materials.cost(sum(projection.lookups for projection in mix.projections), texels)
