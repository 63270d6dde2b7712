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
from torch import Tensor

from homofact.brdf.samples import Samples
from homofact.errors import BadInput, Report, Status
from homofact.factor.factorization import Factorization
from homofact.factor.fit import Fit, Progress, ProgressCallback, provenance_of, transform_of
from homofact.factor.homomorphism import LogTransform
from homofact.factor.kinds import (
    ANISOTROPIC_CANDIDATES,
    ISOTROPIC_CANDIDATES,
    coordinates_of,
    is_isotropic,
    is_searched,
)
from homofact.factor.objective import Objective
from homofact.factor.refine import refine_looks
from homofact.factor.search.best import Search
from homofact.factor.search.gradient import Gradient
from homofact.factor.search.mixed import MixedSearch, MixSettings, Outcome
from homofact.factor.search.nlopt import Nlopt
from homofact.factor.settings import FitSettings
from homofact.factor.textures import LogSamples, residual, solve_terms, texture_shape
from homofact.factor.validation import Folded, deal_folds
from homofact.linear.threads import one_thread

FOLDS = 4
COARSE_SIZE = 16  # measured data judged on 12² textures picks other mixes than on 16²
COARSE_SHARE = 0.6  # of the budget, for choosing the mix; the rest is for refining at full size


def search_named(name: str) -> Search:
    """The search over one vector of projections by name: "gradient", or "nlopt-" and an algorithm of nlopt."""
    if name == "gradient":
        return Gradient()
    if name.startswith("nlopt-"):
        return Nlopt(name.removeprefix("nlopt-"))
    raise BadInput(f"search: found {name!r}, expected gradient, or nlopt-NAME such as nlopt-PRAXIS")


def candidates_of(samples: Samples, settings: FitSettings) -> tuple[tuple[str, ...], ...]:
    """Which kinds each texture may be: all that suit the material, one for all, or a list, one a texture."""
    if settings.parameterization is None:
        return (ISOTROPIC_CANDIDATES if samples.isotropic else ANISOTROPIC_CANDIDATES,)
    pinned = settings.parameterization.split("+")
    for kind in pinned:
        coordinates_of(kind)
    if len(pinned) == 1:
        return ((pinned[0],),)
    if len(pinned) != settings.textures:
        raise BadInput(
            f"parameterization: found {len(pinned)} kinds for {settings.textures} textures, expected one, or one each"
        )
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
    full, folds = _prepare(samples, transform, settings, knows_azimuth)
    coarse, coarse_folds = full, folds
    if 0 < settings.search_samples < full.logs.shape[0]:
        chosen = torch.randperm(full.logs.shape[0], generator=torch.Generator().manual_seed(settings.seed))
        chosen = chosen[: settings.search_samples].sort().values
        coarse, coarse_folds = full.select(chosen), folds[chosen]
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
    outcome = MixedSearch(coarse, coarse_folds, choices, tell).run(settings.textures, candidates)
    outcome, smoothing = _finish(outcome, full, folds, settings, search, began)
    projections = outcome.mix.projections
    shapes = tuple(texture_shape(projection, settings.size) for projection in projections)
    terms, solved = solve_terms(full, projections, shapes, smoothing, settings.solver)
    made = provenance_of(samples, settings) | {
        "smoothing": smoothing,
        "kinds": list(outcome.mix.kinds),
        "validation_error": outcome.mix.error,
    }
    notes = outcome.notes
    if settings.refine == "looks":
        terms, account = refine_looks(full, terms, smoothing, transform)
        made["refine"] = account
    factorization = Factorization(terms, transform, samples.channels, made)
    return Fit(
        factorization,
        Report(
            Status.FALLBACK if solved is Status.FALLBACK else outcome.status,
            iterations=len(outcome.trace),
            evaluations=outcome.evaluations,
            seconds=time.perf_counter() - began,
            residual=float((residual(full, terms) ** 2).mean()),
            seed=settings.seed,
            trace=outcome.trace,
            notes=notes,
            details=made,
        ),
    )


def _prepare(
    samples: Samples, transform: LogTransform, settings: FitSettings, knows_azimuth: bool
) -> tuple[LogSamples, Tensor]:
    """Log samples and their folds; with azimuth copies, all of one measurement in one fold, where kinds need them."""
    folds = deal_folds(len(samples), FOLDS, settings.seed)
    if knows_azimuth and samples.isotropic and settings.copies > 1:
        copied = samples.azimuth_copies(settings.copies, settings.seed, settings.mirrored)
        return LogSamples.of(copied, transform), folds.repeat(len(copied) // len(samples))
    return LogSamples.of(samples, transform), folds


def _finish(
    outcome: Outcome, full: LogSamples, folds: Tensor, settings: FitSettings, search: Search, began: float
) -> tuple[Outcome, float]:
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
        return outcome, settings.smoothing
    folded = Folded.of(full, folds, mix.projections, shapes)
    smoothing, error = folded.best_smoothing(mix.smoothing)
    return replace(outcome, mix=replace(mix, smoothing=smoothing, error=error)), smoothing
