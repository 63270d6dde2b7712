"""The searched fit: mix, projections, warp and λ found from the data, the work counted and not timed.

Coarse to fine. A `StructureSearch` on small textures and a subset of the samples chooses the mix; then the searched
projections are refined jointly on all samples at full size, and, unless the mix is a known one, λ is chosen again there
by cross-validation, for an effort of its own; one masked solve gives the textures. Azimuth copies are made here, and
only where a chosen kind knows the azimuth: fixed and searched isotropic projections see the measured
samples alone.
"""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from homofact.brdf.log_transform import LogTransform
from homofact.brdf.quality.extrapolation import Extrapolation
from homofact.brdf.samples import Samples
from homofact.errors import BadInput, Report, Status
from homofact.factor.confidence import with_deviations
from homofact.factor.energy import keep_light
from homofact.factor.factorization import Factorization, Term
from homofact.factor.search.gradient import Gradient
from homofact.factor.search.minimize import Minimizer as Minimizer
from homofact.factor.search.minimize import minimize
from homofact.factor.search.nlopt import Nlopt
from homofact.factor.search.one_at_a_time import OneAtATime
from homofact.factor.textures import Solved, residual, solve_terms, texture_shape
from homofact.linear.layout import Shape
from homofact.linear.size import is_dense
from homofact.linear.threads import one_thread
from homofact.methods.common import coarse_size, provenance_of, transform_of, trusted_samples, with_whole_texels
from homofact.methods.effort import FitBudget, cost_of_solve, units
from homofact.methods.fitting import FitProgress, MethodFit, ProgressCallback
from homofact.methods.kinds import ANISOTROPIC_CANDIDATES, ISOTROPIC_CANDIDATES, is_isotropic, is_searched
from homofact.methods.known_mixes import DESCENDING, NONE, known_mixes
from homofact.methods.materials import Materials
from homofact.methods.memory import refuse_too_large
from homofact.methods.mix import Mix
from homofact.methods.search import Search
from homofact.methods.search_data import FOLDS, SearchData
from homofact.methods.shapes import SmoothingFor, best_within, texels_in
from homofact.methods.structure_search import SearchOutcome, StructureSearch
from homofact.methods.trials import StructureSettings, Trials, rounded

_ATTEMPTS = 3  # solves more where a fit exceeds what is known beyond its measurement
# λ at least, where smoothing alone carries a flank on over clipped samples. Of 0, 1e-4, 1e-3 and 1e-2, and of leaving
# these samples out where the mix is chosen, 1e-4 with all of them came nearest to what scripts/verdict/robustness.py
# clips.
_LEAST_OVER_CLIPPED = 1e-4
_FINE_SHARE = 0.5  # of the search's effort, once more for refining and smoothing at full size
FINE_STEPS, MOST_FINE_STEPS = 10, 40  # iterations at full size: fewer are not worth having, most


def search_named(name: str) -> Minimizer:
    """The search over one vector of projections by name: "gradient", "powell", or "nlopt-" and nlopt's algorithm."""
    if name == "gradient":
        return Gradient()
    if name == "powell":
        return OneAtATime()
    if name.startswith("nlopt-"):
        return Nlopt(name.removeprefix("nlopt-"))
    raise BadInput(where="search", found=repr(name), expected="gradient, powell, or nlopt-NAME such as nlopt-PRAXIS")


def candidates_of(isotropic: bool, settings: Search) -> tuple[tuple[str, ...], ...]:
    """Which kinds each texture may be: all that suit the material, one for all, or a list, one a texture."""
    if settings.projections is None:
        return (ISOTROPIC_CANDIDATES if isotropic else ANISOTROPIC_CANDIDATES,)
    return tuple((kind,) for kind in settings.projections)


def fit_search(samples: Samples, settings: Search, progress: ProgressCallback | None = None) -> MethodFit:
    """Factor `samples` (the training samples as measured, without azimuth copies) with `settings.effort`.

    `settings.budget` seconds end the search where the effort takes longer: a guard, after which the status is GUARD and
    the provenance says that the fit is not reproducible. The report's notes say what the user should know: textures
    that were not worth having, the guard, an interrupt. Raises BadInput where the samples cannot fill the folds.
    """
    return with_whole_texels(fit_shared((samples,), settings, progress)[0], samples, settings)


@one_thread
def fit_shared(
    several: Sequence[Samples], settings: Search, progress: ProgressCallback | None = None
) -> tuple[MethodFit, ...]:
    """Factor several materials with one set of projections and texture sizes: a fit of each, in their order.

    The projections are those that leave the least mean error of all (`methods.materials`); for these each material's
    λ and texels are its own. The effort is granted once for every material. Raises BadInput as `fit_search`, and where
    channels differ.
    """
    began = time.perf_counter()
    task = _Task.of(several, settings, began)
    search, fine = FitBudget(task.granted, task.deadline), FitBudget(_FINE_SHARE * task.granted, task.deadline)
    outcome = _searched(task, search, progress)
    outcome, shapes = _laid_out(task, outcome, search)
    outcome, mixes = _finish(task, outcome, shapes, fine)
    if outcome.status is Status.GUARD:
        note = f"the guard of {settings.budget:g} s ended the search: another run may end elsewhere"
        outcome = replace(outcome, notes=(*outcome.notes, note))
    effort = {"granted": task.granted, "search": search.spent, "fine": fine.spent}
    return tuple(_fit(task, number, mix, outcome, shapes, effort, began) for number, mix in enumerate(mixes))


