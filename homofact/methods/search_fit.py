"""The searched fit: it finds mix, projections, warp and λ from the data, with an effort that is counted, not timed.

The search runs from coarse to fine. First, a `StructureSearch` on small textures and a subset of the samples chooses
the mix. Then the searched projections are refined jointly on all samples at full size. Unless the mix is a known one, λ
is chosen again at this size by cross-validation, with its own effort. Finally, one masked solve gives the textures.
Azimuth copies are made here, and only if a chosen kind depends on the azimuth: fixed and searched isotropic projections
use only the measured samples.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace

from homofact.brdf.pair_density import scheme_of
from homofact.brdf.samples import Samples
from homofact.errors import Report, Status
from homofact.factor.confidence import with_deviations
from homofact.factor.energy import keep_light
from homofact.factor.factorization import Factorization, Term
from homofact.factor.textures import LogSamples, Solved, residual, solve_terms, texture_shape
from homofact.linear.layout import Shape
from homofact.linear.least_squares import RELATIVE_RIDGE
from homofact.linear.threads import one_thread
from homofact.methods.common import as_stored, provenance_of
from homofact.methods.effort import FitBudget
from homofact.methods.fitting import FitProgress, MethodFit, ProgressCallback
from homofact.methods.full_size import at_full_size
from homofact.methods.mix import Mix
from homofact.methods.search import Search
from homofact.methods.search_task import FittedMaterial, SearchTask
from homofact.methods.shapes import best_within
from homofact.methods.structure_search import SearchOutcome, StructureSearch, kept_note
from homofact.methods.trials import Trials

_ATTEMPTS = 3  # solves more where a fit exceeds what is known beyond its measurement
# λ at least, where smoothing alone carries a flank on over clipped samples. Of 0, 1e-4, 1e-3 and 1e-2, and of leaving
# these samples out where the mix is chosen, 1e-4 with all of them came nearest to what scripts/verdict/robustness.py
# clips.
_LEAST_OVER_CLIPPED = 1e-4
# Textures cancel each other if the texels of one span so many times as much as the logarithms of the samples. Then a
# stronger ridge keeps them small: of 1e-7 to 1e-3, tried on paints of few samples, 1e-5 is the least with which 8 bits
# hold the texels (docs/export.md). Held-out errors change little, but may rise where texels are many times the samples.
# It is not taken if it multiplies the squared residual by `_MOST_LOSS`: then the samples determine the large texels.
# Samples that are drawn from a table or a model do, since as many are drawn as are asked for.
_CANCELLING, _STRONGER_RIDGE, _MOST_LOSS = 4.0, 1e-5, 1.25
_FINE_SHARE = 0.5  # of the search's effort, once more for refining and smoothing at full size


def fit_search(samples: Samples, settings: Search, progress: ProgressCallback | None = None) -> MethodFit:
    """Factor `samples` (the training samples as measured, without azimuth copies) with `settings.effort`.

    If the effort takes longer than `settings.budget` seconds, the search ends early. The status is then GUARD, and the
    provenance records that the fit is not reproducible. The report's notes mention textures that did not lower the
    error, the time limit, or an interrupt. Raises BadInput if there are too few samples for the folds.
    """
    return as_stored(fit_shared((samples,), settings, progress)[0], samples, settings)


@one_thread
def fit_shared(
    several: Sequence[Samples], settings: Search, progress: ProgressCallback | None = None
) -> tuple[MethodFit, ...]:
    """Factor several materials with one set of projections and texture sizes: a fit of each, in their order.

    The projections minimize the mean error of all materials (`methods.materials`); each material has its own λ and
    texels. The total effort is `settings.effort` times the number of materials. Raises BadInput as `fit_search`, and
    where channels differ.
    """
    began = time.perf_counter()
    task = SearchTask.of(several, settings, began)
    search, fine = FitBudget(task.granted, task.deadline), FitBudget(_FINE_SHARE * task.granted, task.deadline)
    outcome = _searched(task, search, progress)
    outcome, shapes = _laid_out(task, outcome, search)
    outcome, mixes = at_full_size(task, outcome, shapes, fine)
    if outcome.status is Status.GUARD:
        note = f"the guard of {settings.budget:g} s ended the search: another run may end elsewhere"
        outcome = replace(outcome, notes=(*outcome.notes, note))
    effort = {"granted": task.granted, "search": search.spent, "fine": fine.spent}
    return tuple(_fit(task, number, mix, outcome, shapes, effort, began) for number, mix in enumerate(mixes))


@one_thread
def find_mixes(samples: Samples, settings: Search) -> SearchOutcome:
    """Search only for mixes, on small textures; return the best mix with one texture, with two, and so on.

    Raises BadInput.
    """
    task = SearchTask.of((samples,), settings, time.perf_counter())
    return _searched(task, FitBudget(task.granted, task.deadline), None)


def trials_of(samples: Samples, settings: Search) -> Trials:
    """Return the `Trials` of `find_mixes`, without a limit of work. Raises BadInput."""
    task = SearchTask.of((samples,), settings, time.perf_counter())
    return Trials(task.drawn, task.structure, FitBudget())


def _searched(task: SearchTask, budget: FitBudget, progress: ProgressCallback | None) -> SearchOutcome:
    """Search for the best mixes of the drawn samples, on small textures."""
    search = StructureSearch(task.drawn, task.structure, budget, _reporting(progress, task.settings))
    return search.run(task.settings.most_textures, task.candidates)


def _reporting(progress: ProgressCallback | None, settings: Search) -> Callable[[int, int, float], None]:
    """Return the callback of a structure search, which forwards to `progress`."""

    def report(term: int, evaluations: int, best: float) -> None:
        if progress is not None:
            progress(FitProgress(term, settings.most_textures, 1, 1, evaluations, best))

    return report


def _laid_out(task: SearchTask, outcome: SearchOutcome, budget: FitBudget) -> tuple[SearchOutcome, tuple[Shape, ...]]:
    """Return the outcome and the textures' shapes; a byte budget also selects the mix that uses it best."""
    if task.sizes.texels is None:
        return outcome, tuple(texture_shape(projection, task.sizes.side) for projection in outcome.mix.projections)
    layouts = FitBudget(task.granted, task.deadline)
    measured = min(len(material.given) for material in task.materials)
    spent = best_within(task.sizes.texels, outcome.levels, task.full, task.smoothing_for, layouts, measured)
    budget.add(layouts)
    before, after = len(outcome.mix.kinds), len(spent.mix.kinds)
    notes = outcome.notes
    if after != before:
        # The bytes are best spent on another number of textures than the search at one size kept.
        notes = tuple(note for note in notes if note != kept_note(before, task.settings.most_textures))
        notes += (kept_note(after, task.settings.most_textures),) if after < task.settings.most_textures else ()
    return replace(outcome, mix=spent.mix, notes=notes), spent.shapes


