"""Cross-validation of the inner problem, at the price of one accumulation.

The normal equations of all samples are the sum of the folds', so leaving a fold out is a subtraction, and the error on
it is the quadratic form of its own equations. Neither step reads the samples again: each λ costs one matrix
factorization per fold.

The same holds for textures: the equations of some of them are a block of the equations of all. All fixed projections
are therefore accumulated together, once, and every mix of them is judged from its block (`FixedBank`).
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from homofact.factor.projection import Projection, layout_of
from homofact.factor.textures import LogSamples, Smoothing, inner_problem, per_texel, roughness_of
from homofact.linear.layout import Shape, TexelLayout
from homofact.linear.least_squares import Roughness, solve_penalised
from homofact.linear.normal import NormalEquations, total
from homofact.linear.threads import in_parallel
from homofact.methods.effort import FitBudget, cost_of_solve
from homofact.methods.validation import Partition

_SMOOTHING_STEP = 10**0.5
_SMOOTHING_RANGE = (1e-7, 1e2)


class Judging(ABC):
    """Equations for cross-validation: they give the error on left-out samples for a λ, and find the best λ."""

    @property
    @abstractmethod
    def unknowns(self) -> int:
        """T, the texels of all textures."""

    @abstractmethod
    def error(self, smoothing: Smoothing, folds: int | None = None) -> float:
        """Return the mean squared log error on left-out samples with this λ, over `folds` folds or all."""

    @abstractmethod
    def solves(self, folds: int | None = None) -> int:
        """Return how many systems `error` solves."""

    def best_smoothing(
        self, start: tuple[float, ...], budget: FitBudget, folds: int | None = None
    ) -> tuple[tuple[float, ...], float]:
        """Return (λ of every texture, error), searched downhill from `start` by scaling all λ together, in decades.

        `folds` has the same meaning as in `error`.
        """
        return self._descend(start, [tuple(range(len(start)))], 2, budget, folds)

    def best_each(
        self, start: tuple[float, ...], budget: FitBudget, stride: int = 2, folds: int | None = None
    ) -> tuple[tuple[float, ...], float]:
        """Return (λ of every texture, error), searched for each texture in steps of `stride` half decades."""
        return self._descend(start, [(j,) for j in range(len(start))], stride, budget, folds)

    def _descend(
        self,
        start: tuple[float, ...],
        groups: list[tuple[int, ...]],
        stride: int,
        budget: FitBudget,
        folds: int | None,
    ) -> tuple[tuple[float, ...], float]:
        """Descend from `start`; begin no step after the budget is spent, but always evaluate the start."""

        def judged(smoothing: tuple[float, ...]) -> float:
            budget.spend(self.solves(folds) * cost_of_solve(self.unknowns))
            return self.error(smoothing, folds)

        best, lowest = start, judged(start)
        low, high = _SMOOTHING_RANGE
        for group in groups:
            for direction in (stride, -stride):
                moved = False
                while not budget.over:
                    trial = tuple(
                        value * _SMOOTHING_STEP**direction if j in group else value for j, value in enumerate(best)
                    )
                    if not all(low <= trial[j] <= high for j in group):
                        break
                    error = judged(trial)
                    if error >= lowest:
                        break
                    best, lowest, moved = trial, error, True
                if moved:
                    break
        return best, lowest


@dataclass(frozen=True)
class Folded(Judging):
    """The normal equations of every fold for fixed projections, from which the error for any λ is computed.

    `parts` are the equations of the folds of every partition, `shares` the weights of the partitions in the error, and
    `whole` the equations of all samples.
    """

    parts: tuple[tuple[NormalEquations, ...], ...]
    shares: tuple[float, ...]
    whole: NormalEquations
    roughness: Roughness
    lookups: int
    layout: TexelLayout

    @classmethod
    def of(
        cls,
        samples: LogSamples,
        partitions: tuple[Partition, ...],
        projections: tuple[Projection, ...],
        shapes: tuple[Shape, ...],
        most: int | None = None,
    ) -> "Folded":
        """Accumulate `samples` for every fold of every partition; `most` limits the folds that can be left out."""
        problem = inner_problem(samples, projections, shapes, 0.0)

        def accumulated(own: Tensor) -> NormalEquations:
            return replace(
                problem,
                coordinates=problem.coordinates[own],
                targets=problem.targets[own],
                weights=problem.weights[own],
            ).data

        # The first partition's samples that are never left out are a piece too, so that its pieces add up to all.
        limited = [
            torch.where(partition.folds < (most or len(samples.logs)), partition.folds, -1).clamp_min(-1)
            for partition in partitions
        ]
        pieces = [
            (number, fold)
            for number, folds in enumerate(limited)
            for fold in folds.unique().tolist()
            if fold >= 0 or number == 0
        ]
        made = in_parallel(lambda piece: accumulated(limited[piece[0]] == piece[1]), pieces)
        equations = list(zip(pieces, made, strict=True))
        whole = total([part for (number, _), part in equations if number == 0])
        parts = tuple(
            tuple(part for (owner, fold), part in equations if owner == number and fold >= 0)
            for number in range(len(partitions))
        )
        shares = tuple(partition.share for partition in partitions)
        return cls(parts, shares, whole, problem.roughness, len(problem.lookups), layout_of(projections, shapes))

    def error(self, smoothing: Smoothing, folds: int | None = None) -> float:
        """Return the mean squared log error on left-out samples, with texels solved from the others with this λ.

        The mean uses the samples' weights within a partition, and `shares` between partitions. `folds` limits the
        number of left-out folds per partition, for a cheaper first estimate.
        """
        spread = per_texel(smoothing, self.layout)
        chosen = [parts[:folds] for parts in self.parts]

        def left_out(part: NormalEquations) -> float:
            texels = solve_penalised(self.whole, self.roughness, spread, self.lookups, part)
            return part.error(texels) * part.weight

        errors = iter(in_parallel(left_out, [part for parts in chosen for part in parts]))
        return sum(
            share * sum(next(errors) for _ in parts) / sum(part.weight for part in parts)
            for share, parts in zip(self.shares, chosen, strict=True)
        )

    def solves(self, folds: int | None = None) -> int:
        """Return how many systems `error` solves."""
        return sum(len(parts[:folds]) for parts in self.parts)

    @property
    def unknowns(self) -> int:
        """T, the texels of all textures."""
        return int(self.whole.matrix.shape[0])


@dataclass(frozen=True)
class JointFolded(Judging):
    """The equations of several materials under the same projections, judged by the mean of their errors."""

    materials: tuple[Folded, ...]

    @property
    def unknowns(self) -> int:
        """T, the texels of one material's textures."""
        return self.materials[0].unknowns

    def error(self, smoothing: Smoothing, folds: int | None = None) -> float:
        """Return the mean of the materials' left-out errors, all with this λ."""
        return sum(folded.error(smoothing, folds) for folded in self.materials) / len(self.materials)

    def solves(self, folds: int | None = None) -> int:
        """Return how many systems `error` solves."""
        return sum(folded.solves(folds) for folded in self.materials)


