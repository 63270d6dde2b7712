"""McCool's homomorphic factorization with fixed projections (McCool, Ang and Ahmad 2001; thesis 2.1.1).

f(ωi, ωo) ≈ p(ωi) q(h) p(ωo): two textures, three lookups, reciprocal by construction. Any other list of
fixed projections by name is solved the same way: one linear problem, all textures together.
"""

import time

from homofact.brdf.samples import Samples
from homofact.errors import Report
from homofact.factor.confidence import with_deviations
from homofact.factor.factorization import Factorization
from homofact.factor.projection import fixed_projection
from homofact.factor.textures import LogSamples, residual, solve_terms, texture_shape
from homofact.linear.threads import one_thread
from homofact.methods.cole_fit import Fit, ProgressCallback, provenance_of, transform_of
from homofact.methods.settings import FitSettings

PROJECTIONS = ("wi", "h")


@one_thread
def fit_mccool(samples: Samples, settings: FitSettings, progress: ProgressCallback | None = None) -> Fit:
    """Textures for `settings.projections`, or McCool's own; `progress` is never called: one solve is all."""
    began = time.perf_counter()
    names = settings.projections or PROJECTIONS
    projections = tuple(fixed_projection(name, settings.reciprocal) for name in names)
    transform = transform_of(samples, settings)
    data = LogSamples.of(samples, transform)
    shapes = tuple(texture_shape(projection, settings.size) for projection in projections)
    solved = solve_terms(data, projections, shapes, settings.fixed_smoothing, settings.solver, settings.robust)
    terms = solved.terms
    if settings.confidence:
        terms = with_deviations(data, terms, settings.fixed_smoothing)
    factorization = Factorization(terms, transform, samples.channels, provenance_of(samples, settings))
    error = float((residual(data, solved.terms) ** 2).mean())
    seconds = time.perf_counter() - began
    return Fit(factorization, Report(solved.status, 1, 1, seconds, error, settings.seed, details=solved.details()))
