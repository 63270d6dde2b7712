"""A last refinement where looks are judged: the linear, cosine-weighted error, lowered without giving up positivity.

The log domain is a good place to fit and a poor judge of looks: it spends as much on a dark grazing
corner as on the highlight. From the log fit s = By, Gauss-Newton steps on

    J(y) = Σ w cos²θi (f̂ − f)² / J₀ + Σ w (f̃ − s)² / K₀,      f̂ = A (eˢ − ε),

with J₀, K₀ the two sums at the start, so both count alike, and the texels stay exponents: f̂ > −εA by
construction, and is cut at zero as ever. Linearised, f̂ − f ≈ A eˢ⁰ (s − s⁺) with the target
s⁺ = s⁰ + (f − f̂⁰)/(A eˢ⁰): a reweighted inner problem, one channel at a time, since each has its own
weights. A step that does not lower J is halved; both errors are reported before and after.
"""

from dataclasses import replace

import torch
from torch import Tensor

from homofact.brdf.log_transform import LogTransform
from homofact.factor.factorization import Term, layout_of_terms, sum_of_terms
from homofact.factor.textures import LogSamples, Smoothing, centred, inner_problem
from homofact.linear.solvers import solve

STEPS = 8
ENDS = 1e-3


def refine_linear(
    samples: LogSamples, terms: tuple[Term, ...], smoothing: Smoothing, transform: LogTransform
) -> tuple[tuple[Term, ...], dict[str, float]]:
    """(refined terms, {"log_mse_before", "log_mse_after", "cosine_mse_before", "cosine_mse_after", "steps"}).

    The cosine errors are weighted means of cos²θi (f̂ − f)² in sr⁻², over samples and channels.
    """
    values = transform.inverse(samples.logs)
    cosine = samples.wi[:, 2:] ** 2
    mean = transform.mean

    def sums(logs: Tensor) -> tuple[Tensor, Tensor]:
        weights = samples.weights[:, None]
        linear = (weights * cosine * (transform.inverse(logs) - values) ** 2).sum(0)
        return linear, (weights * (logs - samples.logs) ** 2).sum(0)

    logs = sum_of_terms(terms, samples.wi, samples.wo)
    first_linear, first_log = sums(logs)
    tiny = torch.finfo(torch.float64).tiny

    def objective(logs: Tensor) -> float:
        linear, log = sums(logs)
        return float((linear / first_linear.clamp_min(tiny) + log / first_log.clamp_min(tiny)).sum())

    best, steps = objective(logs), 0
    for steps in range(1, STEPS + 1):  # noqa: B007 (the count is reported)
        gain = mean * torch.exp(logs)
        pull = cosine * gain**2 / first_linear.clamp_min(tiny)
        hold = 1 / first_log.clamp_min(tiny)
        # Both squares of s complete to one: weight pull + hold, target the weighted mean of the two targets.
        linear_target = logs + (values - transform.inverse(logs)) / gain.clamp_min(tiny)
        weights = pull + hold
        targets = (pull * linear_target + hold * samples.logs) / weights
        proposed = _solve_by_channel(samples, terms, weights, targets, smoothing)
        for halving in range(6):
            trial = _blend(terms, proposed, 0.5**halving)
            trial_logs = sum_of_terms(trial, samples.wi, samples.wo)
            value = objective(trial_logs)
            if value < best:
                break
        else:
            break
        gained = (best - value) / best
        terms, logs, best = trial, trial_logs, value
        if gained < ENDS:
            break
    last_linear, last_log = sums(logs)
    scale = float(samples.weights.sum()) * samples.logs.shape[1]
    account = {
        "log_mse_before": float(first_log.sum()) / scale,
        "log_mse_after": float(last_log.sum()) / scale,
        "cosine_mse_before": float(first_linear.sum()) / scale,
        "cosine_mse_after": float(last_linear.sum()) / scale,
        "steps": float(steps),
    }
    return centred(terms), account


def _solve_by_channel(
    samples: LogSamples, terms: tuple[Term, ...], weights: Tensor, targets: Tensor, smoothing: Smoothing
) -> tuple[Tensor, ...]:
    projections = tuple(term.projection for term in terms)
    layout = layout_of_terms(terms)
    masks = tuple(term.mask for term in terms)
    columns = []
    for channel in range(targets.shape[1]):
        own = samples.weights * weights[:, channel]
        # λ is in units of weight a texel: normalised weights leave its meaning alone.
        own = own * (samples.weights.sum() / own.sum())
        one = replace(samples, logs=targets[:, channel : channel + 1], weights=own)
        columns.append(solve(inner_problem(one, projections, layout.shapes, smoothing, masks)).texels)
    return layout.split(torch.cat(columns, 1))


def _blend(terms: tuple[Term, ...], proposed: tuple[Tensor, ...], share: float) -> tuple[Term, ...]:
    """Textures a share of the way to the proposed ones, filler texels untouched."""
    blended = []
    for term, texture in zip(terms, proposed, strict=True):
        moved = term.texture + share * (texture - term.texture)
        blended.append(Term(term.projection, torch.where(term.mask[..., None], moved, term.texture), term.mask))
    return tuple(blended)