@dataclass(frozen=True)
class FixedBank:
    """Fixed projections accumulated together, and the equations of any mix of them."""

    projections: tuple[Projection, ...]
    folded: Folded

    @classmethod
    def of(
        cls,
        samples: LogSamples,
        partitions: tuple[Partition, ...],
        projections: tuple[Projection, ...],
        shapes: tuple[Shape, ...],
    ) -> "FixedBank":
        """Accumulate all of `projections` in one pass."""
        return cls(projections, Folded.of(samples, partitions, projections, shapes))

    def mix(self, chosen: tuple[int, ...]) -> Folded:
        """Return the equations of the projections at `chosen`, in that order: a block of the whole matrix."""
        folded = self.folded
        ends = [begin + count for begin, count in zip(folded.layout.offsets, folded.layout.counts, strict=True)]
        slices = [slice(folded.layout.offsets[j], ends[j]) for j in chosen]
        unknowns = torch.cat([torch.arange(piece.start, piece.stop) for piece in slices])

        def block(equations: NormalEquations) -> NormalEquations:
            cut = torch.cat([torch.cat([equations.matrix[rows, columns] for columns in slices], 1) for rows in slices])
            return NormalEquations(cut, equations.rhs[unknowns], equations.energy, equations.weight)

        layout = TexelLayout(
            tuple(folded.layout.shapes[j] for j in chosen), tuple(folded.layout.axes[j] for j in chosen)
        )
        return Folded(
            tuple(tuple(map(block, parts)) for parts in folded.parts),
            folded.shares,
            block(folded.whole),
            roughness_of(layout, folded.whole.matrix.device),
            sum(self.projections[j].lookups for j in chosen),
            layout,
        )
