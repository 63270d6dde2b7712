"""The searched fit: mix, projections, warp and λ found from the data, the work counted and not timed.

Coarse to fine. A `StructureSearch` on small textures and a subset of the samples chooses the mix; then the searched
projections are refined jointly on all samples at full size, and λ is chosen again there by cross-validation, for an
effort of its own; one masked solve gives the textures. Azimuth copies are made here, and
only where a chosen kind knows the azimuth: fixed and searched isotropic projections see the measured
samples alone.
"""

import math
import time
from dataclasses import dataclass, replace

import torch

from homofact.brdf.beyond import Beyond
from homofact.brdf.log_transform import LogTransform
from homofact.brdf.samples import Samples
from homofact.errors import BadInput, Report, Status
from homofact.factor.confidence import with_deviations
from homofact.factor.energy import Flux, keep_light
from homofact.factor.factorization import Factorization, Term
from homofact.factor.objective import Objective
from homofact.factor.search.gradient import Gradient
from homofact.factor.search.minimize import Search as Minimizer
from homofact.factor.search.minimize import minimize
from homofact.factor.search.nlopt import Nlopt
from homofact.factor.search.one_at_a_time import OneAtATime
from homofact.factor.textures import LogSamples, Solved, residual, solve_terms, texture_shape
from homofact.linear.layout import Shape
from homofact.linear.size import is_dense
from homofact.linear.threads import one_thread
from homofact.methods.effort import Account, cost_of_evaluation, cost_of_solve, units
from homofact.methods.fitting import (
    Fit,
    Progress,
    ProgressCallback,
    at_azimuths,
    coarse_size,
    provenance_of,
    transform_of,
    trusted_samples,
)
from homofact.methods.folded import Folded
from homofact.methods.kinds import ANISOTROPIC_CANDIDATES, ISOTROPIC_CANDIDATES, is_isotropic, is_searched
from homofact.methods.memory import refuse_too_large
from homofact.methods.mix import Mix
from homofact.methods.search import Search
from homofact.methods.shapes import SmoothingFor, best_within, texels_in
from homofact.methods.structure_search import Outcome, StructureSearch
from homofact.methods.trials import StructureSettings, rounded
from homofact.methods.validation import BEYOND, Partition, partitions_of

FOLDS = 4
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


def candidates_of(samples: Samples, settings: Search) -> tuple[tuple[str, ...], ...]:
    """Which kinds each texture may be: all that suit the material, one for all, or a list, one a texture."""
    if settings.projections is None:
        return (ISOTROPIC_CANDIDATES if samples.isotropic else ANISOTROPIC_CANDIDATES,)
    return tuple((kind,) for kind in settings.projections)


