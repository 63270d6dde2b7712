"""Solve for the textures of given projections: set up the inner problem, solve it, and fix its gauge.

This module connects projections, which work with directions, and the linear system, which works only with coordinates,
lookups and unknowns.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial

import numpy as np
import torch
from torch import Tensor

from homofact.brdf.log_transform import LogTransform
from homofact.brdf.pair_density import over_discs
from homofact.brdf.samples import Samples
from homofact.errors import Status
from homofact.factor.factorization import Term, sum_of_terms
from homofact.factor.gauge import gauge_rows
from homofact.factor.projection import Projection, Warp, layout_of
from homofact.geometry.coordinates import CoordinateSystem
from homofact.geometry.parabolic import to_disc
from homofact.linear.condition import condition_estimate, determined_share
from homofact.linear.layout import Shape, TexelLayout
from homofact.linear.least_squares import RELATIVE_RIDGE, LeastSquares, Roughness
from homofact.linear.mask import covered, filled, grown
from homofact.linear.normal import Lookup
from homofact.linear.size import is_dense
from homofact.linear.solvers import Solution, solve
from homofact.linear.sparse_solve import condition_from_below

CHUNK = 65_536
# Samples up to which their coordinates are kept: some 40 systems and warps of 4 numbers each, 20 MB.
_PLACES_KEPT = 16_384
REACH = 1 / 8  # of a texture's side: how far from the samples smoothing may fill texels
ONE_SIDED_STEPS = 12
# λ of all textures, or of each.
Smoothing = float | tuple[float, ...]


@dataclass(frozen=True)
class LogSamples:
    """Samples after the log transform, the input of the inner problem.

    `wi`, `wo` (N, 3); `logs` (N, C), f̃; `weights` (N,); `clipped` (N, C) is True where the true f̃ may be larger; None
    if it is so nowhere.
    """

    wi: Tensor
    wo: Tensor
    logs: Tensor
    weights: Tensor
    clipped: Tensor | None = None

    @classmethod
    def of(cls, samples: Samples, transform: LogTransform) -> "LogSamples":
        """Return the samples under `transform`, weighted for the Cole error: over the discs (`brdf.pair_density`)."""
        logs = transform.forward(samples.values)
        return cls(samples.wi, samples.wo, logs, over_discs(samples), samples.clipped)

    def with_more(self, more: "LogSamples") -> "LogSamples":
        """Return these samples with `more` appended."""
        pairs = ((self.wi, more.wi), (self.wo, more.wo), (self.logs, more.logs), (self.weights, more.weights))
        clipped = None
        if self.clipped is not None:
            clipped = torch.cat((self.clipped, torch.zeros_like(more.logs, dtype=torch.bool)))
        wi, wo, logs, weights = (torch.cat((one, other.to(one))) for one, other in pairs)
        return LogSamples(wi, wo, logs, weights, clipped)

    def select(self, index: Tensor) -> "LogSamples":
        """Return the samples at `index`, in that order."""
        clipped = None if self.clipped is None else self.clipped[index]
        return LogSamples(self.wi[index], self.wo[index], self.logs[index], self.weights[index], clipped)

    def place(self, projection: Projection, result: Tensor) -> None:
        """Write the coordinates (N, k) that the projection's matrix acts on into `result`.

        A search tries hundreds of mixes on a few thousand samples in the same few coordinates, so the coordinates are
        cached.
        """
        if len(self.logs) > _PLACES_KEPT:
            in_chunks(projection.prepare, self.wi, self.wo, result)
            return
        key = projection.coordinates, projection.warp
        if key not in self._places:
            self._places[key] = projection.prepare(self.wi, self.wo)
        result.copy_(self._places[key])

    @cached_property
    def _places(self) -> dict[tuple[str, Warp | None], Tensor]:
        return {}


def texture_shape(projection: Projection, size: int) -> Shape:
    """Return (rows, columns): square, or one row where the projection's second row is zero."""
    flat = bool((projection.matrix[1] == 0).all())
    return (1 if flat else size, size)


