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
from homofact.factor.refine import refine_looks
from homofact.factor.search.best import Search
from homofact.factor.search.gradient import Gradient
from homofact.factor.search.nlopt import Nlopt
from homofact.factor.search.one_at_a_time import OneAtATime
from homofact.factor.textures import LogSamples, residual, solve_terms, texture_shape
from homofact.linear.threads import one_thread
from homofact.methods.cole_fit import Fit, Progress, ProgressCallback, provenance_of, transform_of
from homofact.methods.kinds import (
    ANISOTROPIC_CANDIDATES,
    ISOTROPIC_CANDIDATES,
    coordinates_of,
    is_isotropic,
    is_searched,
)
from homofact.methods.settings import FitSettings
from homofact.methods.structure_search import MixedSearch, MixSettings, Outcome
from homofact.methods.validation import Folded, Partition, deal

FOLDS = 4
COARSE_SIZE = 16  # measured data judged on 12² textures picks other mixes than on 16²
COARSE_SHARE = 0.6  # of the budget, for choosing the mix; the rest is for refining at full size


def search_named(name: str) -> Search:
    """The search over one vector of projections by name: "gradient", "powell", or "nlopt-" and nlopt's algorithm."""
    if name == "gradient":
        return Gradient()
    if name == "powell":
        return OneAtATime()
    if name.startswith("nlopt-"):
        return Nlopt(name.removeprefix("nlopt-"))
    raise BadInput(f"search: found {name!r}, expected gradient, powell, or nlopt-NAME such as nlopt-PRAXIS")


def pinned_kinds(settings: FitSettings) -> tuple[str, ...] | None:
    """The kinds that `settings.parameterization` names: one for all textures, or one each; None where it has none.

    Raises BadInput for an unknown kind, and for a list of another length than there are textures.
    """
    if settings.parameterization is None:
        return None
    pinned = tuple(settings.parameterization.split("+"))
    for kind in pinned:
        coordinates_of(kind)
    if len(pinned) not in (1, settings.textures):
        raise BadInput(
            f"parameterization: found {len(pinned)} kinds for {settings.textures} textures, expected one, or one each"
        )
    return pinned


def candidates_of(samples: Samples, settings: FitSettings) -> tuple[tuple[str, ...], ...]:
    """Which kinds each texture may be: all that suit the material, one for all, or a list, one a texture."""
    pinned = pinned_kinds(settings)
    if pinned is None:
        return (ISOTROPIC_CANDIDATES if samples.isotropic else ANISOTROPIC_CANDIDATES,)
    return tuple((kind,) for kind in pinned)


@one_thread
def fit_search(samples: Samples, settings: FitSettings, progress: ProgressCallback | None = None) -> Fit:
    """Factor `samples` (the training samples as measured, without azimuth copies) within `settings.budget` seconds.

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

    def tell(term: int, evaluations: int, best: float) -> None:
        if progress is not None:
            progress(Progress(term, settings.textures, 1, 1, evaluations, best))

    choices = MixSettings(
        settings.coarse_size(COARSE_SIZE),
        settings.reciprocal,
        settings.bound,
        settings.restarts,
        search,
        settings.smoothing,
        COARSE_SHARE * settings.budget,
        settings.seed,
    )
    outcome = MixedSearch(coarse, coarse_partitions, choices, tell).run(settings.textures, candidates)
    outcome, smoothing = _finish(outcome, full, partitions, settings, search, began)
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
    if settings.refine == "looks":
        terms, account = refine_looks(full, terms, smoothing, transform)
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
    samples: Samples, transform: LogTransform, settings: FitSettings, knows_azimuth: bool
) -> tuple[LogSamples, tuple[Partition, ...]]:
    """Log samples and how they are judged; with azimuth copies, one fold to a measurement, where kinds need them."""
    partitions = deal(samples, FOLDS, settings.seed, rings=settings.validation == "rings")
    copied = at_azimuths(samples, settings, knows_azimuth)
    times = len(copied) // len(samples)
    return LogSamples.of(copied, transform), tuple(partition.repeated(times) for partition in partitions)


def at_azimuths(samples: Samples, settings: FitSettings, knows_azimuth: bool) -> Samples:
    """What textures are solved from: azimuth copies of isotropic samples where a projection knows the azimuth."""
    if knows_azimuth and samples.isotropic and settings.copies > 1:
        return samples.azimuth_copies(settings.copies, settings.seed, settings.mirrored)
    return samples


def _finish(
    outcome: Outcome,
    full: LogSamples,
    partitions: tuple[Partition, ...],
    settings: FitSettings,
    search: Search,
    began: float,
) -> tuple[Outcome, tuple[float, ...]]:
    """Searched projections refined on everything within what is left of the budget, then λ at full size."""
    mix = outcome.mix
    shapes = tuple(texture_shape(projection, settings.size) for projection in mix.projections)
    left = settings.budget - (time.perf_counter() - began)
    if any(map(is_searched, mix.kinds)) and left > 0 and outcome.status is not Status.INTERRUPTED:
        objective = Objective(full, mix.projections, shapes, mix.smoothing, settings.bound)
        vector, report = search.minimize(objective, objective.start(), seconds=left, seed=settings.seed)
        mix = replace(mix, projections=objective.projections(vector))
        outcome = replace(outcome, mix=mix, evaluations=outcome.evaluations + report.evaluations)
        if report.status is Status.INTERRUPTED:
            outcome = replace(outcome, status=Status.INTERRUPTED, notes=(*outcome.notes, "interrupted while refining"))
    if settings.smoothing is not None:
        return outcome, (settings.smoothing,) * len(mix.kinds)
    deadline = began + settings.budget
    if time.perf_counter() > deadline:
        return outcome, mix.smoothing
    folded = Folded.of(full, partitions, mix.projections, shapes)
    smoothing, error = folded.best_each(mix.smoothing, stride=1, deadline=deadline)
    return replace(outcome, mix=replace(mix, smoothing=smoothing, error=error)), smoothing
