"""The searched fit: mix, projections, warp and λ found from the data within a time budget.

Coarse to fine. A `MixedSearch` on small textures and a subset of the samples chooses the mix; what is
left of the budget refines the searched projections jointly on all samples at full size; λ is chosen
again there by cross-validation; one masked solve gives the textures. Azimuth copies are made here, and
only where a chosen kind knows the azimuth: fixed and searched isotropic projections see the measured
samples alone.
"""

import time
from dataclasses import replace

import torch

from homofact.brdf.log_transform import LogTransform
from homofact.brdf.samples import Samples
from homofact.errors import BadInput, Report, Status
from homofact.factor.confidence import with_deviations
from homofact.factor.factorization import Factorization
from homofact.factor.objective import Objective
from homofact.factor.refine import refine_linear
from homofact.factor.search.best import Search as Minimizer
from homofact.factor.search.gradient import Gradient
from homofact.factor.search.nlopt import Nlopt
from homofact.factor.search.one_at_a_time import OneAtATime
from homofact.factor.textures import LogSamples, residual, solve_terms, texture_shape
from homofact.linear.threads import one_thread
from homofact.methods.fitting import (
    Fit,
    Progress,
    ProgressCallback,
    at_azimuths,
    coarse_size,
    provenance_of,
    transform_of,
)
from homofact.methods.kinds import ANISOTROPIC_CANDIDATES, ISOTROPIC_CANDIDATES, is_isotropic, is_searched
from homofact.methods.search import Search
from homofact.methods.structure_search import MixedSearch, MixSettings, Outcome
from homofact.methods.validation import Folded, Partition, deal

FOLDS = 4
BUDGET = 20.0  # seconds, where the settings give none
COARSE_SHARE = 0.6  # of the budget, for choosing the mix; the rest is for refining at full size


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
    """Factor `samples` (the training samples as measured, without azimuth copies) within its budget.

    The report's notes say what the user should know: textures that were not worth having, a budget that
    was too short, an interrupt. Raises BadInput where the samples cannot fill the folds.
    """
    began = time.perf_counter()
    if len(samples) < 2 * FOLDS:
        raise BadInput(f"samples: found {len(samples)}, expected at least {2 * FOLDS} for a searched fit")
    candidates = candidates_of(samples, settings)
    transform = transform_of(samples, settings)
    knows_azimuth = not all(is_isotropic(kind) for kinds in candidates for kind in kinds)
    full, partitions = _prepare(samples, transform, settings, knows_azimuth)
    coarse, coarse_partitions = full, partitions
    if 0 < settings.search_samples < full.logs.shape[0]:
        chosen = torch.randperm(full.logs.shape[0], generator=torch.Generator().manual_seed(settings.seed))
        chosen = chosen[: settings.search_samples].sort().values
        coarse, coarse_partitions = full.select(chosen), tuple(p.select(chosen) for p in partitions)
    search = search_named(settings.search)
    budget = BUDGET if settings.budget is None else settings.budget

    def tell(term: int, evaluations: int, best: float) -> None:
        if progress is not None:
            progress(Progress(term, settings.textures, 1, 1, evaluations, best))

    choices = MixSettings(
        coarse_size(settings),
        settings.reciprocal,
        settings.bound,
        settings.restarts,
        search,
        settings.smoothing,
        COARSE_SHARE * budget,
        settings.seed,
    )
    outcome = MixedSearch(coarse, coarse_partitions, choices, tell).run(settings.textures, candidates)
    outcome, smoothing = _finish(outcome, full, partitions, settings, search, began + budget)
    projections = outcome.mix.projections
    shapes = tuple(texture_shape(projection, settings.size) for projection in projections)
    solved = solve_terms(full, projections, shapes, smoothing, settings.solver, settings.robust)
    terms = solved.terms
    made = provenance_of(samples, settings) | {
        "smoothing": list(smoothing),
        "kinds": list(outcome.mix.kinds),
        "validation_error": outcome.mix.error,
    }
    notes = outcome.notes
    if settings.refine == "linear":
        terms, account = refine_linear(full, terms, smoothing, transform)
        made["refine"] = account
    if settings.confidence:
        terms = with_deviations(full, terms, smoothing)
    factorization = Factorization(terms, transform, samples.channels, made)
    return Fit(
        factorization,
        Report(
            Status.FALLBACK if solved.status is Status.FALLBACK else outcome.status,
            iterations=len(outcome.trace),
            evaluations=outcome.evaluations,
            seconds=time.perf_counter() - began,
            residual=float((residual(full, terms) ** 2).mean()),
            seed=settings.seed,
            trace=outcome.trace,
            notes=notes,
            details=made | solved.details(),
        ),
    )


def _prepare(
    samples: Samples, transform: LogTransform, settings: Search, knows_azimuth: bool
) -> tuple[LogSamples, tuple[Partition, ...]]:
    """Log samples and how they are judged; with azimuth copies, one fold to a measurement, where kinds need them."""
    partitions = deal(samples, FOLDS, settings.seed, rings=settings.validation == "rings")
    copied = at_azimuths(samples, settings, knows_azimuth)
    times = len(copied) // len(samples)
    return LogSamples.of(copied, transform), tuple(partition.repeated(times) for partition in partitions)


def _finish(
    outcome: Outcome,
    full: LogSamples,
    partitions: tuple[Partition, ...],
    settings: Search,
    search: Minimizer,
    deadline: float,
) -> tuple[Outcome, tuple[float, ...]]:
    """Searched projections refined on everything within what is left of the budget, then λ at full size."""
    mix = outcome.mix
    shapes = tuple(texture_shape(projection, settings.size) for projection in mix.projections)
    left = deadline - time.perf_counter()
    if any(map(is_searched, mix.kinds)) and left > 0 and outcome.status is not Status.INTERRUPTED:
        objective = Objective(full, mix.projections, shapes, mix.smoothing, settings.bound)
        vector, report = search.minimize(objective, objective.start(), seconds=left, seed=settings.seed)
        mix = replace(mix, projections=objective.projections(vector))
        outcome = replace(outcome, mix=mix, evaluations=outcome.evaluations + report.evaluations)
        if report.status is Status.INTERRUPTED:
            outcome = replace(outcome, status=Status.INTERRUPTED, notes=(*outcome.notes, "interrupted while refining"))
    if settings.smoothing is not None:
        return outcome, (settings.smoothing,) * len(mix.kinds)
    if time.perf_counter() > deadline:
        return outcome, mix.smoothing
    folded = Folded.of(full, partitions, mix.projections, shapes)
    smoothing, error = folded.best_each(mix.smoothing, stride=1, deadline=deadline)
    return replace(outcome, mix=replace(mix, smoothing=smoothing, error=error)), smoothing
