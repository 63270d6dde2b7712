"""Cross-validation of the inner problem, at the price of one accumulation.

The samples are dealt into folds; the normal equations of the whole are the sum of the folds', so leaving
a fold out is a subtraction, and the error on it is the quadratic form of its own equations. Neither
touches the samples again: a λ costs one factorization a fold. Copies of one measurement at other
azimuths belong into one fold, or the left-out fold is known from its copies.
"""

from dataclasses import dataclass, replace

import torch
from torch import Tensor

from homofact.factor.projection import Projection
from homofact.factor.textures import LogSamples, Shape, inner_problem
from homofact.linear.least_squares import Roughness, penalised_matrix
from homofact.linear.normal import NormalEquations
from homofact.linear.solvers import solve_definite

SMOOTHING_STEP = 10**0.5
SMOOTHING_RANGE = (1e-7, 1e2)


def deal_folds(count: int, folds: int, seed: int) -> Tensor:
    """A fold number (count,) for every sample, sizes as equal as can be, dealt by `seed`."""
    order = torch.randperm(count, generator=torch.Generator().manual_seed(seed))
    result = torch.empty(count, dtype=torch.int64)
    result[order] = torch.arange(count) % folds
    return result


@dataclass(frozen=True)
class Folded:
    """The normal equations of each fold for fixed projections, ready to be asked about any λ."""

    parts: tuple[NormalEquations, ...]
    roughness: Roughness
    lookups: int

    @classmethod
    def of(
        cls, samples: LogSamples, folds: Tensor, projections: tuple[Projection, ...], shapes: tuple[Shape, ...]
    ) -> "Folded":
        """Accumulate `samples`, fold by fold (`folds` numbers each sample's)."""
        whole = inner_problem(samples, projections, shapes, 0.0)
        parts = []
        for fold in range(int(folds.max()) + 1):
            own = folds == fold
            part = replace(
                whole, coordinates=whole.coordinates[own], targets=whole.targets[own], weights=whole.weights[own]
            )
            parts.append(part.data)
        return cls(tuple(parts), whole.roughness, len(whole.lookups))

    def error(self, smoothing: float) -> float:
        """Weighted mean squared log error of every fold under the texels of all others, with this λ."""
        total, weight = 0.0, 0.0
        every = _sum(self.parts)
        for part in self.parts:
            rest = NormalEquations(
                every.matrix - part.matrix, every.rhs - part.rhs, every.energy - part.energy, every.weight - part.weight
            )
            matrix = penalised_matrix(rest, self.roughness, smoothing, self.lookups)
            total += part.error(solve_definite(matrix, rest.rhs)[0]) * part.weight
            weight += part.weight
        return total / weight

    def best_smoothing(self, start: float, stride: int = 1) -> tuple[float, float]:
        """(λ, error) of a descent from `start` over a grid of `stride` half decades, looking two steps ahead."""
        known: dict[int, float] = {}

        def error(step: int) -> float:
            if step not in known:
                known[step] = self.error(start * SMOOTHING_STEP**step)
            return known[step]

        def allowed(step: int) -> bool:
            low, high = SMOOTHING_RANGE
            return low <= start * SMOOTHING_STEP**step <= high

        here = 0
        while True:
            near = [step for step in (here - stride, here + stride) if allowed(step)]
            best = min([here, *near], key=error)
            if best == here and stride == 1:
                # Over a small bump of the validation error.
                far = [step for step in (here - 2, here + 2) if allowed(step)]
                best = min([here, *far], key=error)
            if best == here:
                return start * SMOOTHING_STEP**here, error(here)
            here = best


def _sum(parts: tuple[NormalEquations, ...]) -> NormalEquations:
    first, *rest = parts
    matrix, rhs, energy, weight = first.matrix.clone(), first.rhs.clone(), first.energy.clone(), first.weight
    for part in rest:
        matrix += part.matrix
        rhs += part.rhs
        energy += part.energy
        weight += part.weight
    return NormalEquations(matrix, rhs, energy, weight)
