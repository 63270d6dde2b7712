"""The procedure of the thesis: terms one by one, each projection searched, then a fine solve (2.2, 3).

For each term random rotations are refined by Powell's method on the error of the inner problem, in which the last
`joint_terms` are solved and the earlier ones stay fixed. The search may run on smaller textures and a subset of the
samples (thesis 4.2: the projections carry over); the final textures come from a solve at full size with the masks. The
method is deliberately simple, because it is the reference for faster searches.
"""

import math
import time
from dataclasses import replace

from homofact.brdf.samples import Samples
from homofact.errors import Report, Status
from homofact.factor.confidence import with_deviations
from homofact.factor.factorization import Factorization, Term
from homofact.factor.projection import Projection
from homofact.factor.textures import LogSamples, Solved, residual, solve_terms, texture_shape
from homofact.linear.threads import one_thread
from homofact.methods.cole import Cole
from homofact.methods.cole_search import SearchedTerms, search_terms
from homofact.methods.common import (
    as_stored,
    at_azimuths,
    provenance_of,
    transform_of,
    trusted_samples,
)
from homofact.methods.fitting import MethodFit, ProgressCallback
from homofact.methods.memory import refuse_too_large


def solve_greedily(samples: LogSamples, projections: tuple[Projection, ...], settings: Cole) -> Solved:
    """Return full-size textures of given projections; each new term is solved jointly with the last ones.

    The statistics of the linear system are those of the last solve.
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


def fit_cole(samples: Samples, settings: Cole, progress: ProgressCallback | None = None) -> MethodFit:
    """Factor `samples` by the procedure of the thesis.

    `samples` are the training samples as measured: isotropic ones are copied to other azimuths here. After an interrupt
    (Ctrl-C), the fit has the terms found so far and the status INTERRUPTED; before the first term, the interrupt is
    raised. After `settings.budget` seconds, the fit has these terms, and the current term with its best projection so
    far; its status is GUARD. In both cases, provenance and details record that the fit is not reproducible.
    """
    return as_stored(_fit_terms(samples, settings, progress), samples, settings)


@one_thread
def _fit_terms(samples: Samples, settings: Cole, progress: ProgressCallback | None) -> MethodFit:
    """Return the fit with unquantized texels."""
    began = time.perf_counter()
    deadline = math.inf if settings.budget is None else began + settings.budget
    provenance = provenance_of(samples, settings)
    samples, outliers = trusted_samples(samples, settings)
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
    searched = search_terms(coarse, settings, deadline, progress)
    solved = solve_greedily(full, searched.projections, settings)
    terms = solved.terms
    if settings.confidence:
        terms = with_deviations(full, terms, settings.smoothing)
    status, notes = _ending(searched, solved, settings)
    provenance |= {"reproducible": status not in (Status.GUARD, Status.INTERRUPTED)}
    report = Report(
        status,
        iterations=sum(report.iterations for report in searched.reports),
        evaluations=sum(report.evaluations for report in searched.reports),
        # The search of terms that are known from the last fit took its time then.
        seconds=time.perf_counter() - began + searched.seconds_before,
        residual=float((residual(full, terms) ** 2).mean()),
        seed=settings.seed,
        notes=notes,
        details=provenance | solved.details() | {"outliers": outliers},
    )
    return MethodFit(Factorization(terms, transform, samples.channels, provenance), report)


def _ending(searched: SearchedTerms, solved: Solved, settings: Cole) -> tuple[Status, tuple[str, ...]]:
    """Return the status of the fit, and notes for the user."""
    if searched.interrupted:
        return Status.INTERRUPTED, ()
    kept, ended = len(searched.projections), {report.status for report in searched.reports}
    if kept < settings.textures or Status.GUARD in ended:
        textures = f"{kept} of {settings.textures} textures"
        note = f"the guard of {settings.budget:g} s ended the search with {textures}: another run may end elsewhere"
        return Status.GUARD, (note,)
    if solved.status is Status.FALLBACK:
        return solved.status, ()
    return (Status.CONVERGED if ended == {Status.CONVERGED} else Status.BUDGET), ()
