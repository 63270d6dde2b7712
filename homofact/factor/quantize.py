"""Quantize textures: find the texels that fit best among those that 8 or 16 bits can represent.

If every texel is rounded separately (`rounded`), texels cannot compensate for each other's errors. Let y be the minimum
of the inner problem. Other texels q change the logarithms by B(q − y). This change should be small at the samples and
at all directions that a renderer may use: half of the weight is on the samples, half on `PAIRS` pairs of directions
with the lookup matrix U. Half of these pairs are cosine-weighted, the others are drawn by the scheme `lobe`, many of
them in highlights. (Few cosine-weighted pairs are at the tip of a narrow highlight. Without samples there, its texel
was clipped to a smaller range: with cosine-weighted pairs alone, the logarithms at the tip of car-paint-red moved by
.016 instead of .006, see tests/factor/test_quantize.py.) Smoothing has already determined y, and quantized texels
cannot be smooth on the scale of their steps. So the smoothing term has only the weight `SMOOTHNESS`:

    H = ½ BᵀWB/ΣW + ½ UᵀU/|U| + `SMOOTHNESS` (λ'LᵀL + δI)/ΣW.

Minimising (q − y)ᵀH(q − y) over whole numbers is a closest-vector problem, solved with Babai's nearest-plane algorithm
(1986). Let H = RᵀR with R upper triangular. The texels are rounded one after the other, from the last to the first,
each to the value nearest to yk + Σj>k Rkj (yj − qj)/Rkk. So each texel compensates for the errors of those rounded
before. The order is such that the texels with the largest diagonal of H are rounded first. Then single texels change by
a step as long as that lowers the objective.

B contains the weights of a GPU sampler, which divides a texel into `FRACTIONS` steps, and y is the minimum for these
weights. The range of a texture is optimised, too. A linear program per channel moves constants and ramps between
textures without changing their sum (`factor.gauge`), so that the ranges, and with them the steps, become small. A few
texels that samples hardly determine may have extreme values, which would widen the steps of all others. So each end of
each range is moved inwards as far as that lowers the objective, and texels beyond it are clamped to it.

This works for products, whose logarithm is linear in all texels. A sum of products is not linear in its texels, so they
are rounded separately.
"""

from dataclasses import replace
from typing import TypeVar

import numpy as np
import scipy.linalg
import torch
from torch import Tensor

from homofact.brdf.pair_density import draw_lobe
from homofact.brdf.samples import Samples
from homofact.errors import BadInput
from homofact.factor.energy import Flux
from homofact.factor.factorization import Term, layout_of_terms
from homofact.factor.fitted import Fitted, QuantizationGrid
from homofact.factor.gauge import null_space
from homofact.factor.projection import Projection
from homofact.factor.spectral_fit import SpectralFit
from homofact.factor.textures import LogSamples, Smoothing, inner_problem
from homofact.geometry.directions import draw_cosine_weighted
from homofact.linear.kernels import kernel
from homofact.linear.least_squares import LeastSquares
from homofact.linear.mask import filled
from homofact.linear.normal import accumulate

# Vulkan 1.3 (subTexelPrecisionBits) and Direct3D 11 (3.2.4.1) ask for 8 bits; hardware gives that.
FRACTIONS = 256
SMOOTHNESS, PAIRS = 0.01, 20_000
LEVELS = {"png8": 255, "png16": 65535}
F = TypeVar("F", bound=Fitted)
_SWEEPS = 50
# How much of a range is drawn in at a time, first and last.
_FIRST_SHARE, _LAST_SHARE = 0.25, 0.01


def quantize(fitted: F, samples: Samples, storage: str) -> F:
    """Return the fit with texels that `storage` ("png8", "png16") holds exactly.

    The texels of a product are fitted to `samples` again, with the same projections, ε, A and λ (from the provenance).
    `samples` must be those of the fit, with azimuth copies if a projection depends on the azimuth. The texels of a sum
    of products are rounded separately, since its values are not linear in them. Raises BadInput for another storage.
    """
    if storage not in LEVELS:
        raise BadInput(where="quantize", found=repr(storage), expected=f"one of {', '.join(LEVELS)}")
    return _solved(fitted, samples, storage) if is_solved(fitted) else rounded(fitted, storage)


def is_solved(fitted: Fitted) -> bool:
    """Return whether `quantize` solves for the texels; else it rounds them."""
    return fitted.evaluation is not None and fitted.evaluation.transform is not None


def rounded(fitted: F, storage: str) -> F:
    """Return the fit with every texel rounded separately within the range of its texture, as a plain export does."""
    made = [
        _rounded(torch.from_numpy(texture.texels), torch.from_numpy(texture.mask), LEVELS[storage])
        for texture in fitted.textures
    ]
    return fitted.with_textures([texels for texels, _ in made], [grid for _, grid in made], {"quantize": storage})


def _rounded(texels: Tensor, mask: Tensor, levels: int) -> tuple[Tensor, QuantizationGrid]:
    inside = texels[mask]
    low = inside.amin(0)
    step = (inside.amax(0) - low).clamp_min(1e-6) / levels
    return low + step * ((texels - low) / step).round().clamp(0, levels), QuantizationGrid(low, step, levels)


