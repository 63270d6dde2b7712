"""The reduced objective: the error of the best texels, as a function of the projections alone.

For projections P the inner problem is linear least squares in the texels y,

    E(P, y) = Σn wn |f̃n − (B(P) y)n|² + λ'|Ly|² + δ|y|²,     R(P) = min_y E(P, y) = E(P, y*(P)).

Variable projection (Golub and Pereyra 1973): since ∂E/∂y = 0 at y*, the chain rule leaves

    dR/dP = ∂E/∂P at fixed y* = −2 Σn wn Σc rnc ∇p̃c(P xn) xnᵀ,

with r the residual and ∇p̃ the slope of the bilinear texture at the lookup: the texels' own change does not count. A
conjugate lookup has the matrix P S, so it adds its derivative times Sᵀ. The matrices come from unit quaternions and are
scaled to the texture square; both are smooth except for |·| in the scale. R has kinks where a sample crosses from one
cell of a texture to the next; there are N of them for each texture, and each is small.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import accumulate, pairwise

import torch
from torch import Tensor

from homofact.errors import SolverFailure
from homofact.factor.projection import Projection, bound_slopes, swap_of
from homofact.factor.textures import LogSamples, Smoothing, inner_problem
from homofact.geometry.rotation import Rotation
from homofact.geometry.rotation_slope import rows_with_slope
from homofact.linear.layout import Shape
from homofact.linear.least_squares import LeastSquares, minimum
from homofact.linear.normal import gradient


@dataclass(frozen=True)
class ObjectiveValue:
    """R and its gradient (V,), the weighted mean squared log error without the penalties, and the texels (T, C)."""

    value: float
    gradient: Tensor
    error: float
    texels: Tensor


class Objective:
    """R as a function of one vector: the quaternions of all searched projections, one after another.

    A projection with a `rotation` is searched (8 numbers for a pair of quaternions, 4 for one quaternion); a projection
    without a rotation is fixed. The quaternions need not be unit; they are normalised. R is divided by Σw·C, so without
    penalties it is the weighted Cole error of the samples.
    """

    def __init__(
        self,
        samples: LogSamples,
        projections: tuple[Projection, ...],
        shapes: tuple[Shape, ...],
        smoothing: Smoothing,
        bound: str = "disc",
    ) -> None:
        self._bound = bound
        self._projections = projections
        self._template = inner_problem(samples, projections, shapes, smoothing)
        self._scale = 1 / (float(samples.weights.sum()) * samples.logs.shape[1])
        self._parts = _slices(p.quaternions.size for p in projections if p.quaternions is not None)
        self._lookups = _slices(p.lookups for p in projections)
        self.evaluations = 0

    def start(self) -> Tensor:
        """Return the vector (V,) of the projections given at construction."""
        parts = [p.rotation.numbers for p in self._projections if p.rotation is not None]
        return torch.cat(parts) if parts else torch.zeros(0, dtype=torch.float64, device="cpu")

    def parts(self) -> list[slice]:
        """Return the slice of the vector that holds each searched projection."""
        return list(self._parts)

    def projections(self, vector: Tensor) -> tuple[Projection, ...]:
        """Return the projections that a vector encodes."""
        result, parts = [], iter(self._parts)
        for projection in self._projections:
            if projection.quaternions is None:
                result.append(projection)
                continue
            rotation = Rotation.of_numbers(vector[next(parts)].detach())
            result.append(
                Projection.from_rotation(
                    projection.coordinates, rotation, projection.reciprocal, self._bound, projection.warp
                )
            )
        return tuple(result)

    def problem(self, vector: Tensor) -> LeastSquares:
        """Return the inner problem at a vector."""
        lookups = list(self._template.lookups)
        for own, projection in zip(self._lookups, self.projections(vector), strict=True):
            # Fixed ones stay.
            if projection.quaternions is not None:
                pairs = zip(lookups[own], projection.matrices(), strict=True)
                lookups[own] = [replace(lookup, matrix=matrix) for lookup, matrix in pairs]
        return replace(self._template, lookups=tuple(lookups))

    def error(self, vector: Tensor) -> float:
        """Return R from the normal equations, without computing the gradient."""
        self.evaluations += 1
        return minimum(self.problem(vector))[1] * self._scale

    def evaluate(self, vector: Tensor) -> ObjectiveValue:
        """Return R with its gradient: one accumulation, one solve, one pass back over the samples."""
        problem = self.problem(vector)
        self.evaluations += 1
        texels, _ = minimum(problem)
        if not bool(torch.isfinite(texels).all()):
            raise SolverFailure("the texels are not finite: more smoothing, fewer textures or more samples")
        by_matrix, squares = gradient(problem.coordinates, problem.lookups, problem.targets, problem.weights, texels)
        value = (squares + problem.penalty(texels)) * self._scale
        slope = self._chain(vector, by_matrix.to(vector)) * self._scale
        return ObjectiveValue(value, slope, squares * self._scale, texels)

    def _chain(self, vector: Tensor, by_matrix: Tensor) -> Tensor:
        """Return the gradient by the parameter vector from the gradients by the lookup matrices (L, 2, 4)."""
        result, parts = torch.zeros_like(vector), iter(self._parts)
        for projection, own in zip(self._projections, self._lookups, strict=True):
            if projection.quaternions is None:
                continue
            system = projection.system
            by = by_matrix[own, :, : system.dimension]
            combined = by[0]
            if len(by) == 2:
                combined = combined + by[1] @ swap_of(system).T
            own = next(parts)
            rows, pulled_back = rows_with_slope(vector[own].numpy())
            result[own] = torch.from_numpy(
                pulled_back(bound_slopes(rows, combined.numpy(), system.domain, self._bound))
            )
        return result


def _slices(lengths: Iterable[int]) -> list[slice]:
    """Return the slices of consecutive pieces of these lengths."""
    return [slice(begin, end) for begin, end in pairwise(accumulate(lengths, initial=0))]


class JointObjective:
    """The mean of the objectives of several materials that have textures of their own under the same projections."""

    def __init__(self, each: tuple[Objective, ...]) -> None:
        """Join one or more objectives with the same projections and shapes."""
        self._each = each
        self.evaluations = 0

    def start(self) -> Tensor:
        """As `Objective.start`."""
        return self._each[0].start()

    def parts(self) -> list[slice]:
        """As `Objective.parts`."""
        return self._each[0].parts()

    def projections(self, vector: Tensor) -> tuple[Projection, ...]:
        """As `Objective.projections`."""
        return self._each[0].projections(vector)

    def error(self, vector: Tensor) -> float:
        """Return the mean R of all materials."""
        self.evaluations += 1
        return sum(objective.error(vector) for objective in self._each) / len(self._each)

    def evaluate(self, vector: Tensor) -> ObjectiveValue:
        """Return the mean R with its gradient; `texels` (K T, C) are all materials', one after another."""
        self.evaluations += 1
        found = [objective.evaluate(vector) for objective in self._each]
        count = len(found)
        return ObjectiveValue(
            sum(one.value for one in found) / count,
            torch.stack([one.gradient for one in found]).sum(0) / count,
            sum(one.error for one in found) / count,
            torch.cat([one.texels for one in found]),
        )