@one_thread
def fit_search(samples: Samples, settings: Search, progress: ProgressCallback | None = None) -> Fit:
    """Factor `samples` (the training samples as measured, without azimuth copies) with `settings.effort`.

    `settings.budget` seconds end the search where the effort takes longer: a guard, after which the status is GUARD and
    the provenance says that the fit is not reproducible. The report's notes say what the user should know: textures
    that were not worth having, the guard, an interrupt. Raises BadInput where the samples cannot fill the folds.
    """
    began = time.perf_counter()
    deadline = math.inf if settings.budget is None else began + settings.budget
    textures = settings.most_textures
    granted = units(settings.effort, textures)
    texels = None if settings.bytes is None else texels_in(settings.bytes, samples.values.shape[1])
    if len(samples) < 2 * FOLDS:
        raise BadInput(f"samples: found {len(samples)}, expected at least {2 * FOLDS} for a searched fit")
    candidates = candidates_of(samples, settings)
    given, (samples, taken) = samples, trusted_samples(samples, settings)
    coarse_side = coarse_size(settings)
    if texels is not None:
        coarse_side = min(settings.search_size or texels, max(2, math.isqrt(texels // 2)))
    side = settings.size if texels is None else max(2, math.isqrt(texels // textures))
    searched = max(textures * coarse_side**2, len(candidates[0]) * (coarse_side // 2) ** 2)
    # A reciprocal texture has two lookups.
    refuse_too_large(settings, ((side, side),) * textures, 2 * textures * len(samples), searched)
    transform = transform_of(samples, settings)
    knows_azimuth = not all(is_isotropic(kind) for kinds in candidates for kind in kinds)
    beyond = Beyond(samples)
    data = Data.of(samples, transform, settings, knows_azimuth).with_more(beyond.carried_on(), transform)
    judged, partitions = data.judged, data.partitions
    coarse, coarse_partitions = judged, partitions
    if 0 < settings.search_samples < len(judged.logs):
        chosen = torch.randperm(len(judged.logs), generator=torch.Generator().manual_seed(settings.seed))
        chosen = chosen[: settings.search_samples].sort().values
        coarse, coarse_partitions = judged.select(chosen), tuple(p.select(chosen) for p in partitions)
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
    outcome = StructureSearch(coarse, coarse_partitions, choices, account, tell).run(textures, candidates)
    # More samples bear less smoothing.
    fewer = min(1.0, settings.search_samples / len(judged.logs)) if settings.search_samples > 0 else 1.0
    smoothing_for = SmoothingFor(coarse_side, fewer, settings.smoothing)
    fine = Account(FINE_SHARE * granted, deadline)
    if texels is None:
        shapes = tuple(texture_shape(projection, settings.size) for projection in outcome.mix.projections)
    else:
        layouts = Account(granted, deadline)
        spent = best_within(texels, outcome.levels, judged, partitions, smoothing_for, layouts)
        account.add(layouts)
        outcome, shapes = replace(outcome, mix=spent.mix), spent.shapes
    outcome, smoothing = _finish(outcome, judged, partitions, settings, search, fine, shapes, smoothing_for)
    if data.logs.clipped is not None:
        smoothing = tuple(max(each, LEAST_OVER_CLIPPED) for each in smoothing)
    solved, terms, light = _solved(data, beyond, transform, outcome.mix, smoothing, settings, shapes)
    made = provenance_of(given, settings) | {
        "smoothing": list(smoothing),
        "kinds": list(outcome.mix.kinds),
        "shapes": [list(shape) for shape in shapes],
        "validation_error": outcome.mix.error,
        "effort": {"granted": granted, "search": account.spent, "fine": fine.spent},
        "reproducible": outcome.status not in (Status.GUARD, Status.INTERRUPTED),
    }
    notes = outcome.notes
    if outcome.status is Status.GUARD:
        notes += (f"the guard of {settings.budget:g} s ended the search: another run may end elsewhere",)
    if solved.status is Status.BUDGET:
        notes += (f"the textures' own system was left after {solved.steps} steps, short of its tolerance",)
    if light is not None:
        made["light"] = light
    if settings.confidence:
        terms = with_deviations(data.measured, terms, smoothing)
    factorization = Factorization(terms, transform, samples.channels, made)
    return Fit(
        factorization,
        Report(
            Status.FALLBACK if solved.status is Status.FALLBACK else outcome.status,
            iterations=len(outcome.trace),
            evaluations=outcome.evaluations,
            seconds=time.perf_counter() - began,
            residual=float((residual(data.measured, terms) ** 2).mean()),
            seed=settings.seed,
            trace=outcome.trace,
            notes=notes,
            details=made | solved.details() | {"outliers": taken},
        ),
    )


@dataclass(frozen=True)
class Data:
    """What a fit sees: log samples with their own weights, their flux (None where logs alone count), and how to judge.

    Copies of one measurement are in one fold. What lies beyond the measurement comes last, carries no flux and is never
    left out.
    """

    logs: LogSamples
    flux: Flux | None
    partitions: tuple[Partition, ...]

    @classmethod
    def of(cls, samples: Samples, transform: LogTransform, settings: Search, knows_azimuth: bool) -> "Data":
        """The data of `samples`, with azimuth copies where kinds need them."""
        partitions = partitions_of(samples, FOLDS, settings.seed, rings=settings.validation == "rings")
        copied = at_azimuths(samples, settings, knows_azimuth)
        times = len(copied) // len(samples)
        flux = None if settings.objective == "log" else Flux.of(copied, transform, settings.objective)
        logs = LogSamples.of(copied, transform)
        if flux is not None:
            # The log squares beside the flux are those of the pairs as drawn: lobes and discs alike.
            logs = replace(logs, weights=copied.weights)
        return cls(logs, flux, tuple(partition.repeated(times) for partition in partitions))

    def with_more(self, more: Samples | None, transform: LogTransform) -> "Data":
        """With samples from beyond the measurement."""
        if more is None:
            return self
        flux = None if self.flux is None else self.flux.with_none(len(more))
        partitions = tuple(each.with_more(len(more)) for each in self.partitions)
        return Data(self.logs.with_more(LogSamples.of(more, transform)), flux, partitions)

    @property
    def judged(self) -> LogSamples:
        """The log samples with the weights that stand for the objective near the data."""
        return self.logs if self.flux is None else replace(self.logs, weights=self.flux.weights_of(self.logs))

    @property
    def measured(self) -> LogSamples:
        """Without what lies beyond the measurement."""
        return self.logs.select((self.partitions[0].folds != BEYOND).nonzero()[:, 0])


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
    full: LogSamples,
    partitions: tuple[Partition, ...],
    settings: Search,
    search: Minimizer,
    account: Account,
    shapes: tuple[Shape, ...],
    smoothing_for: SmoothingFor,
) -> tuple[Outcome, tuple[float, ...]]:
    """Searched projections refined on all samples, then λ at full size; as much of both as `account` grants.

    Where an evaluation at full size is too dear, projections are refined with textures of the search's size, and λ is
    chosen for all textures alike on one left-out fold; where textures are too large for dense systems, the search's λ
    is carried over.
    """
    mix = outcome.mix
    if outcome.status in (Status.INTERRUPTED, Status.GUARD):
        return outcome, mix.smoothing
    smoothing = smoothing_for(mix, shapes)
    dense = is_dense(sum(rows * columns for rows, columns in shapes))
    if any(map(is_searched, mix.kinds)):
        coarse = tuple(texture_shape(projection, smoothing_for.coarse) for projection in mix.projections)
        cost = _cost(full, mix, shapes)
        steps, own, used = int(0.5 * account.left / cost), smoothing, shapes
        if steps < FINE_STEPS or not dense:
            cost = _cost(full, mix, coarse)
            steps, own, used = int(0.5 * account.left / cost), mix.smoothing, coarse
        objective = Objective(full, mix.projections, used, own, settings.bound)
        left = max(account.deadline - time.perf_counter(), 1e-3)
        limited = search.limited(min(max(steps, 1), MOST_FINE_STEPS))
        vector, report = minimize(limited, objective, objective.start(), seconds=left, seed=settings.seed)
        mix = replace(mix, projections=objective.projections(rounded(vector)))
        account.spend(report.evaluations * cost, report.evaluations)
        if report.status in (Status.INTERRUPTED, Status.GUARD):
            notes = ("interrupted while refining",) if report.status is Status.INTERRUPTED else ()
            return replace(outcome, mix=mix, status=report.status, notes=(*outcome.notes, *notes)), smoothing
    if settings.smoothing is None and dense:
        texels = sum(rows * columns for rows, columns in shapes)
        # Every λ is asked about at least twice: with all folds where that can be paid for, else with one.
        solves = 2 * len(smoothing) * sum(int(partition.folds.max()) + 1 for partition in partitions)
        folds = None if solves * cost_of_solve(texels) < account.left else 1
        folded = Folded.of(full, partitions, mix.projections, shapes, folds)
        account.spend(_cost(full, mix, shapes))
        smoothing, error = folded.best_smoothing(smoothing, account, 1)
        if folds is None:
            smoothing, error = folded.best_each(smoothing, account, 1)
        mix = replace(mix, smoothing=smoothing, error=error)
    status = Status.GUARD if account.late else outcome.status
    return replace(outcome, mix=mix, status=status, evaluations=outcome.evaluations + account.evaluations), smoothing


def _cost(samples: LogSamples, mix: Mix, shapes: tuple[Shape, ...]) -> float:
    """Units of one evaluation of a mix on these samples with textures of these shapes."""
    texels = sum(rows * columns for rows, columns in shapes)
    return cost_of_evaluation(len(samples.logs), sum(projection.lookups for projection in mix.projections), texels)