def inner_problem(
    samples: LogSamples,
    projections: tuple[Projection, ...],
    shapes: tuple[Shape, ...],
    smoothing: Smoothing,
    masks: tuple[Tensor, ...] | None = None,
    ridge: float = RELATIVE_RIDGE,
) -> LeastSquares:
    """Return the least-squares problem of the texels of all `projections` at once, texture after texture.

    Without `masks` every texel is an unknown, so that the problem does not jump as a projection moves.
    """
    width = sum(projection.system.dimension for projection in projections)
    coordinates = torch.empty(samples.wi.shape[0], width, dtype=samples.wi.dtype, device=samples.wi.device)
    layout = layout_of(projections, shapes)
    lookups, start = [], 0
    for projection, shape, offset, axes in zip(projections, shapes, layout.offsets, layout.axes, strict=True):
        end = start + projection.system.dimension
        samples.place(projection, coordinates[:, start:end])
        lookups += [Lookup(start, matrix, shape, offset, axes=axes) for matrix in projection.matrices()]
        start = end
    roughness = roughness_of(layout, samples.wi.device) if masks is None else Roughness.of(layout, masks)
    return LeastSquares(
        coordinates,
        tuple(lookups),
        samples.logs,
        samples.weights,
        layout.join(layout.whole(samples.wi.device) if masks is None else masks),
        roughness,
        per_texel(smoothing, layout),
        relative_ridge=ridge,
    )


def per_texel(smoothing: Smoothing, layout: TexelLayout) -> float | Tensor:
    """Return λ of every texel (T,), texture after texture; a single λ is returned unchanged."""
    if not isinstance(smoothing, tuple):
        return smoothing
    return layout.spread(torch.tensor(smoothing, dtype=torch.float64, device="cpu"))


@lru_cache(maxsize=32)
def roughness_of(layout: TexelLayout, device: torch.device) -> Roughness:
    """Return the smoothing rows of whole textures, shared by every evaluation of a search."""
    return Roughness.of(layout, layout.whole(device))


@dataclass(frozen=True)
class Solved:
    """Solved terms, and figures on how well the system determined them.

    `condition` is the 1-norm condition number of the normal matrix; `determined` the share of solved texels that
    samples determine, not smoothing alone; `steps` the number of iterations of the last solve, 0 for a direct solver;
    `factor` the Cholesky factor of the normal matrix, if there was one (`linear.solvers.Solution`).
    """

    terms: tuple[Term, ...]
    status: Status
    condition: float
    determined: float
    steps: int = 0
    factor: np.ndarray | None = None

    def details(self) -> dict[str, float]:
        """Return the figures by name, JSON-able, for a report."""
        return {"condition": self.condition, "determined": self.determined}


def solve_terms(
    samples: LogSamples,
    projections: tuple[Projection, ...],
    shapes: tuple[Shape, ...],
    smoothing: Smoothing,
    solver: str,
    ridge: float = RELATIVE_RIDGE,
) -> Solved:
    """Solve for the terms of fixed projections, with the constants collected in the first texture.

    The unknowns are the texels near a sample. The other texels of the projected domain get the value of the nearest
    unknown, since smoothing alone would extrapolate the outermost ramp. The gauge is fixed in closed form
    (`factor.gauge`). Clipped samples are lower bounds (`one_sided`). `ridge` is relative (`LeastSquares`).
    """
    layout = layout_of(projections, shapes)
    domains = domain_masks(projections, shapes, samples.wi.device)
    whole = inner_problem(samples, projections, shapes, smoothing, domains, ridge)
    masks = _reached(whole.diagonal, domains, layout)
    kept = layout.join(masks)
    problem = whole.within(kept, Roughness.of(layout, masks), gauge_rows(projections, masks))
    solution = solve(problem, solver)
    factor = solution.factor
    if samples.clipped is not None and bool(samples.clipped.any()):
        solution = one_sided(problem, samples.clipped, solution, solver)
    condition = solution.condition
    if condition is None:
        dense = is_dense(problem.unknowns)
        condition = condition_estimate(problem.normal()[0]) if dense else condition_from_below(problem)
    data = problem.diagonal[kept]
    terms = tuple(
        Term(projection, filled(texture, mask, projection.axes), mask)
        for projection, texture, mask in zip(projections, layout.split(solution.texels), masks, strict=True)
    )
    return Solved(
        centred(terms),
        solution.status,
        condition,
        determined_share(data, float(samples.weights.mean())),
        solution.iterations,
        factor,
    )


