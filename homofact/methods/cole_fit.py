"""The procedure of the thesis: terms one by one, each projection searched, then a fine solve (2.2, 3).

For each term random rotations are refined by Powell's method on the error of the inner problem, in
which the last `joint_terms` are solved and the earlier ones stay. The search may run on smaller
textures and a subset of the samples (thesis 4.2: the projections carry over); the textures that are
kept come from the solve at full size with the masks applied. Plain on purpose: this is the reference
that faster searches are measured against.
"""

import math
import time
from dataclasses import replace

import torch

from homofact.brdf.samples import Samples
from homofact.errors import BadInput, Report, Status
from homofact.factor.confidence import with_deviations
from homofact.factor.factorization import Factorization, Term
from homofact.factor.projection import Projection
from homofact.factor.search.minimize import GuardStruck
from homofact.factor.search.powell import Powell
from homofact.factor.textures import LogSamples, Solved, inner_problem, residual, solve_terms, texture_shape
from homofact.geometry.rotation import Rotation
from homofact.linear.solvers import solve
from homofact.linear.threads import one_thread
from homofact.methods.cole import Cole
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
from homofact.methods.memory import refuse_too_large


def solve_greedily(samples: LogSamples, projections: tuple[Projection, ...], settings: Cole) -> Solved:
    """Textures of given projections, at full size: the last `joint` solved jointly as each term arrives.

    The figures of the system are the last solve's.
    """
    joint = len(projections) if settings.joint_terms == 0 else settings.joint_terms
    terms: tuple[Term, ...] = ()
    solved = None
    first = len(projections) if joint >= len(projections) else 1
    for count in range(first, len(projections) + 1):
        begin = max(0, count - joint)
        terms = terms[:begin]
        rest = replace(samples, logs=residual(samples, terms))
        last = projections[begin:count]
        shapes = tuple(texture_shape(p, settings.size) for p in last)
        solved = solve_terms(rest, last, shapes, settings.smoothing, settings.solver)
        terms = (*terms, *solved.terms)
    assert solved is not None  # there is at least one projection
    return replace(solved, terms=terms)


@one_thread
def fit_cole(samples: Samples, settings: Cole, progress: ProgressCallback | None = None) -> Fit:
    """Factor `samples` by the procedure of the thesis.

    `samples` are the training samples as measured: isotropic ones are copied to other azimuths here. An interrupt
    (Ctrl-C) keeps the terms found so far and is reported as INTERRUPTED, unless there is none yet; so does the guard of
    `settings.budget` seconds, reported as GUARD, but that the term it strikes in keeps its best projection so far.
    Either way provenance and details say that the fit is not reproducible.
    """
    began = time.perf_counter()
    deadline = math.inf if settings.budget is None else began + settings.budget
    provenance = provenance_of(samples, settings)
    samples, taken = trusted_samples(samples, settings)
    # Both coordinates know the azimuth.
    samples = at_azimuths(samples, settings, knows_azimuth=True)
    textures = settings.textures
    refuse_too_large(settings, ((settings.size, settings.size),) * textures, 2 * textures * len(samples))
    transform = transform_of(samples, settings)
    full = LogSamples.of(samples, transform)
    coarse = (
        full
        if settings.search_samples == 0
        else LogSamples.of(samples.subset(settings.search_samples, settings.seed), transform)
    )
    size = coarse_size(settings)
    generator = torch.Generator().manual_seed(settings.seed)
    chosen: tuple[Projection, ...] = ()
    coarse_terms: tuple[Term, ...] = ()
    reports: list[Report] = []
    interrupted = False
    try:
        for number in range(1, settings.textures + 1):
            joint = number if settings.joint_terms == 0 else settings.joint_terms
            begin = max(0, number - joint)
            rest = replace(coarse, logs=residual(coarse, coarse_terms[:begin]))
            best, report = _search_term(rest, chosen[begin:], size, settings, generator, number, deadline, progress)
            reports += report
            chosen = (*chosen, best)
            shapes = tuple(texture_shape(p, size) for p in chosen[begin:])
            solved = solve_terms(rest, chosen[begin:], shapes, settings.smoothing, settings.solver)
            coarse_terms = (*coarse_terms[:begin], *solved.terms)
            if time.perf_counter() > deadline:
                break
    except KeyboardInterrupt:
        if not chosen:
            raise
        interrupted = True
    solved = solve_greedily(full, chosen, settings)
    terms, status = solved.terms, solved.status
    if settings.confidence:
        terms = with_deviations(full, terms, settings.smoothing)
    error = float((residual(full, terms) ** 2).mean())
    guarded = len(chosen) < settings.textures or any(each.status is Status.GUARD for each in reports)
    notes: tuple[str, ...] = ()
    if interrupted:
        status = Status.INTERRUPTED
    elif guarded:
        status = Status.GUARD
        kept = f"{len(chosen)} of {settings.textures} textures"
        notes = (f"the guard of {settings.budget:g} s ended the search with {kept}: another run may end elsewhere",)
    elif status is not Status.FALLBACK:
        ended = {report.status for report in reports}
        status = Status.CONVERGED if ended == {Status.CONVERGED} else Status.BUDGET
    made = provenance | {"reproducible": status not in (Status.GUARD, Status.INTERRUPTED)}
    report = Report(
        status,
        iterations=sum(report.iterations for report in reports),
        evaluations=sum(report.evaluations for report in reports),
        seconds=time.perf_counter() - began,
        residual=error,
        seed=settings.seed,
        notes=notes,
        details=made | solved.details() | {"outliers": taken},
    )
    return Fit(Factorization(terms, transform, samples.channels, made), report)


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
    """The best projection of one more term, over all restarts or until `deadline`, with `earlier` solved beside it."""

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
        value = problem.mean_error(solve(problem, settings.solver).texels)
        evaluations += 1
        if value < lowest:
            lowest, best = value, rotation
        if progress is not None:
            progress(Progress(number, settings.textures, restart, settings.restarts, evaluations, lowest))
        if time.perf_counter() > deadline:
            raise GuardStruck
        return value

    began = time.perf_counter()
    found: list[Report] = []
    try:
        for restart in range(1, settings.restarts + 1):  # noqa: B007 (the error function reports it)
            found.append(Powell().minimize(error, Rotation.random(generator), settings.seed)[1])
    except GuardStruck:
        counted = evaluations - sum(report.evaluations for report in found)
        found.append(Report(Status.GUARD, 0, counted, time.perf_counter() - began, lowest, settings.seed))
    if best is None:
        raise BadInput("samples: no projection has a finite error, expected finite samples")
    return projection(best), found