@one_thread
def find_mixes(samples: Samples, settings: Search) -> SearchOutcome:
    """The search over mixes alone, on small textures: the best of one texture, of two, and so on. Raises BadInput."""
    task = _Task.of((samples,), settings, time.perf_counter())
    return _searched(task, FitBudget(task.granted, task.deadline), None)


def trials_of(samples: Samples, settings: Search) -> Trials:
    """What `find_mixes` tries mixes on, without a limit of work. Raises BadInput."""
    task = _Task.of((samples,), settings, time.perf_counter())
    return Trials(task.drawn, task.structure, FitBudget())


@dataclass(frozen=True)
class _Sizes:
    """Texels along a side of a texture, and of one in the search; `texels` of all textures where bytes are given."""

    side: int
    coarse: int
    texels: int | None

    @classmethod
    def of(cls, settings: Search, channels: int) -> "_Sizes":
        """The sizes that settings ask for. Raises BadInput for too few bytes."""
        if settings.bytes is None:
            return cls(settings.size, coarse_size(settings), None)
        texels = texels_in(settings.bytes, channels)
        coarse = min(settings.search_size or texels, max(2, math.isqrt(texels // 2)))
        return cls(max(2, math.isqrt(texels // settings.most_textures)), coarse, texels)


@dataclass(frozen=True)
class _Material:
    """One material: its samples as given, the share of outliers among them, and what is fitted to the others."""

    given: Samples
    outliers: float
    transform: LogTransform
    extrapolation: Extrapolation
    data: SearchData


@dataclass(frozen=True)
class _Task:
    """What is to be fitted, how large, and with how much work until which time."""

    settings: Search
    materials: tuple[_Material, ...]
    sizes: _Sizes
    candidates: tuple[tuple[str, ...], ...]
    granted: float
    deadline: float

    @classmethod
    def of(cls, several: Sequence[Samples], settings: Search, began: float) -> "_Task":
        """The task of fitting these materials, begun at that time. Raises BadInput as `fit_shared`."""
        _check_samples(several)
        sizes = _Sizes.of(settings, len(several[0].channels))
        candidates = candidates_of(all(samples.isotropic for samples in several), settings)
        materials = _prepared(several, settings, sizes, candidates)
        granted = len(several) * units(settings.effort, settings.most_textures)
        deadline = math.inf if settings.budget is None else began + settings.budget
        return cls(settings, materials, sizes, candidates, granted, deadline)

    @cached_property
    def full(self) -> Materials:
        """All samples of all materials."""
        return Materials(tuple(material.data.material for material in self.materials))

    @property
    def drawn(self) -> Materials:
        """The samples that the search sees."""
        return self.full.drawn(self.settings.search_samples, self.settings.seed)

    @property
    def structure(self) -> StructureSettings:
        """The settings of the search over mixes."""
        settings = self.settings
        descending = DESCENDING.get(str(settings.effort), 0)
        return StructureSettings(
            self.sizes.coarse,
            settings.reciprocal,
            settings.bound,
            settings.restarts,
            search_named(settings.search),
            settings.smoothing,
            settings.seed,
            known_mixes() if descending else NONE,
            descending,
            settings.bytes is not None,
        )

    @property
    def smoothing_for(self) -> SmoothingFor:
        """λ of other textures than the search's; more samples bear less smoothing."""
        drawn = len(self.materials) * self.settings.search_samples
        fewer = min(1.0, drawn / self.full.samples) if drawn > 0 else 1.0
        return SmoothingFor(self.sizes.coarse, fewer, self.settings.smoothing)


def _check_samples(several: Sequence[Samples]) -> None:
    """Raise BadInput for materials of different channels, and for too few samples."""
    channels = several[0].channels
    for number, samples in enumerate(several):
        if samples.channels != channels:
            own, expected = ", ".join(samples.channels), ", ".join(channels)
            raise BadInput(
                where=f"material {number}", found=f"the channels {own}", expected=f"{expected} as material 0 has"
            )
        if len(samples) < 2 * FOLDS:
            raise BadInput(where="samples", found=len(samples), expected=f"at least {2 * FOLDS} for a searched fit")


def _prepared(
    several: Sequence[Samples], settings: Search, sizes: _Sizes, candidates: tuple[tuple[str, ...], ...]
) -> tuple[_Material, ...]:
    """The materials without outliers, in logarithms. Raises BadInput where the fit exceeds the machine's memory."""
    trusted = [trusted_samples(samples, settings) for samples in several]
    textures = settings.most_textures
    searched = max(textures * sizes.coarse**2, len(candidates[0]) * (sizes.coarse // 2) ** 2)
    # A reciprocal texture has two lookups; a search holds the equations of every material.
    lookups = 2 * textures * sum(len(samples) for samples, _ in trusted)
    shapes = ((sizes.side, sizes.side),) * textures
    refuse_too_large(settings, shapes, lookups, searched * math.isqrt(len(several)))
    knows_azimuth = not all(is_isotropic(kind) for kinds in candidates for kind in kinds)
    materials = []
    for given, (samples, outliers) in zip(several, trusted, strict=True):
        transform, extrapolation = transform_of(samples, settings), Extrapolation(samples)
        data = SearchData.of(samples, transform, settings, knows_azimuth).with_more(
            extrapolation.carried_on(), transform
        )
        materials.append(_Material(given, outliers, transform, extrapolation, data))
    return tuple(materials)


def _searched(task: _Task, budget: FitBudget, progress: ProgressCallback | None) -> SearchOutcome:
    """The best mixes of the drawn samples on small textures."""
    search = StructureSearch(task.drawn, task.structure, budget, _reporting(progress, task.settings))
    return search.run(task.settings.most_textures, task.candidates)


def _reporting(progress: ProgressCallback | None, settings: Search) -> Callable[[int, int, float], None]:
    """What a structure search calls, handing on to `progress`."""

    def report(term: int, evaluations: int, best: float) -> None:
        if progress is not None:
            progress(FitProgress(term, settings.most_textures, 1, 1, evaluations, best))

    return report


def _laid_out(task: _Task, outcome: SearchOutcome, budget: FitBudget) -> tuple[SearchOutcome, tuple[Shape, ...]]:
    """The outcome with its textures' shapes; where bytes are given, with the mix that they are best spent on."""
    if task.sizes.texels is None:
        return outcome, tuple(texture_shape(projection, task.sizes.side) for projection in outcome.mix.projections)
    layouts = FitBudget(task.granted, task.deadline)
    spent = best_within(task.sizes.texels, outcome.levels, task.full, task.smoothing_for, layouts)
    budget.add(layouts)
    return replace(outcome, mix=spent.mix), spent.shapes


def _finish(
    task: _Task, outcome: SearchOutcome, shapes: tuple[Shape, ...], budget: FitBudget
) -> tuple[SearchOutcome, tuple[Mix, ...]]:
    """Searched projections refined on all samples, then every material's λ at full size: the mix with its own.

    As much of both as `budget` grants. Where textures are too large for dense systems, the search's λ is carried over.
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
    task: _Task, outcome: SearchOutcome, shapes: tuple[Shape, ...], smoothing: tuple[float, ...], budget: FitBudget
) -> SearchOutcome:
    """The outcome with its projections moved once more, on all samples.

    Where an evaluation at full size is too dear, with textures of the search's size.
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


def _fit(
    task: _Task,
    number: int,
    mix: Mix,
    outcome: SearchOutcome,
    shapes: tuple[Shape, ...],
    effort: dict[str, float],
    began: float,
) -> MethodFit:
    """The fit of one of the materials: its texels for the projections of `mix`, with its report."""
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
    material: _Material, mix: Mix, smoothing: tuple[float, ...], settings: Search, shapes: tuple[Shape, ...]
) -> tuple[Solved, tuple[Term, ...], dict[str, float] | None]:
    """(the linear solve, the terms, how the light was kept): solved again where they exceed what is known beyond."""
    data, transform, attempt = material.data, material.transform, 0
    while True:
        solved = solve_terms(data.judged, mix.projections, shapes, smoothing, settings.solver)
        terms, light = solved.terms, None
        if data.flux is not None:
            terms, light = keep_light(data.logs, terms, smoothing, data.flux, solved.factor)
        fit = Factorization(terms, transform, ("",) * len(transform.mean))
        more = None if attempt == _ATTEMPTS else material.extrapolation.exceeding(fit.evaluate, attempt)
        if more is None:
            return solved, terms, light
        data, attempt = data.with_more(more, transform), attempt + 1


def _dense(shapes: tuple[Shape, ...]) -> bool:
    """Whether textures of these shapes make a dense system."""
    return is_dense(sum(rows * columns for rows, columns in shapes))


def _smoothed(mix: Mix, material: Materials, shapes: tuple[Shape, ...], budget: FitBudget) -> Mix:
    """The mix with the best λ for one material at full size, from the mix's own on."""
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
    """Units of one evaluation of a mix on these materials with textures of these shapes."""
    texels = sum(rows * columns for rows, columns in shapes)
    return materials.cost(sum(projection.lookups for projection in mix.projections), texels)