def one_sided(problem: LeastSquares, clipped: Tensor, solution: Solution, solver: str) -> Solution:
    """Return the solution with `clipped` (N, C) values as lower bounds, starting from the plain `solution`.

    The objective is Σ w r² over unclipped values + Σ w max(r, 0)² over clipped values, with r = f̃ − By. It is convex,
    and quadratic for a fixed set of clipped values whose fit is above the bound (r < 0). Each solution gives a new set,
    and the solve is repeated per channel until the set no longer changes. Channels without clipped values keep their
    texels.
    """
    texels = solution.texels.clone()
    for channel in clipped.any(0).nonzero()[:, 0].tolist():
        own = replace(problem, targets=problem.targets[:, channel : channel + 1])
        found = texels[:, channel : channel + 1]
        over = torch.zeros_like(clipped[:, channel])
        for _ in range(ONE_SIDED_STEPS):
            now = clipped[:, channel] & (own.residuals(found)[:, 0] < 0)
            if torch.equal(now, over):
                break
            over = now
            found = solve(replace(own, weights=torch.where(over, 0.0, problem.weights)), solver).texels
        texels[:, channel] = found[:, 0]
    return replace(solution, texels=texels)


def _reached(diagonal: Tensor, domains: tuple[Tensor, ...], layout: TexelLayout) -> tuple[Tensor, ...]:
    """Return the texels of each domain that samples read, grown by `REACH` times the texture's side."""
    masks = []
    for domain, own, axes in zip(domains, layout.split(diagonal), layout.axes, strict=True):
        steps = max(1, round(REACH * max(domain.shape)))
        masks.append(domain & grown(own > 0, steps, axes))
    return tuple(masks)


def centred(terms: tuple[Term, ...]) -> tuple[Term, ...]:
    """Return the same sum with zero mean (over the mask) in every texture but the first, which takes the constants.

    Moving a constant c out of a texture with m lookups changes the sum by m·c.
    """
    first, *rest = terms
    moved = torch.zeros_like(first.texture[0, 0])
    centred_rest = []
    for term in rest:
        mean = term.texture[term.mask].mean(0)
        moved = moved + mean * term.projection.lookups
        centred_rest.append(replace(term, texture=term.texture - mean))
    head = replace(first, texture=first.texture + moved / first.projection.lookups)
    return (head, *centred_rest)


def domain_masks(
    projections: tuple[Projection, ...], shapes: tuple[Shape, ...], device: torch.device | str = "cpu"
) -> tuple[Tensor, ...]:
    """Return `domain_mask` of every texture, on a device."""
    return tuple(domain_mask(p, shape).to(device) for p, shape in zip(projections, shapes, strict=True))


def domain_mask(projection: Projection, shape: Shape) -> Tensor:
    """Mask (rows, columns) of the texels that the projected domain reaches, conjugate lookups included."""
    points = extreme_points(projection.system)
    if projection.warp is not None:
        points = projection.warp.on(projection.system, points)
    reached = [covered(points @ matrix.to(points).T, shape, projection.axes) for matrix in projection.matrices()]
    return torch.stack(reached).any(0)


@lru_cache(maxsize=8)
def extreme_points(system: CoordinateSystem) -> Tensor:
    """Return points (M, k) whose convex hull contains the domain: the corners of a box, or points around two discs."""
    if system.domain == "box":
        corners = torch.tensor([-1.0, 1.0], dtype=torch.float64, device="cpu")
        return torch.cartesian_prod(*[corners] * system.dimension)
    angle = torch.arange(48, dtype=torch.float64, device="cpu") * (2 * torch.pi / 48)
    # Circumscribed, so that the hull of 48 points contains the disc.
    radius = 1 / math.cos(math.pi / 48)
    rim = to_disc(torch.stack((torch.cos(angle), torch.sin(angle), torch.zeros_like(angle)), -1)) * radius
    return torch.cat((rim.repeat_interleave(48, 0), rim.repeat(48, 1)), 1)


def residual(samples: LogSamples, terms: tuple[Term, ...]) -> Tensor:
    """Return f̃ minus what `terms` already explain, (N, C)."""
    if not terms:
        return samples.logs
    explained = torch.empty_like(samples.logs)
    in_chunks(partial(sum_of_terms, terms), samples.wi, samples.wo, explained)
    return samples.logs - explained


def in_chunks(function: Callable[[Tensor, Tensor], Tensor], wi: Tensor, wo: Tensor, result: Tensor) -> None:
    """Write the values of `function` at pairs (N, 3) into `result` (N, k), `CHUNK` pairs at a time.

    The temporary memory of a chunk (frames, stencils) is many times its result, but it does not grow with N.
    """
    for begin in range(0, wi.shape[0], CHUNK):
        result[begin : begin + CHUNK] = function(wi[begin : begin + CHUNK], wo[begin : begin + CHUNK])