def _fit(
    task: SearchTask,
    number: int,
    mix: Mix,
    outcome: SearchOutcome,
    shapes: tuple[Shape, ...],
    effort: dict[str, float],
    began: float,
) -> MethodFit:
    """Fit one of the materials: solve for its texels with the projections of `mix`, and write its report."""
    settings, material = task.settings, task.materials[number]
    smoothing, measured = mix.smoothing, material.data.measured
    if material.data.logs.clipped is not None:
        smoothing = tuple(max(value, _LEAST_OVER_CLIPPED) for value in smoothing)
    solved, terms, light = _solved(material, mix, smoothing, settings, shapes)
    provenance = provenance_of(material.given, settings) | {
        "smoothing": list(smoothing),
        "kinds": list(mix.kinds),
        "shapes": [list(shape) for shape in shapes],
        "validation_error": mix.error,
        "effort": effort,
        "reproducible": outcome.status not in (Status.GUARD, Status.INTERRUPTED),
    }
    if len(task.materials) > 1:
        provenance["shared"] = {"materials": len(task.materials), "number": number}
    if light is not None:
        provenance["light"] = light
    notes = outcome.notes
    if solved.status is Status.BUDGET:
        notes += (f"the textures' own system was left after {solved.steps} steps, short of its tolerance",)
    if settings.confidence:
        terms = with_deviations(measured, terms, smoothing)
    report = Report(
        Status.FALLBACK if solved.status is Status.FALLBACK else outcome.status,
        iterations=len(outcome.trace),
        evaluations=outcome.evaluations,
        seconds=time.perf_counter() - began,
        residual=float((residual(measured, terms) ** 2).mean()),
        seed=settings.seed,
        trace=outcome.trace,
        notes=notes,
        details=provenance | solved.details() | {"outliers": material.outliers},
    )
    return MethodFit(Factorization(terms, material.transform, material.given.channels, provenance), report)


def _solved(
    material: FittedMaterial, mix: Mix, smoothing: tuple[float, ...], settings: Search, shapes: tuple[Shape, ...]
) -> tuple[Solved, tuple[Term, ...], dict[str, float] | None]:
    """Return the solve, the terms and the light record; re-solve with more samples where the fit is too bright."""
    data, transform, attempt, ridge = material.data, material.transform, 0, RELATIVE_RIDGE
    measured = scheme_of(material.given) is None

    def with_ridge(ridge: float) -> tuple[Solved, tuple[Term, ...], dict[str, float] | None]:
        solved = solve_terms(data.judged, mix.projections, shapes, smoothing, settings.solver, ridge)
        if data.flux is None:
            return solved, solved.terms, None
        return solved, *keep_light(data.logs, solved.terms, smoothing, data.flux, solved.factor, ridge)

    while True:
        solved, terms, light = with_ridge(ridge)
        if measured and ridge == RELATIVE_RIDGE and _cancel(terms, data.logs):
            held = with_ridge(_STRONGER_RIDGE)
            if _misfit(data.judged, held[1]) < _MOST_LOSS * _misfit(data.judged, terms):
                (solved, terms, light), ridge = held, _STRONGER_RIDGE
        fit = Factorization(terms, transform, ("",) * len(transform.mean))
        more = None if attempt == _ATTEMPTS else material.extrapolation.exceeding(fit.evaluate, attempt)
        if more is None:
            return solved, terms, light
        data, attempt = data.with_more(more, transform), attempt + 1


def _cancel(terms: tuple[Term, ...], samples: LogSamples) -> bool:
    """Return whether a texture's texels span a far larger range than the samples' logarithms."""
    spans = [float((own.amax(0) - own.amin(0)).max()) for own in (term.texture[term.mask] for term in terms)]
    return max(spans) > _CANCELLING * float((samples.logs.amax(0) - samples.logs.amin(0)).max())


def _misfit(samples: LogSamples, terms: tuple[Term, ...]) -> float:
    """Return the weighted sum of squared log residuals."""
    return float((samples.weights[:, None] * residual(samples, terms).square()).sum())
