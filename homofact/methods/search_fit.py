"""The searched fit: mix, projections, warp and λ found from the data, the work counted and not timed.

Coarse to fine. A `StructureSearch` on small textures and a subset of the samples chooses the mix; then the searched
projections are refined jointly on all samples at full size, and λ is chosen again there by cross-validation, for an
effort of its own; one masked solve gives the textures. Azimuth copies are made here, and
only where a chosen kind knows the azimuth: fixed and searched isotropic projections see the measured
samples alone.
"""

import math
import time
from collections.abc import Sequence
from dataclasses import replace

from homofact.brdf.beyond import Beyond
from homofact.brdf.log_transform import LogTransform
from homofact.brdf.samples import Samples
from homofact.errors import BadInput, Report, Status
from homofact.factor.confidence import with_deviations
from homofact.factor.energy import keep_light
from homofact.factor.factorization import Factorization, Term
from homofact.factor.search.gradient import Gradient
from homofact.factor.search.minimize import Search as Minimizer
from homofact.factor.search.minimize import minimize
from homofact.factor.search.nlopt import Nlopt
from homofact.factor.search.one_at_a_time import OneAtATime
from homofact.factor.textures import Solved, residual, solve_terms, texture_shape
from homofact.linear.layout import Shape
from homofact.linear.size import is_dense
from homofact.linear.threads import one_thread
from homofact.methods.effort import Account, cost_of_solve, units
from homofact.methods.fitting import (
    Fit,
    Progress,
    ProgressCallback,
    coarse_size,
    provenance_of,
    transform_of,
    trusted_samples,
)
from homofact.methods.kinds import ANISOTROPIC_CANDIDATES, ISOTROPIC_CANDIDATES, is_isotropic, is_searched
from homofact.methods.log_data import FOLDS, Data
from homofact.methods.materials import Materials
from homofact.methods.memory import refuse_too_large
from homofact.methods.mix import Mix
from homofact.methods.search import Search
from homofact.methods.shapes import SmoothingFor, best_within, texels_in
from homofact.methods.structure_search import Outcome, StructureSearch
from homofact.methods.trials import StructureSettings, rounded

ATTEMPTS = 3  # solves more where a fit exceeds what is known beyond its measurement
# λ at least, where smoothing alone carries a flank on over clipped samples. Of 0, 1e-4, 1e-3 and 1e-2, and of leaving
# these samples out where the mix is chosen, 1e-4 with all of them came nearest to what scripts/robustness.py clips.
LEAST_OVER_CLIPPED = 1e-4
FINE_SHARE = 0.5  # of the search's effort, once more for refining and smoothing at full size
FINE_STEPS, MOST_FINE_STEPS = 10, 40  # iterations at full size: fewer are not worth having, most


def search_named(name: str) -> Minimizer:
    """The search over one vector of projections by name: "gradient", "powell", or "nlopt-" and nlopt's algorithm."""
    if name == "gradient":
        return Gradient()
    if name == "powell":
        return OneAtATime()
    if name.startswith("nlopt-"):
        return Nlopt(name.removeprefix("nlopt-"))
    raise BadInput(f"search: found {name!r}, expected gradient, powell, or nlopt-NAME such as nlopt-PRAXIS")


def candidates_of(isotropic: bool, settings: Search) -> tuple[tuple[str, ...], ...]:
    """Which kinds each texture may be: all that suit the material, one for all, or a list, one a texture."""
    if settings.projections is None:
        return (ISOTROPIC_CANDIDATES if isotropic else ANISOTROPIC_CANDIDATES,)
    return tuple((kind,) for kind in settings.projections)


def fit_search(samples: Samples, settings: Search, progress: ProgressCallback | None = None) -> Fit:
    """Factor `samples` (the training samples as measured, without azimuth copies) with `settings.effort`.

    `settings.budget` seconds end the search where the effort takes longer: a guard, after which the status is GUARD and
    the provenance says that the fit is not reproducible. The report's notes say what the user should know: textures
    that were not worth having, the guard, an interrupt. Raises BadInput where the samples cannot fill the folds.
    """
    return fit_shared((samples,), settings, progress)[0]


