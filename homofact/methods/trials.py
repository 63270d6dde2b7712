"""Trials of a mix of textures: cross-validation, evaluation at the current projections, and descent.

A `FitBudget` limits the work; equal budgets give equal results.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from homofact.errors import Status
from homofact.factor.projection import Projection
from homofact.factor.search.minimize import Minimizer, minimize
from homofact.factor.textures import texture_shape
from homofact.linear.threads import in_parallel
from homofact.methods.effort import FitBudget, cost_of_solve
from homofact.methods.folded import JointFolded, Judging
from homofact.methods.known_mixes import NONE, KnownMixes
from homofact.methods.materials import Materials
from homofact.methods.mix import Mix, is_movable, scale_of

DESCENTS = 0.625  # of the search's texture size: what projections descend with before the last time
ASIDE = 1e-3  # of a quaternion's length: how far beside its projections a descent starts
_POLISH = 40  # iterations of the winner's last descent


@dataclass(frozen=True)
class StructureSettings:
    """Texels along an axis, reciprocity and bound of every trial; random starts of searched kinds; λ where given.

    If `reciprocal` is None, trials are reciprocal until non-reciprocal mixes reduce the error below the share
    `FREE_WORTH`. If there are `known` mixes, only these are tried, and the best few (`descending`) are refined;
    otherwise every mix is tried. `every_level` requests the best mix for each number of textures, not only for the last
    one.
    """

    size: int
    reciprocal: bool | None
    bound: str
    restarts: int
    search: Minimizer
    smoothing: float | None
    seed: int
    known: KnownMixes = NONE
    descending: int = 3
    every_level: bool = False


class Trials:
    """The data for trying mixes, and the budget for this work."""

    def __init__(self, materials: Materials, settings: StructureSettings, budget: FitBudget) -> None:
        """Create trials without results."""
        self.materials, self.settings, self.budget = materials, settings, budget

    def cost(self, mix: Mix, share: float = 1.0) -> float:
        """Return units of one evaluation of a mix, with textures of `share` times the search's size."""
        texels = sum(rows * columns for rows, columns in self.shapes(mix.projections, share))
        lookups = sum(projection.lookups for projection in mix.projections)
        return self.materials.cost(lookups, texels)

    def beside(self, function: Callable, pieces: list) -> list:
        """Apply the function to all pieces, in parallel if the search allows it, and add up their budgets."""
        run = in_parallel if self.settings.search.independent else (lambda apply, all: [apply(one) for one in all])
        results = run(function, pieces)
        for _, budget in results:
            self.budget.add(budget)
        return [result for result, _ in results]

    def shapes(self, projections: tuple[Projection, ...], share: float = 1.0) -> tuple[tuple[int, int], ...]:
        """Return (rows, columns) of the projections' textures, at `share` times the search's size."""
        size = max(2, round(share * self.settings.size))
        return tuple(texture_shape(projection, size) for projection in projections)

    def smoothed(
        self, folded: Judging, start: tuple[float, ...], budget: FitBudget, separately: bool
    ) -> tuple[tuple[float, ...], float]:
        """Return (λ of every texture, error): the given λ, the best common λ, or (`separately`) the best of each."""
        if self.settings.smoothing is not None:
            return self.judged(folded, (self.settings.smoothing,) * len(start), budget)
        # λ is found on one fold of each partition, the mix is judged by all of them.
        smoothing, _ = folded.best_smoothing(start, budget, 1)
        if separately and len(start) > 1:
            smoothing, _ = folded.best_each(smoothing, budget, folds=1)
        return self.judged(folded, smoothing, budget)

    def judged(
        self, folded: Judging, smoothing: tuple[float, ...], budget: FitBudget, folds: int | None = None
    ) -> tuple[tuple[float, ...], float]:
        """Return (the given λ of every texture, the error on `folds` left-out folds of each partition, or on all)."""
        budget.spend(folded.solves(folds) * cost_of_solve(folded.unknowns))
        return smoothing, folded.error(smoothing, folds)

    def polished(self, mix: Mix, alike: bool = True) -> tuple[Mix, FitBudget]:
        """Return (the mix with its best λ for each texture, after a longer descent with these λ, budget).

        The search for λ starts from one λ for all textures, or from the mix's own if `alike` is False.
        """
        budget = self.budget.beside()
        folded = self.folded(mix, budget)
        start = (scale_of(mix.smoothing),) * len(mix.kinds) if alike else mix.smoothing
        smoothing, error = self.smoothed(folded, start, budget, separately=True)
        mix = replace(mix, smoothing=smoothing, error=error)
        if not is_movable(mix):
            return mix, budget
        (_, moved), more = self.descended(mix, None, _POLISH, 1.0)
        budget.add(more)
        _, error = self.judged(self.folded(moved, budget), smoothing, budget)
        return min(mix, replace(moved, error=error), key=lambda candidate: candidate.error), budget

    def descended(self, mix: Mix, scale: float | None, steps: int, share: float) -> tuple[tuple[float, Mix], FitBudget]:
        """Move all projections together, with λ `scale` or (None) the mix's; return ((R, new mix), budget).

        The textures have `share` times the search's size. R is the reduced objective.
        """
        budget = self.budget.beside()
        smoothing = mix.smoothing if scale is None else (scale,) * len(mix.kinds)
        shapes = self.shapes(mix.projections, share)
        objective = self.materials.objective(mix.projections, shapes, smoothing, self.settings.bound)
        left = max(budget.deadline - time.perf_counter(), 1e-3)
        start = aside(objective.start())
        vector, report = minimize(
            self.settings.search.limited(steps), objective, start, seconds=left, seed=self.settings.seed
        )
        budget.spend(report.evaluations * self.cost(mix, share), report.evaluations)
        if report.status is Status.INTERRUPTED:
            raise KeyboardInterrupt
        return (report.residual, replace(mix, projections=objective.projections(rounded(vector)))), budget

    def looked(self, mix: Mix, scale: float) -> tuple[float, FitBudget]:
        """Return (R, budget), with the reduced objective R at the mix's current projections."""
        budget = self.budget.beside()
        shapes = self.shapes(mix.projections, DESCENTS)
        smoothing = (scale,) * len(mix.kinds)
        objective = self.materials.objective(mix.projections, shapes, smoothing, self.settings.bound)
        budget.spend(self.cost(mix, DESCENTS))
        return objective.error(objective.start()), budget

    def judge(self, mix: Mix, scale: float | None) -> tuple[Mix, FitBudget]:
        """Return (the mix with the best common λ, searched from `scale`, or with its own λ scaled (None), budget)."""
        budget = self.budget.beside()
        folded = self.folded(mix, budget)
        start = mix.smoothing if scale is None else (scale,) * len(mix.kinds)
        smoothing, error = self.smoothed(folded, start, budget, separately=False)
        return replace(mix, smoothing=smoothing, error=error), budget

    def glanced(self, mix: Mix, share: float = DESCENTS) -> tuple[Mix, FitBudget]:
        """Judge a mix from its own λ, as `judge`, at `share` times the search's size with only one fold left out."""
        budget = self.budget.beside()
        budget.spend(self.cost(mix, share))
        folded = self.materials.folded(mix.projections, self.shapes(mix.projections, share), 1)
        given = self.settings.smoothing
        if given is None:
            smoothing, error = folded.best_smoothing(mix.smoothing, budget, 1)
        else:
            smoothing, error = self.judged(folded, (given,) * len(mix.kinds), budget, 1)
        return replace(mix, smoothing=smoothing, error=error), budget

    def folded(self, mix: Mix, budget: FitBudget) -> JointFolded:
        """Return the mix's equations, fold by fold."""
        budget.spend(self.cost(mix))
        return self.materials.folded(mix.projections, self.shapes(mix.projections))


def aside(vector: Tensor) -> Tensor:
    """Return the vector (V,) with a small offset, which is always the same.

    At a fixed projection, symmetry makes the gradient zero up to rounding errors, which differ between machines. A
    descent that starts there would amplify them.
    """
    return vector + ASIDE * torch.sin(1 + torch.arange(len(vector), dtype=vector.dtype, device=vector.device))


def rounded(vector: Tensor) -> Tensor:
    """Quaternions (V,) of unit length on a grid of 2⁻¹⁴.

    Rounding errors in the last bits differ between processors, and a descent amplifies them. Rounding the result of
    every descent removes them, so that all machines end in the same projections.
    """
    quaternions = vector.reshape(-1, 4)
    return torch.round(quaternions / quaternions.norm(dim=1, keepdim=True) * 2**14).reshape(-1) / 2**14
