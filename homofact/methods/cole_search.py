"""The thesis's search: projections term by term, each from random rotations by Powell's method (2.2, 3).

The search for a term does not depend on later terms, and fits with different texture sizes can share one search size. A
chart over numbers of textures and sizes would therefore repeat the same searches. The module caches the searches of the
last few fits with the state of the random generator, and a fit that starts with the same terms continues from there.
The result is bit-identical to a fit without the cache. The reported time includes that of the cached search.
"""

import hashlib
import time
from collections import OrderedDict
from dataclasses import dataclass, replace

import torch

from homofact.errors import BadInput, Report, Status
from homofact.factor.factorization import Term
from homofact.factor.projection import Projection
from homofact.factor.search.minimize import DeadlineReached
from homofact.factor.search.powell import Powell
from homofact.factor.textures import LogSamples, inner_problem, residual, solve_terms, texture_shape
from homofact.geometry.rotation import Rotation
from homofact.linear.size import is_dense
from homofact.linear.solvers import solve
from homofact.methods.cole import Cole
from homofact.methods.common import coarse_size
from homofact.methods.fitting import FitProgress, ProgressCallback

_MOST_KEPT = 8  # searches, of a few kilobytes each
# What a search does not depend on: these settings are of what is made of its projections.
_AFTER = ("textures", "size", "search_size", "search_samples", "copies", "mirrored", "robust", "confidence", "quantize")


@dataclass(frozen=True)
class SearchedTerms:
    """The projections, a report of every restart, whether an interrupt ended the search, and the cached time."""

    projections: tuple[Projection, ...]
    reports: tuple[Report, ...]
    interrupted: bool
    seconds_before: float


@dataclass(frozen=True)
class _Step:
    """The state of a search after a term: results so far, the generator's state, and the seconds so far."""

    chosen: tuple[Projection, ...] = ()
    terms: tuple[Term, ...] = ()
    reports: tuple[Report, ...] = ()
    state: torch.Tensor | None = None
    seconds: float = 0.0


_kept: OrderedDict[str, list[_Step]] = OrderedDict()


def search_terms(
    samples: LogSamples, settings: Cole, deadline: float, progress: ProgressCallback | None
) -> SearchedTerms:
    """Search one projection after another, on the coarse samples with textures of the search's size.

    An interrupt ends the search with the terms found so far; before the first term, it is raised. The `deadline` (on
    the clock of time.perf_counter) can end the search within a term.
    """
    size = coarse_size(settings)
    steps = _steps_of(samples, settings)
    step = steps[min(settings.textures, len(steps)) - 1] if steps else _Step()
    before = step.seconds
    generator = torch.Generator().manual_seed(settings.seed)
    if step.state is not None:
        generator.set_state(step.state)
    try:
        for number in range(len(step.chosen) + 1, settings.textures + 1):
            began = time.perf_counter()
            joint = number if settings.joint_terms == 0 else settings.joint_terms
            begin = max(0, number - joint)
            rest = replace(samples, logs=residual(samples, step.terms[:begin]))
            earlier = step.chosen[begin:]
            best, restarts = _search_term(rest, earlier, size, settings, generator, number, deadline, progress)
            chosen = (*step.chosen, best)
            shapes = tuple(texture_shape(p, size) for p in chosen[begin:])
            solved = solve_terms(rest, chosen[begin:], shapes, settings.smoothing, settings.solver)
            seconds = step.seconds + time.perf_counter() - began
            terms = (*step.terms[:begin], *solved.terms)
            step = _Step(chosen, terms, (*step.reports, *restarts), generator.get_state(), seconds)
            if time.perf_counter() > deadline:
                break
            # Another thread may be at the same search.
            if len(steps) == number - 1:
                steps.append(step)
    except KeyboardInterrupt:
        if not step.chosen:
            raise
        return SearchedTerms(step.chosen, step.reports, True, before)
    return SearchedTerms(step.chosen, step.reports, False, before)


def search_key(settings: Cole) -> str:
    """Return a key of the settings that affect a search; fits with the same samples and key share their searches."""
    own = {name: value for name, value in vars(settings).items() if name not in _AFTER}
    return repr((sorted(own.items()), coarse_size(settings)))


def _steps_of(samples: LogSamples, settings: Cole) -> list[_Step]:
    """Return the cached steps of this search as a list to extend; without a cache if the time is limited."""
    if settings.budget is not None:
        return []
    digest = hashlib.sha256(search_key(settings).encode())
    for tensor in (samples.wi, samples.wo, samples.logs, samples.weights):
        digest.update(tensor.cpu().numpy().tobytes())
    if samples.clipped is not None:
        digest.update(samples.clipped.cpu().numpy().tobytes())
    key = digest.hexdigest()
    steps = _kept.setdefault(key, [])
    _kept.move_to_end(key)
    while len(_kept) > _MOST_KEPT:
        _kept.popitem(last=False)
    return steps


def _search_term(
    samples: LogSamples,
    earlier: tuple[Projection, ...],
    size: int,
    settings: Cole,
    generator: torch.Generator,
    number: int,
    deadline: float,
    progress: ProgressCallback | None,
) -> tuple[Projection, list[Report]]:
    """Return the best projection of one more term over all restarts or until `deadline`; re-solve `earlier` terms."""

    def projection(rotation: Rotation) -> Projection:
        return Projection.from_rotation(settings.coordinates, rotation, settings.reciprocal, bound=settings.bound)

    evaluations, lowest = 0, float("inf")
    restart = 0
    best: Rotation | None = None

    def error(rotation: Rotation) -> float:
        nonlocal evaluations, lowest, best
        projections = (*earlier, projection(rotation))
        shapes = tuple(texture_shape(p, size) for p in projections)
        problem = inner_problem(samples, projections, shapes, settings.smoothing)
        texels = solve(problem, settings.solver).texels
        # From the equations where they have been accumulated, instead of by another pass over the samples.
        value = problem.data.error(texels) if is_dense(problem.unknowns) else problem.mean_error(texels)
        evaluations += 1
        if value < lowest:
            lowest, best = value, rotation
        if progress is not None:
            progress(FitProgress(number, settings.textures, restart, settings.restarts, evaluations, lowest))
        if time.perf_counter() > deadline:
            raise DeadlineReached
        return value

    began = time.perf_counter()
    reports: list[Report] = []
    try:
        for restart in range(1, settings.restarts + 1):  # noqa: B007 (the error function reports it)
            reports.append(Powell().minimize(error, Rotation.random(generator), settings.seed)[1])
    except DeadlineReached:
        counted = evaluations - sum(report.evaluations for report in reports)
        reports.append(Report(Status.GUARD, 0, counted, time.perf_counter() - began, lowest, settings.seed))
    if best is None:
        raise BadInput("no projection has a finite error", where="samples", expected="finite samples")
    return projection(best), reports
