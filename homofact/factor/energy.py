"""The objective that preserves reflected light: it adds a flux term, since the log error alone can lose a highlight.

The mean squared log error weights all pairs of directions equally, and the exponential of a mean of logs is less than
the mean. So a glossy material, whose light is in few pairs, is fitted too dark although its log error is small.
Therefore the generalised Kullback-Leibler divergence of the flux is added to the log squares. With g = f/A + ε = exp
f̃, ĝ = exp s, s = By,

    J(y) = μ Σn wn Σc (f̃nc − snc)² + Σn Σc pnc (ĝnc − gnc − gnc (snc − f̃nc)) + Σn Σc qnc (ĝnc − gnc)²,

p is the weighted flux of the value A at the pair: solid angle × cosθi cosθo / (sinθd √cosθd), in units in which each
channel's Σn pn (f/A)n is Σ w. The divergence is convex in s, and at its minimum Σ pn (ĝ − g) = 0 over the samples of
every texel: each texel preserves its light. Dividing by sinθd cosθd would weight every angle of incidence of a
mirror-like lobe equally. Without sinθd, normal incidence, which is a small part of all pairs, would have almost no
weight. √cosθd is a compromise between flux and equal weights: grazing incidence, whose albedo is visible at
silhouettes, has more weight than its flux.

q makes the last sum the squared RMS of f cosθi cosθo, by which fits are judged: solid angle × cos²θi cos²θo, in units
in which each channel's Σn qn (f/A)²n is `SQUARES_SHARE` Σ w. It is needed since the divergence preserves the flux of a
highlight, but hardly constrains its shape. Samples of a measurement have q = 0: a few noisy samples would dominate the
sum.

Near the data ĝ − g − g (s − f̃) ≈ g (s − f̃)²/2 and (ĝ − g)² ≈ g² (s − f̃)². So J is approximately the inner problem of
the log error with the sample weights

    μ wn + mean_c (½ pnc gnc + qnc g²nc),

which a structure search can use directly (`weights_of`). L-BFGS then minimises the exact J with its smoothing
(`keep_light`). It is preconditioned by one matrix for all channels: the normal equations with the sample weights h = μ
w + max_c (½ p v + q v²) and v = max(ĝ, g), which bound the curvature of J near the data. This costs one Cholesky
factorization and a few dozen passes over the samples. If the inner problem has just been solved with `weights_of`, its
factor is reused. For many texels the factors of the textures' own blocks are used instead (`linear.banded`), with more
steps.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.linalg
import scipy.sparse
import torch
from torch import Tensor

from homofact.brdf.log_transform import MOST, LogTransform
from homofact.brdf.pair_density import scheme_of, solid_angles
from homofact.brdf.samples import Samples
from homofact.factor.factorization import Term, layout_of_terms
from homofact.factor.textures import LogSamples, Smoothing, centred, inner_problem
from homofact.geometry.coordinates import rusinkiewicz_angles
from homofact.linear.least_squares import RELATIVE_RIDGE
from homofact.linear.normal import stencil_rows
from homofact.linear.size import is_dense
from homofact.linear.sparse_solve import own_blocks

# Of .3, .1, .05, .03, .01, tried on four paints of RGL: the least Cole error of those that keep each angle's albedo.
LOG_SHARE = {"both": 0.05, "energy": 0.01}
# A measurement's flux is in few bright samples, each with its noise: the logs of all the others have to hold more.
MEASURED_SHARE = 1.0
# Of 0, .3 and 3, tried on four paints of RGL and on blue paint: .3 lowers the RMS by up to 39% and hardly moves Cole
# errors of clean models; 3 lowers the RMS a little more and doubles these errors.
SQUARES_SHARE = 0.3
LEAST_SINE, LEAST_COSINE = 0.05, 0.1
STEPS = 25
LARGE_STEPS = 100
ENDS = 3e-5


@dataclass(frozen=True)
class Flux:
    """p and q (N, C) and μ of the module docstring, for samples with or without azimuth copies."""

    per_value: Tensor
    log_share: float
    squares: Tensor

    @classmethod
    def of(cls, samples: Samples, transform: LogTransform, objective: str) -> "Flux":
        """Return the flux of `samples` under an objective, "both" or "energy"."""
        share = MEASURED_SHARE if objective == "both" and scheme_of(samples) is None else LOG_SHARE[objective]
        _, theta_d, _ = rusinkiewicz_angles(samples.wi, samples.wo)
        each = solid_angles(samples) * samples.wi[:, 2] * samples.wo[:, 2]
        each = each / (torch.sin(theta_d).clamp_min(LEAST_SINE) * torch.cos(theta_d).clamp_min(LEAST_COSINE).sqrt())
        whole = (each[:, None] * samples.values / transform.mean_like(each)).sum(0)
        scale = samples.weights.sum() / whole.clamp_min(torch.finfo(whole.dtype).tiny)
        return cls(each[:, None] * scale, share, _squares(samples, transform))

    def with_none(self, count: int) -> "Flux":
        """Return the flux with `count` more samples appended that have zero flux."""
        none = self.per_value.new_zeros(count, self.per_value.shape[1])
        per_value, squares = (torch.cat((own, none)) for own in (self.per_value, self.squares))
        return replace(self, per_value=per_value, squares=squares)

    def weights_of(self, samples: LogSamples) -> Tensor:
        """Return the weights (N,) with which squared log errors approximate J near the data, with unchanged sum."""
        curved = _curvature(self.per_value, self.squares, torch.exp(samples.logs))
        found = self.log_share * samples.weights + curved.mean(1)
        return found * (samples.weights.sum() / found.sum())


def _squares(samples: Samples, transform: LogTransform) -> Tensor:
    """Return the weights q (N, C) of the module's docstring; 0 for samples of a measurement."""
    if scheme_of(samples) is None:
        return torch.zeros_like(samples.values)
    each = solid_angles(samples) * (samples.wi[:, 2] * samples.wo[:, 2]) ** 2
    whole = (each[:, None] * (samples.values / transform.mean_like(each)) ** 2).sum(0)
    return each[:, None] * (SQUARES_SHARE * samples.weights.sum() / whole.clamp_min(torch.finfo(whole.dtype).tiny))


