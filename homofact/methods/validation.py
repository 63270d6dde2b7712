"""Cross-validation of the inner problem, at the price of one accumulation.

The samples are dealt into folds; the normal equations of the whole are the sum of the folds', so leaving
a fold out is a subtraction, and the error on it is the quadratic form of its own equations. Neither
touches the samples again: a λ costs one factorization a fold. Copies of one measurement at other
azimuths belong into one fold, or the left-out fold is known from its copies.

A goniometer measures on rings: few incident angles, few exitant ones, many azimuths, and each ring has
faults of its own. Left-out samples of such a set always have neighbours on their own rings, so random folds
reward a fit that knows every ring and nothing between them; on a sphere that shows as bands. So a gridded
set is judged by leaving out whole rings, of θi and of θo by halves; the outermost stay, since beyond them is
extrapolation. Random folds are for samples that lie on no rings, or where they are asked for.
"""

import time
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from homofact.brdf.samples import Samples
from homofact.brdf.symmetry import ring_numbers
from homofact.factor.projection import Projection
from homofact.factor.textures import LogSamples, Shape, Smoothing, inner_problem, per_texel
from homofact.linear.least_squares import Roughness, penalised_matrix
from homofact.linear.normal import NormalEquations
from homofact.linear.solvers import solve_definite

SMOOTHING_STEP = 10**0.5
SMOOTHING_RANGE = (1e-7, 1e2)
RING_FOLDS = 3


def deal_folds(count: int, folds: int, seed: int) -> Tensor:
    """A fold number (count,) for every sample, sizes as equal as can be, dealt by `seed`."""
    order = torch.randperm(count, generator=torch.Generator().manual_seed(seed))
    result = torch.empty(count, dtype=torch.int64)
    result[order] = torch.arange(count) % folds
    return result


@dataclass(frozen=True)
class Partition:
    """A dealing of samples into folds (N,) int64, −1 for those never left out, and its share of the judgement."""

    folds: Tensor
    share: float

    def select(self, index: Tensor) -> "Partition":
        """The dealing of the samples at `index`."""
        return Partition(self.folds[index], self.share)

    def repeated(self, times: int) -> "Partition":
        """The dealing of `times` copies of all samples, one after another."""
        return Partition(self.folds.repeat(times), self.share)


def deal(samples: Samples, folds: int, seed: int, *, rings: bool) -> tuple[Partition, ...]:
    """How to judge a fit of `samples`: by left-out rings where they lie on rings and `rings` is set, else at random."""
    found = [_rings(direction) for direction in (samples.wi, samples.wo)] if rings else []
    found = [ring for ring in found if ring is not None]
    if not found:
        return (Partition(deal_folds(len(samples), folds, seed), 1.0),)
    return tuple(Partition(ring, 1 / len(found)) for ring in found)


def _rings(direction: Tensor) -> Tensor | None:
    """Folds (N,) of the inner rings of one direction's θ, neighbours apart; None where it does not lie on rings."""
    found = ring_numbers(direction)
    if found is None:
        return None
    rank, count = found
    inner = (rank > 0) & (rank < count - 1)
    return torch.where(inner, rank % RING_FOLDS, torch.full_like(rank, -1))


@dataclass(frozen=True)
class Folded:
    """The normal equations of every fold for fixed projections, ready to be asked about any λ."""

    parts: tuple[tuple[NormalEquations, ...], ...]
    shares: tuple[float, ...]
    whole: NormalEquations
    roughness: Roughness
    lookups: int
    shapes: tuple[Shape, ...]

    @classmethod
    def of(
        cls,
        samples: LogSamples,
        partitions: tuple[Partition, ...],
        projections: tuple[Projection, ...],
        shapes: tuple[Shape, ...],
    ) -> "Folded":
        """Accumulate `samples`, fold by fold of every partition."""
        problem = inner_problem(samples, projections, shapes, 0.0)

        def accumulated(own: Tensor) -> NormalEquations:
            return replace(
                problem,
                coordinates=problem.coordinates[own],
                targets=problem.targets[own],
                weights=problem.weights[own],
            ).data

        parts = tuple(
            tuple(accumulated(partition.folds == fold) for fold in partition.folds.unique().tolist() if fold >= 0)
            for partition in partitions
        )
        shares = tuple(partition.share for partition in partitions)
        return cls(parts, shares, problem.data, problem.roughness, len(problem.lookups), shapes)

    def error(self, smoothing: Smoothing) -> float:
        """Mean squared log error of the left-out samples under the texels of all others, with this λ.

        Weighted by the samples' weights within a partition, by the shares between partitions.
        """
        result = 0.0
        spread = per_texel(smoothing, self.shapes)
        for parts, share in zip(self.parts, self.shares, strict=True):
            total, weight = 0.0, 0.0
            for part in parts:
                rest = NormalEquations(
                    self.whole.matrix - part.matrix,
                    self.whole.rhs - part.rhs,
                    self.whole.energy - part.energy,
                    self.whole.weight - part.weight,
                )
                matrix = penalised_matrix(rest, self.roughness, spread, self.lookups)
                total += part.error(solve_definite(matrix, rest.rhs)[0]) * part.weight
                weight += part.weight
            result += share * total / weight
        return result

    def best_smoothing(
        self, start: tuple[float, ...], deadline: float = float("inf")
    ) -> tuple[tuple[float, ...], float]:
        """(λ of every texture, error): from `start` downhill with all of them scaled alike, in decades.

        No step is begun after `deadline` (on the clock of time.perf_counter).
        """
        return self._descend(start, [tuple(range(len(start)))], 2, deadline)

    def best_each(
        self, start: tuple[float, ...], stride: int = 2, deadline: float = float("inf")
    ) -> tuple[tuple[float, ...], float]:
        """(λ of every texture, error): downhill one texture after another, in `stride` half decades.

        No step is begun after `deadline` (on the clock of time.perf_counter).
        """
        return self._descend(start, [(j,) for j in range(len(start))], stride, deadline)

    def _descend(
        self,
        start: tuple[float, ...],
        groups: list[tuple[int, ...]],
        stride: int,
        deadline: float,
    ) -> tuple[tuple[float, ...], float]:
        best, lowest = start, self.error(start)
        for group in groups:
            for direction in (stride, -stride):
                moved = False
                while True:
                    trial = tuple(
                        value * SMOOTHING_STEP**direction if j in group else value for j, value in enumerate(best)
                    )
                    low, high = SMOOTHING_RANGE
                    if not all(low <= trial[j] <= high for j in group) or time.perf_counter() > deadline:
                        break
                    error = self.error(trial)
                    if error >= lowest:
                        break
                    best, lowest, moved = trial, error, True
                if moved:
                    break
        return best, lowest