def _solved(fitted: F, samples: Samples, storage: str) -> F:
    settings = fitted.provenance.get("settings", {})
    logs = LogSamples.of(samples, fitted.transform)
    found = fitted.provenance.get("smoothing", 1e-3)
    smoothing = tuple(found) if isinstance(found, list | tuple) else float(found)
    objective = settings.get("objective", "log")
    if objective != "log":
        plain = replace(logs, weights=samples.weights)
        logs = replace(plain, weights=Flux.of(samples, fitted.transform, objective).weights_of(plain))
    logs = _as_textures(fitted, logs)
    plainly = samples.clipped is None and not settings.get("robust", False) and settings.get("refine", "none") == "none"
    solved_anew = plainly and objective == "log"
    device = samples.wi.device
    given = tuple(term.tensors(device) for term in fitted.terms)
    terms = quantized_terms(logs, given, smoothing, LEVELS[storage], solved_anew)
    texels, grids = [term.arrays().flat().texture for term in terms], [term.grid for term in terms]
    return fitted.with_textures(texels, grids, {"quantize": storage})


def _as_textures(fitted: Fitted, samples: LogSamples) -> LogSamples:
    """Return the samples in the channels of the fit's textures: spectral-basis coordinates if it has such a basis."""
    if not isinstance(fitted, SpectralFit):
        return samples
    # Linear, so that the best coordinates are those of the best logarithms.
    found = fitted.basis.coordinates(samples.logs.cpu().numpy())
    return replace(samples, logs=torch.from_numpy(found).to(samples.logs))


def quantized_terms(
    samples: LogSamples, terms: tuple[Term, ...], smoothing: Smoothing, levels: int, solved_anew: bool = True
) -> tuple[Term, ...]:
    """Return the terms with the best texels of `levels` + 1 values a channel, and their grids.

    With `solved_anew`, y is solved from these samples with the sampler's weights. Otherwise y is the texels of the
    terms, which is right if they are not the minimum of the plain problem (with clipped samples or an energy
    objective).
    """
    masks = tuple(term.mask for term in terms)
    projections = tuple(term.projection for term in terms)
    layout = layout_of_terms(terms)
    problem = inner_problem(samples, projections, layout.shapes, smoothing, masks)
    sampled = tuple(replace(lookup, fractions=FRACTIONS) for lookup in problem.lookups)
    problem = replace(problem, lookups=sampled)
    kept = problem.kept
    matrix, rhs = problem.normal()
    # Texel by texel from here on: compiled code and LAPACK, on the CPU.
    owner = layout.owners()[kept.cpu()].numpy()
    if solved_anew:
        best = scipy.linalg.cho_solve(scipy.linalg.cho_factor(matrix.cpu().numpy()), rhs.cpu().numpy())
    else:
        best = layout.join([term.texture for term in terms])[kept].cpu().numpy()
    best = _smallest_ranges(best, null_space(projections, masks)[kept].cpu().numpy(), owner)
    held = problem.data.matrix[kept][:, kept]
    everywhere = _everywhere(problem, projections)[kept][:, kept]
    total = float(samples.weights.sum())
    objective = ((held + everywhere * (total / PAIRS)) / 2 + SMOOTHNESS * (matrix - held)) / total
    closest = _Closest(objective.cpu().numpy(), owner, levels)
    found = np.zeros_like(best)
    lows, steps = np.zeros((len(terms), best.shape[1])), np.zeros((len(terms), best.shape[1]))
    for c in range(best.shape[1]):
        lows[:, c], steps[:, c] = closest.ranges(best[:, c])
        numbers = closest.numbers(best[:, c], lows[:, c], steps[:, c])
        found[:, c] = lows[owner, c] + steps[owner, c] * numbers
    textures = layout.split(problem.expand(torch.from_numpy(found)))
    result = []
    for j, (term, texture) in enumerate(zip(terms, textures, strict=True)):
        low, step = lows[j], steps[j]
        whole = filled(texture, term.mask, term.projection.axes)
        result.append(replace(term, texture=whole, grid=QuantizationGrid(low, step, levels)))
    return tuple(result)


