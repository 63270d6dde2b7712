"""McCool's homomorphic factorization with fixed projections (McCool, Ang and Ahmad 2001; thesis 2.1.1).

f(ωi, ωo) ≈ p(ωi) q(h) p(ωo): two textures, three lookups, reciprocal by construction. Any other list of
fixed projections by name is solved the same way: one linear problem, all textures together.

The highlight is where h is the normal, the middle of its map. A map of n × n texels, n even, has no texel there, and a
highlight between four texels is blunt. A map with n + 1 rows of n − 1 texels has a texel there, and only one texel less
in total. The fit tries both grids and keeps the better one (setting `grid`), because they have almost the same number
of unknowns.
"""

import time

from homofact.brdf.samples import Samples
from homofact.errors import Report
from homofact.factor.confidence import with_deviations
from homofact.factor.factorization import Factorization
from homofact.factor.projection import Projection, fixed_projection
from homofact.factor.textures import LogSamples, residual, solve_terms, texture_shape
from homofact.linear.layout import Shape
from homofact.linear.threads import one_thread
from homofact.methods.common import as_stored, at_azimuths, provenance_of, transform_of, trusted_samples
from homofact.methods.fitting import MethodFit, ProgressCallback
from homofact.methods.mccool import McCool
from homofact.methods.memory import refuse_too_large


def fit_mccool(samples: Samples, settings: McCool, progress: ProgressCallback | None = None) -> MethodFit:
    """Fit textures for `settings.projections` to samples, with azimuth copies if a projection depends on azimuth.

    There is one linear solve, so `progress` is never called.
    """
    return as_stored(_fit_textures(samples, settings), samples, settings)


@one_thread
def _fit_textures(samples: Samples, settings: McCool) -> MethodFit:
    """Return the fit with unquantized texels."""
    began = time.perf_counter()
    provenance = provenance_of(samples, settings)
    samples, taken = trusted_samples(samples, settings)
    projections = tuple(fixed_projection(name, settings.reciprocal) for name in settings.projections)
    samples = at_azimuths(samples, settings, not all(projection.system.isotropic for projection in projections))
    lookups = sum(projection.lookups for projection in projections)
    grids = {
        name: tuple(_shape(projection, settings.size, name == "centred") for projection in projections)
        for name in ("plain", "centred")
        if settings.grid in (name, "better")
    }
    for shapes in grids.values():
        refuse_too_large(settings, shapes, lookups * len(samples))
    transform = transform_of(samples, settings)
    data = LogSamples.of(samples, transform)
    tried = {
        shapes: solve_terms(data, projections, shapes, settings.smoothing, settings.solver)
        for shapes in dict.fromkeys(grids.values())
    }
    solved = min(tried.values(), key=lambda attempt: float((residual(data, attempt.terms) ** 2).mean()))
    terms = solved.terms
    if settings.confidence:
        terms = with_deviations(data, terms, settings.smoothing)
    factorization = Factorization(terms, transform, samples.channels, provenance)
    error = float((residual(data, solved.terms) ** 2).mean())
    seconds = time.perf_counter() - began
    return MethodFit(
        factorization,
        Report(
            solved.status, 1, len(tried), seconds, error, settings.seed, details=solved.details() | {"outliers": taken}
        ),
    )


def _shape(projection: Projection, size: int, centred: bool) -> Shape:
    """Return (rows, columns) of a texture; maps of directions, centred or not, differ by at most one texel."""
    rows, columns = texture_shape(projection, size)
    is_map = projection.system.domain == "discs" and rows > 1
    return (rows + 1, columns - 1) if centred and is_map and size % 2 == 0 else (rows, columns)