def _curvature(per_value: Any, squares: Any, values: Any) -> Any:
    """Return ½ p v + q v² (N, C) for values v, half the curvature of the light terms of J."""
    return 0.5 * per_value * values + squares * values**2


def keep_light(
    samples: LogSamples,
    terms: tuple[Term, ...],
    smoothing: Smoothing,
    flux: Flux,
    factor: np.ndarray | None = None,
    ridge: float = RELATIVE_RIDGE,
) -> tuple[tuple[Term, ...], dict[str, float]]:
    """Return (terms at the minimum of J, a dictionary of J "before" and "after" and the number of "evaluations").

    `samples` have their own weights, not those of J. `factor` is the Cholesky factor of the system that the terms solve
    with the weights of `Flux.weights_of`, if it is known. `ridge` is the relative ridge of this system. The
    minimisation runs on the CPU, and the textures are returned on their original device.
    """
    light = _Light(samples, terms, smoothing, flux, factor, ridge)
    start = light.start()
    first, _ = light.evaluate(start)
    steps = STEPS if is_dense(light.unknowns) else LARGE_STEPS
    from scipy.optimize import minimize  # not by commands that read a fit alone

    result = minimize(
        light.evaluate, start, jac=True, method="L-BFGS-B", options={"maxiter": steps, "ftol": ENDS, "gtol": 0.0}
    )
    if not result.fun < first:
        return terms, {"before": first, "after": first, "evaluations": float(result.nfev)}
    textures = light.textures(result.x)
    moved = tuple(
        replace(term, texture=torch.where(term.mask[..., None], texture.to(term.texture), term.texture))
        for term, texture in zip(terms, textures, strict=True)
    )
    return centred(moved), {"before": first, "after": float(result.fun), "evaluations": float(result.nfev)}


class _Dense:
    """A dense upper triangular factor U (K, K), with the interface of `BlockBanded`."""

    def __init__(self, factor: np.ndarray) -> None:
        self._factor = factor

    @classmethod
    def of(cls, bound: np.ndarray, penalty: scipy.sparse.coo_matrix) -> "_Dense":
        """Return the Cholesky factor U of `bound` + `penalty`, overwriting `bound`."""
        bound[penalty.row, penalty.col] += penalty.data
        # Texels that next to nothing holds may leave the matrix singular to working precision.
        bound[np.diag_indices_from(bound)] += 1e-9 * np.trace(bound) / len(bound)
        return cls(scipy.linalg.cholesky(bound, lower=False, overwrite_a=True, check_finite=False))

    def times(self, x: np.ndarray) -> np.ndarray:
        """U x."""
        return self._factor @ x

    def back(self, z: np.ndarray) -> np.ndarray:
        """U⁻¹ z."""
        return scipy.linalg.solve_triangular(self._factor, z, check_finite=False)

    def forth(self, x: np.ndarray) -> np.ndarray:
        """U⁻ᵀ x."""
        return scipy.linalg.solve_triangular(self._factor, x, trans=1, check_finite=False)


