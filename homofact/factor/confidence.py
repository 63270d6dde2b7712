"""Standard deviation of each texel under a repeated measurement, computed from the normal matrix.

The texels are linear in the log samples, y = H⁻¹ BᵀW f̃, with H = BᵀWB + λ'LᵀL + δI + μZZᵀ; the gauge Z removes the
constant from every texture except the first. With independent errors of variance σ²/w in the log samples

    cov y = σ² H⁻¹ G H⁻¹,     G = BᵀWB,

for each channel. σ² is the weighted sum of squared residuals over Σw − tr(H⁻¹G), the residual degrees of freedom. The
model error of the textures counts as noise in σ². On clean data the deviation therefore measures the unexplained part
of the samples and overestimates the spread; where noise dominates, it is the spread. The bias from smoothing is not
included. Azimuth copies of a measurement share its error: their weights add up to one, which is only right on average.
"""

from dataclasses import replace

import numpy as np
import scipy.linalg
import torch

from homofact.factor.factorization import Term, layout_of_terms
from homofact.factor.gauge import gauge_rows
from homofact.factor.textures import LogSamples, Smoothing, inner_problem, residual


def with_deviations(samples: LogSamples, terms: tuple[Term, ...], smoothing: Smoothing) -> tuple[Term, ...]:
    """Return the terms with `deviation`, the standard deviation (rows, columns, C) of every texel in log units.

    `terms` must be the result of `solve_terms` for these samples and this λ, all solved together. Texels outside the
    mask have the deviation 0, since they were not solved for. The cost is of the order of T³ operations.
    """
    masks = tuple(term.mask for term in terms)
    projections = tuple(term.projection for term in terms)
    layout = layout_of_terms(terms)
    problem = inner_problem(samples, projections, layout.shapes, smoothing, masks)
    problem = replace(problem, gauge=gauge_rows(projections, masks))
    kept = problem.kept
    matrix, _ = problem.normal()
    data = problem.data.matrix[kept][:, kept]
    found = scipy.linalg.inv(matrix.cpu().numpy(), overwrite_a=True, check_finite=False)
    inverse = torch.from_numpy(found).to(matrix.device)
    errors = residual(samples, terms)
    if samples.clipped is not None:
        # Over its bound a clipped value is met.
        errors = torch.where(samples.clipped, errors.clamp_min(0), errors)
    freedom = float(samples.weights.sum()) - float((inverse * data).sum())
    squares = (samples.weights[:, None] * errors**2).sum(0)
    variance = squares / max(freedom, np.finfo(float).tiny)
    spread = ((inverse @ data) * inverse).sum(1).clamp_min(0).sqrt()
    textures = layout.split(problem.expand(spread[:, None] * variance.sqrt()))
    return tuple(replace(term, deviation=own) for term, own in zip(terms, textures, strict=True))
