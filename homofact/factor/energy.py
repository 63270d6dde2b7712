"""The objective that keeps the light: where logs alone lose a highlight, flux is counted beside them.

The mean of squared logs looks at every pair of directions alike, and the exponential of a mean of logs is less than the
mean. So a gloss, whose light is in few pairs, comes out dark while its log error looks good. Beside the log squares
stands the generalised Kullback-Leibler divergence of flux. With g = f/A + ε = exp f̃, ĝ = exp s, s = By,

    J(y) = μ Σn wn Σc (f̃nc − snc)² + Σn Σc pnc (ĝnc − gnc − gnc (snc − f̃nc)),

p the flux of a value of A at the pair: solid angle × cosθi cosθo / sinθd, in units in which each channel's
Σn pn (f/A)n is Σ w. It is convex in s, and at its minimum Σ pn (ĝ − g) = 0 over the samples of every texel: light is
kept texel by texel. The division by sinθd counts every angle of incidence alike; without it normal incidence, a small
part of all pairs, counts for nothing.

Near the data ĝ − g − g (s − f̃) ≈ g (s − f̃)²/2: the same inner problem as that of the logs, with sample weights

    μ wn + ½ mean_c pnc gnc,

which a structure search can use as they are (`weights_of`). The exact J is then lowered by Newton steps with one matrix
for all channels (`keep_light`): weights h = μ w + ½ max_c p max(ĝ, g), which bound its curvature where ĝ ≤ g, and
targets s − ∇J/2h channel by channel. A step that does not lower J (with its smoothing) is halved.
"""

from dataclasses import dataclass, replace

import torch
from torch import Tensor

from homofact.brdf.log_transform import LogTransform
from homofact.brdf.pair_density import solid_angles
from homofact.brdf.samples import Samples
from homofact.factor.factorization import Term, layout_of_terms, sum_of_terms
from homofact.factor.textures import LogSamples, Smoothing, centred, inner_problem
from homofact.geometry.coordinates import rusinkiewicz_angles
from homofact.linear.solvers import solve

LOG_SHARE = {"both": 0.3, "energy": 0.01}
LEAST_SINE = 0.05
STEPS = 12
ENDS = 1e-4


@dataclass(frozen=True)
class Flux:
    """p (N, C) of the module's head, without azimuth copies or with, and μ."""

    per_value: Tensor
    log_share: float

    @classmethod
    def of(cls, samples: Samples, transform: LogTransform, objective: str) -> "Flux":
        """The flux of `samples` under an objective, "both" or "energy"."""
        _, theta_d, _ = rusinkiewicz_angles(samples.wi, samples.wo)
        each = solid_angles(samples) * samples.wi[:, 2] * samples.wo[:, 2] / torch.sin(theta_d).clamp_min(LEAST_SINE)
        whole = (each[:, None] * samples.values / transform.mean).sum(0)
        scale = samples.weights.sum() / whole.clamp_min(torch.finfo(whole.dtype).tiny)
        return cls(each[:, None] * scale, LOG_SHARE[objective])

    def weights_of(self, samples: LogSamples) -> Tensor:
        """The weights (N,) with which the log squares stand for J near the data; their sum is that of the samples'."""
        found = self.log_share * samples.weights + 0.5 * (self.per_value * torch.exp(samples.logs)).mean(1)
        return found * (samples.weights.sum() / found.sum())


def keep_light(
    samples: LogSamples, terms: tuple[Term, ...], smoothing: Smoothing, flux: Flux
) -> tuple[tuple[Term, ...], dict[str, float]]:
    """(terms at the minimum of J, {"before", "after": J, "steps"}); `samples` have their own weights, not J's."""
    projections = tuple(term.projection for term in terms)
    layout, masks = layout_of_terms(terms), tuple(term.mask for term in terms)
    hold = flux.log_share * samples.weights
    flow, given = flux.per_value, torch.exp(samples.logs)
    # λ is in units of weight a texel, the weights those of the first look at the data.
    unit = float((hold + 0.5 * (flow * given).mean(1)).sum())
    problem = inner_problem(samples, projections, layout.shapes, smoothing, masks)

    def value(trial: tuple[Term, ...], logs: Tensor) -> float:
        off = logs - samples.logs
        light = flow * (torch.exp(logs.clamp_max(80)) - given - given * off)
        texels = torch.cat([torch.where(t.mask[..., None], t.texture, 0.0).reshape(-1, off.shape[1]) for t in trial])
        rough = problem.penalty(texels) * unit / float(samples.weights.sum())
        return float((hold[:, None] * off.square() + light).sum()) + rough

    logs = sum_of_terms(terms, samples.wi, samples.wo)
    first = best = value(terms, logs)
    steps = 0
    for steps in range(1, STEPS + 1):  # noqa: B007 (the count is reported)
        found = torch.exp(logs.clamp_max(80))
        weights = hold + 0.5 * (flow * torch.maximum(found, given)).amax(1)
        slope = 2 * hold[:, None] * (logs - samples.logs) + flow * (found - given)
        targets = logs - 0.5 * slope / weights.clamp_min(torch.finfo(weights.dtype).tiny)[:, None]
        scale = unit / float(weights.sum())
        own = replace(problem, weights=weights, targets=targets, smoothing=problem.smoothing * scale)
        proposed = layout.split(solve(own).texels)
        for halving in range(6):
            trial = _blend(terms, proposed, 0.5**halving)
            trial_logs = sum_of_terms(trial, samples.wi, samples.wo)
            found_value = value(trial, trial_logs)
            if found_value < best:
                break
        else:
            break
        gained = (best - found_value) / abs(best)
        terms, logs, best = trial, trial_logs, found_value
        if gained < ENDS:
            break
    return centred(terms), {"before": first, "after": best, "steps": float(steps)}


def _blend(terms: tuple[Term, ...], proposed: tuple[Tensor, ...], share: float) -> tuple[Term, ...]:
    """Textures a share of the way to the proposed ones, filler texels untouched."""
    blended = []
    for term, texture in zip(terms, proposed, strict=True):
        moved = term.texture + share * (texture - term.texture)
        blended.append(Term(term.projection, torch.where(term.mask[..., None], moved, term.texture), term.mask))
    return tuple(blended)