def _everywhere(problem: LeastSquares, projections: tuple[Projection, ...]) -> Tensor:
    """Return UᵀU (T, T) of all texels for `PAIRS` pairs, half cosine-weighted and half by the scheme lobe."""
    generator = torch.Generator().manual_seed(0)
    drawn = (draw_cosine_weighted(PAIRS // 2, generator), draw_lobe(PAIRS - PAIRS // 2, generator))
    wi, wo = (torch.cat(parts).to(problem.weights.device) for parts in zip(*drawn, strict=True))
    coordinates = torch.cat([projection.prepare(wi, wo) for projection in projections], 1)
    nothing, ones = torch.zeros_like(wi[:, :1]), torch.ones_like(wi[:, 0])
    return accumulate(coordinates, problem.lookups, nothing, ones, problem.kept.shape[0]).matrix


def _smallest_ranges(texels: np.ndarray, gauge: np.ndarray, owner: np.ndarray) -> np.ndarray:
    """Move texels (K, C) along null directions (K, G) to minimize the sum of the textures' ranges."""
    count, textures = gauge.shape[1], int(owner.max()) + 1
    if count == 0:
        return texels
    moved = texels.copy()
    rows = np.arange(len(owner))
    selector = np.zeros((len(owner), textures))
    selector[rows, owner] = 1
    nothing = np.zeros_like(selector)
    # y + G a ≤ high and −(y + G a) ≤ −low, texture by texture.
    upper = np.block([[gauge, -selector, nothing], [-gauge, nothing, selector]])
    cost = np.concatenate([np.zeros(count), np.ones(textures), -np.ones(textures)])
    from scipy.optimize import linprog  # not by commands that read a fit alone

    for c in range(texels.shape[1]):
        found = linprog(cost, upper, np.concatenate([-texels[:, c], texels[:, c]]), bounds=(None, None))
        if found.status == 0:
            moved[:, c] += gauge @ found.x[:count]
    return moved


class _Closest:
    """Finds integer texels closest in the norm of `matrix` H (K, K); `owner` (K,) numbers each texel's texture."""

    def __init__(self, matrix: np.ndarray, owner: np.ndarray, levels: int) -> None:
        self.matrix, self.owner, self.levels = matrix, owner, levels
        # The last is rounded first.
        self.order = np.argsort(np.diag(matrix), kind="stable")
        self.upper = scipy.linalg.cholesky(matrix[np.ix_(self.order, self.order)])

    def numbers(self, best: np.ndarray, lows: np.ndarray, steps: np.ndarray) -> np.ndarray:
        """Return integers n (K,) in 0 … levels for which low + step n is near `best` (K,)."""
        numbers = np.empty_like(best)
        numbers[self.order] = self._round(best, lows, steps)[0]
        step = steps[self.owner]
        target = (best - lows[self.owner]) / step
        return _single_steps(self.matrix * step[:, None] * step, target, numbers, self.levels)

    def ranges(self, best: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the lowest value and step of every texture: its texels' range, shrunk while the error decreases."""
        ends = np.array(
            [[best[self.owner == j].min(), best[self.owner == j].max()] for j in range(self.owner.max() + 1)]
        )
        ends[:, 1] = np.maximum(ends[:, 1], ends[:, 0] + 1e-6)
        least = self._objective(best, ends)
        share = _FIRST_SHARE
        while share > _LAST_SHARE:
            improved = False
            for place in np.ndindex(ends.shape):
                tried = ends.copy()
                width = ends[place[0], 1] - ends[place[0], 0]
                tried[place] += share * width * (1 if place[1] == 0 else -1)
                objective = self._objective(best, tried)
                if objective < least:
                    ends, least, improved = tried, objective, True
            share = share if improved else share / 2
        return ends[:, 0], (ends[:, 1] - ends[:, 0]) / self.levels

    def _objective(self, best: np.ndarray, ends: np.ndarray) -> float:
        return self._round(best, ends[:, 0], (ends[:, 1] - ends[:, 0]) / self.levels)[1]

    def _round(self, best: np.ndarray, lows: np.ndarray, steps: np.ndarray) -> tuple[np.ndarray, float]:
        step = steps[self.owner][self.order]
        target = (best - lows[self.owner])[self.order] / step
        return _nearest_plane(self.upper, step, target, self.levels)


@kernel()
def _nearest_plane(
    upper: np.ndarray, step: np.ndarray, target: np.ndarray, levels: int
) -> tuple[np.ndarray, float]:  # pragma: no cover (compiled)
    """Return the integers n and their error Σk (Σj≥k Rkj sj (nj − tj))² for targets t, steps s and factor R."""
    count = len(target)
    numbers = np.zeros(count)
    left = np.zeros(count)
    objective = 0.0
    for k in range(count - 1, -1, -1):
        moved = 0.0
        for j in range(k + 1, count):
            moved += upper[k, j] * left[j]
        value = np.floor(target[k] - moved / (upper[k, k] * step[k]) + 0.5)
        numbers[k] = min(max(value, 0.0), float(levels))
        left[k] = step[k] * (numbers[k] - target[k])
        objective += (upper[k, k] * left[k] + moved) ** 2
    return numbers, objective


@kernel()
def _single_steps(
    matrix: np.ndarray, target: np.ndarray, numbers: np.ndarray, levels: int
) -> np.ndarray:  # pragma: no cover (compiled)
    count = len(target)
    slope = matrix @ (numbers - target)
    for _ in range(_SWEEPS):
        changed = False
        for k in range(count):
            change = np.floor(-slope[k] / matrix[k, k] + 0.5)
            value = min(max(numbers[k] + change, 0.0), float(levels))
            change = value - numbers[k]
            # A move by d changes the objective by d (2 slope + d H).
            if change * (2 * slope[k] + change * matrix[k, k]) < 0:
                numbers[k] = value
                slope += matrix[:, k] * change
                changed = True
        if not changed:
            break
    return numbers