class _Light:
    """J / Σ w as a function of z = U y, where UᵀU bounds the curvature at the start; this preconditions the problem."""

    def __init__(
        self,
        samples: LogSamples,
        terms: tuple[Term, ...],
        smoothing: Smoothing,
        flux: Flux,
        factor: np.ndarray | None = None,
        ridge: float = RELATIVE_RIDGE,
    ) -> None:
        self._layout = layout_of_terms(terms)
        masks = tuple(term.mask.cpu() for term in terms)
        projections = tuple(term.projection for term in terms)
        near = LogSamples(*(each.cpu() for each in (samples.wi, samples.wo, samples.logs, samples.weights)))
        self._clipped = None if samples.clipped is None else samples.clipped.cpu().numpy()
        problem = inner_problem(near, projections, self._layout.shapes, smoothing, masks, ridge)
        kept = self._kept = problem.kept.numpy()
        numbers, values = stencil_rows(problem.coordinates, problem.lookups)
        count, width = numbers.shape
        rows = (values.numpy().ravel(), numbers.numpy().ravel(), np.arange(count + 1) * width)
        self._texels = self._layout.join([term.texture.cpu() for term in terms]).numpy().copy()
        # What filler texels add stays as it is.
        everything = scipy.sparse.csr_matrix(rows, shape=(count, problem.unknowns))
        self._rows = everything[:, kept]
        self._rest = everything[:, ~kept] @ self._texels[~kept]
        self._columns = self._rows.T.tocsr()
        self._logs, self._given = near.logs.numpy(), np.exp(near.logs.numpy())
        self._hold = (flux.log_share * near.weights).numpy()[:, None]
        self._flow = flux.per_value.cpu().numpy()
        self._squares = flux.squares.cpu().numpy()
        self._total = float(near.weights.sum())
        # λ is in units of weight a texel, the weights those of the first look at the data.
        unit = float((self._hold[:, 0] + _curvature(self._flow, self._squares, self._given).mean(1)).sum())
        scale = problem.penalty_scale.numpy()[kept] * (unit / self._total)
        self._penalty = scipy.sparse.diags(scale[:, 0]) @ problem.roughness.gram[kept][:, kept]
        self._penalty += scipy.sparse.identity(int(kept.sum())) * (problem.ridge * unit / self._total)
        self.unknowns = problem.unknowns
        if factor is not None:
            # The factor's weights are scaled to have the samples' sum.
            self._factor = _Dense(np.triu(factor) * (unit / self._total) ** 0.5)
            return
        found = np.exp(np.minimum(self._sums(self._texels[kept]), MOST))
        most = np.maximum(found, self._given)
        weights = self._hold[:, 0] + _curvature(self._flow, self._squares, most).max(1)
        if is_dense(problem.unknowns):
            bound = replace(problem, weights=torch.from_numpy(weights)).data.matrix.numpy()[np.ix_(kept, kept)]
            self._factor = _Dense.of(bound, self._penalty.tocoo())
        else:
            self._factor = own_blocks(problem, weights, scipy.sparse.csr_matrix(self._penalty))

    def start(self) -> np.ndarray:
        """Return z of the given texels."""
        return self._factor.times(self._texels[self._kept]).ravel()

    def evaluate(self, z: np.ndarray) -> tuple[float, np.ndarray]:
        """Return J and its gradient by z, both divided by Σ w."""
        texels = self._of(z)
        logs = self._sums(texels)
        if self._clipped is not None:
            # What is only known not to be less costs nothing where it is more.
            logs = np.where(self._clipped, np.minimum(logs, self._logs), logs)
        off, found = logs - self._logs, np.exp(np.minimum(logs, MOST))
        miss = found - self._given
        rough = self._penalty @ texels
        value = (self._hold * off**2).sum() + (texels * rough).sum()
        value += (self._flow * (miss - self._given * off) + self._squares * miss**2).sum()
        slope = 2 * rough + self._columns @ (2 * self._hold * off + (self._flow + 2 * self._squares * found) * miss)
        return float(value) / self._total, self._factor.forth(slope).ravel() / self._total

    def textures(self, z: np.ndarray) -> tuple[torch.Tensor, ...]:
        """Return the textures (rows, columns, C) that z encodes."""
        texels = self._texels.copy()
        texels[self._kept] = self._of(z)
        return self._layout.split(torch.from_numpy(texels))

    def _of(self, z: np.ndarray) -> np.ndarray:
        return self._factor.back(z.reshape(int(self._kept.sum()), -1))

    def _sums(self, texels: np.ndarray) -> np.ndarray:
        return self._rows @ texels + self._rest
