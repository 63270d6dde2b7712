"""How far each texel would move were the measurement repeated: a standard deviation from the normal matrix.

The texels are linear in the log samples, y = C H⁻¹ BᵀW f̃, with H = BᵀWB + λ'LᵀL + δI + μZZᵀ and C the gathering of
constants in the first texture. With independent errors of variance σ²/w in the log samples

    cov y = σ² D G Dᵀ,     D = C H⁻¹,  G = BᵀWB,

a channel at a time. σ² is the weighted sum of squared residuals over Σw − tr(H⁻¹G), the residual degrees of freedom.
What the textures cannot follow counts as noise there, so on clean data the deviation says how much the fit does not
explain, and is too large as a spread; where noise dominates it is the spread. Smoothing's bias is not in it. Azimuth
copies of a measurement share its error: their weights add up to one, which is right on the average only.
"""

from dataclasses import replace

import numpy as np
import scipy.linalg
import torch
from torch import Tensor

from homofact.factor.factorization import Term
from homofact.factor.gauge import gauge_rows
from homofact.factor.textures import LogSamples, Smoothing, inner_problem, residual


def with_deviations(samples: LogSamples, terms: tuple[Term, ...], smoothing: Smoothing) -> tuple[Term, ...]:
    """The terms with `deviation`, the standard deviation (rows, columns, C) of every texel in log units.

    `terms` are as `solve_terms` left them for these samples and this λ, all solved together. Texels outside of the
    mask take the deviation 0: nothing was solved there. Costs some T³ operations, once.
    """
    masks = tuple(term.mask for term in terms)
    projections = tuple(term.projection for term in terms)
    problem = inner_problem(samples, projections, tuple(term.size for term in terms), smoothing, masks)
    problem = replace(problem, gauge=gauge_rows(projections, masks))
    kept = problem.kept
    matrix, _ = problem.normal()
    data = problem.data.matrix[kept][:, kept]
    inverse = torch.from_numpy(scipy.linalg.inv(matrix.numpy(), overwrite_a=True, check_finite=False))
    errors = residual(samples, terms)
    freedom = float(samples.weights.sum()) - float((inverse * data).sum())
    squares = (samples.weights[:, None] * errors**2).sum(0)
    variance = squares / max(freedom, np.finfo(float).tiny)
    moved = _centred_rows(inverse, terms)
    spread = ((moved @ data) * moved).sum(1).clamp_min(0).sqrt()
    texels = torch.zeros(problem.unknowns, dtype=torch.float64)
    texels[kept] = spread
    result, begin = [], 0
    for term in terms:
        count = term.mask.numel()
        own = texels[begin : begin + count].reshape(term.mask.shape)
        result.append(replace(term, deviation=own[..., None] * variance.sqrt()))
        begin += count
    return tuple(result)


def _centred_rows(inverse: Tensor, terms: tuple[Term, ...]) -> Tensor:
    """C H⁻¹: rows of all textures but the first less their mean, which the first takes by the lookups' ratio."""
    result = inverse.clone()
    first = int(terms[0].mask.sum())
    begin = first
    for term in terms[1:]:
        count = int(term.mask.sum())
        mean = inverse[begin : begin + count].mean(0)
        result[begin : begin + count] -= mean
        result[:first] += mean * (term.projection.lookups / terms[0].projection.lookups)
        begin += count
    return result