@one_thread
def fit_shared(
    several: Sequence[Samples], settings: Search, progress: ProgressCallback | None = None
) -> tuple[Fit, ...]:
    """Factor several materials with one set of projections and texture sizes: a fit of each, in their order.

    The projections are those that leave the least mean error of all (`methods.materials`); for these each material's
    λ and texels are its own. The effort is granted once for every material. Raises BadInput as `fit_search`, and where
    channels differ.
    """
    began = time.perf_counter()
    deadline = math.inf if settings.budget is None else began + settings.budget
    textures, count = settings.most_textures, len(several)
    granted = count * units(settings.effort, textures)
    channels = several[0].channels
    for number, samples in enumerate(several):
        if samples.channels != channels:
            found, expected = ", ".join(samples.channels), ", ".join(channels)
            raise BadInput(f"material {number}: found the channels {found}, expected {expected} as material 0 has")
        if len(samples) < 2 * FOLDS:
            raise BadInput(f"samples: found {len(samples)}, expected at least {2 * FOLDS} for a searched fit")
    texels = None if settings.bytes is None else texels_in(settings.bytes, len(channels))
    isotropic = all(samples.isotropic for samples in several)
    candidates = candidates_of(isotropic, settings)
    given, trusted = several, [trusted_samples(samples, settings) for samples in several]
    several = [samples for samples, _ in trusted]
    coarse_side = coarse_size(settings)
    if texels is not None:
        coarse_side = min(settings.search_size or texels, max(2, math.isqrt(texels // 2)))
    side = settings.size if texels is None else max(2, math.isqrt(texels // textures))
    searched = max(textures * coarse_side**2, len(candidates[0]) * (coarse_side // 2) ** 2)
    # A reciprocal texture has two lookups; a search holds the equations of every material.
    lookups = 2 * textures * sum(map(len, several))
    refuse_too_large(settings, ((side, side),) * textures, lookups, searched * math.isqrt(count))
    knows_azimuth = not all(is_isotropic(kind) for kinds in candidates for kind in kinds)
    transforms = [transform_of(samples, settings) for samples in several]
    beyond = [Beyond(samples) for samples in several]
    data = [
        Data.of(samples, transform, settings, knows_azimuth).with_more(own.carried_on(), transform)
        for samples, transform, own in zip(several, transforms, beyond, strict=True)
    ]
    full = Materials(tuple(each.material for each in data))
    coarse = full.drawn(settings.search_samples, settings.seed)
    search = search_named(settings.search)

    def tell(term: int, evaluations: int, best: float) -> None:
        if progress is not None:
            progress(Progress(term, textures, 1, 1, evaluations, best))

    choices = StructureSettings(
        coarse_side,
        settings.reciprocal,
        settings.bound,
        settings.restarts,
        search,
        settings.smoothing,
        settings.seed,
    )
    account = Account(granted, deadline)
    outcome = StructureSearch(coarse, choices, account, tell).run(textures, candidates)
    # More samples bear less smoothing.
    fewer = min(1.0, count * settings.search_samples / full.samples) if settings.search_samples > 0 else 1.0
    smoothing_for = SmoothingFor(coarse_side, fewer, settings.smoothing)
    fine = Account(FINE_SHARE * granted, deadline)
    if texels is None:
        shapes = tuple(texture_shape(projection, settings.size) for projection in outcome.mix.projections)
    else:
        layouts = Account(granted, deadline)
        spent = best_within(texels, outcome.levels, full, smoothing_for, layouts)
        account.add(layouts)
        outcome, shapes = replace(outcome, mix=spent.mix), spent.shapes
    outcome, mixes = _finish(outcome, full, settings, search, fine, shapes, smoothing_for)
    notes = outcome.notes
    if outcome.status is Status.GUARD:
        notes += (f"the guard of {settings.budget:g} s ended the search: another run may end elsewhere",)
    effort = {"granted": granted, "search": account.spent, "fine": fine.spent}
    fits = []
    for number, (own, mix) in enumerate(zip(data, mixes, strict=True)):
        transform, smoothing = transforms[number], mix.smoothing
        if own.logs.clipped is not None:
            smoothing = tuple(max(each, LEAST_OVER_CLIPPED) for each in smoothing)
        solved, terms, light = _solved(own, beyond[number], transform, mix, smoothing, settings, shapes)
        made = provenance_of(given[number], settings) | {
            "smoothing": list(smoothing),
            "kinds": list(mix.kinds),
            "shapes": [list(shape) for shape in shapes],
            "validation_error": mix.error,
            "effort": effort,
            "reproducible": outcome.status not in (Status.GUARD, Status.INTERRUPTED),
        }
        if count > 1:
            made["shared"] = {"materials": count, "number": number}
        if light is not None:
            made["light"] = light
        told = notes
        if solved.status is Status.BUDGET:
            told += (f"the textures' own system was left after {solved.steps} steps, short of its tolerance",)
        if settings.confidence:
            terms = with_deviations(own.measured, terms, smoothing)
        report = Report(
            Status.FALLBACK if solved.status is Status.FALLBACK else outcome.status,
            iterations=len(outcome.trace),
            evaluations=outcome.evaluations,
            seconds=time.perf_counter() - began,
            residual=float((residual(own.measured, terms) ** 2).mean()),
            seed=settings.seed,
            trace=outcome.trace,
            notes=told,
            details=made | solved.details() | {"outliers": trusted[number][1]},
        )
        fits.append(Fit(Factorization(terms, transform, channels, made), report))
    return tuple(fits)


def _solved(
    data: Data,
    beyond: Beyond,
    transform: LogTransform,
    mix: Mix,
    smoothing: tuple[float, ...],
    settings: Search,
    shapes: tuple[Shape, ...],
) -> tuple[Solved, tuple[Term, ...], dict[str, float] | None]:
    """(the linear solve, the terms, how the light was kept): solved again where they exceed what is known beyond."""
    attempt = 0
    while True:
        solved = solve_terms(data.judged, mix.projections, shapes, smoothing, settings.solver)
        terms, light = solved.terms, None
        if data.flux is not None:
            terms, light = keep_light(data.logs, terms, smoothing, data.flux)
        fit = Factorization(terms, transform, ("",) * len(transform.mean))
        more = None if attempt == ATTEMPTS else beyond.exceeding(fit.evaluate, attempt)
        if more is None:
            return solved, terms, light
        data, attempt = data.with_more(more, transform), attempt + 1


def _finish(
    outcome: Outcome,
    full: Materials,
    settings: Search,
    search: Minimizer,
    account: Account,
    shapes: tuple[Shape, ...],
    smoothing_for: SmoothingFor,
) -> tuple[Outcome, tuple[Mix, ...]]:
    """Searched projections refined on all samples, then every material's λ at full size: the mix with its own.

    As much of both as `account` grants. Where an evaluation at full size is too dear, projections are refined with
    textures of the search's size, and λ is chosen for all textures alike on one left-out fold; where textures are too
    large for dense systems, the search's λ is carried over.
    """
    mix, count = outcome.mix, len(full.each)
    if outcome.status in (Status.INTERRUPTED, Status.GUARD):
        return outcome, (mix,) * count
    smoothing = smoothing_for(mix, shapes)
    dense = is_dense(sum(rows * columns for rows, columns in shapes))
    if any(map(is_searched, mix.kinds)):
        coarse = tuple(texture_shape(projection, smoothing_for.coarse) for projection in mix.projections)
        cost = _cost(full, mix, shapes)
        steps, own, used = int(0.5 * account.left / cost), smoothing, shapes
        if steps < FINE_STEPS or not dense:
            cost = _cost(full, mix, coarse)
            steps, own, used = int(0.5 * account.left / cost), mix.smoothing, coarse
        objective = full.objective(mix.projections, used, own, settings.bound)
        left = max(account.deadline - time.perf_counter(), 1e-3)
        limited = search.limited(min(max(steps, 1), MOST_FINE_STEPS))
        vector, report = minimize(limited, objective, objective.start(), seconds=left, seed=settings.seed)
        mix = replace(mix, projections=objective.projections(rounded(vector)))
        account.spend(report.evaluations * cost, report.evaluations)
        if report.status in (Status.INTERRUPTED, Status.GUARD):
            notes = ("interrupted while refining",) if report.status is Status.INTERRUPTED else ()
            outcome = replace(outcome, mix=mix, status=report.status, notes=(*outcome.notes, *notes))
            return outcome, (replace(mix, smoothing=smoothing),) * count
    mixes = [replace(mix, smoothing=smoothing)] * count
    if settings.smoothing is None and dense:
        for number, material in enumerate(full.each):
            # What is left is shared evenly by those to come.
            own = Account(account.left / (count - number), account.deadline)
            mixes[number] = _smoothed(mixes[number], Materials((material,)), shapes, own)
            account.add(own)
    status = Status.GUARD if account.late else outcome.status
    evaluations = outcome.evaluations + account.evaluations
    error = sum(each.error for each in mixes) / count
    return replace(outcome, mix=replace(mix, error=error), status=status, evaluations=evaluations), tuple(mixes)


def _smoothed(mix: Mix, material: Materials, shapes: tuple[Shape, ...], account: Account) -> Mix:
    """The mix with the best λ for one material at full size, from the mix's own on."""
    texels = sum(rows * columns for rows, columns in shapes)
    partitions = material.each[0].partitions
    # Every λ is asked about at least twice: with all folds where that can be paid for, else with one.
    solves = 2 * len(mix.smoothing) * sum(int(partition.folds.max()) + 1 for partition in partitions)
    folds = None if solves * cost_of_solve(texels) < account.left else 1
    folded = material.folded(mix.projections, shapes, folds)
    account.spend(_cost(material, mix, shapes))
    smoothing, error = folded.best_smoothing(mix.smoothing, account, 1)
    if folds is None:
        smoothing, error = folded.best_each(smoothing, account, 1)
    return replace(mix, smoothing=smoothing, error=error)


def _cost(materials: Materials, mix: Mix, shapes: tuple[Shape, ...]) -> float:
    """Units of one evaluation of a mix on these materials with textures of these shapes."""
    texels = sum(rows * columns for rows, columns in shapes)
    return materials.cost(sum(projection.lookups for projection in mix.projections), texels)
