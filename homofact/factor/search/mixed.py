"""The search over whole mixes: which kind each texture is, where its projection points, which λ and warp.

Textures are added one at a time. Each candidate kind is tried beside those already chosen, all textures
solved together, and judged by cross-validation with its own best λ; searched kinds are first refined
from several random starts, of which the losers stop early (successive halving). After every term the
searched projections are refined jointly, and each earlier texture is tried as every other fixed kind.
All of this runs on small textures and a subset of the samples; the projections carry over (thesis 4.2).
The search ends when the textures are used up, when one more does not lower the validation error, or
when the time is; what it returns is always the best finished mix.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from homofact.errors import Status
from homofact.factor.kinds import WARP_WIDTHS, is_searched, make, takes_warp
from homofact.factor.objective import Objective
from homofact.factor.projection import Projection, Warp
from homofact.factor.search.best import Search
from homofact.factor.textures import LogSamples, texture_shape
from homofact.factor.validation import Folded

FIRST_SMOOTHING = 1e-3
ENOUGH = 0.995  # a texture is worth having when it leaves less than this share of the validation error


@dataclass(frozen=True)
class Mix:
    """Chosen projections with their kinds, the λ that goes with them, and their validation error."""

    kinds: tuple[str, ...]
    projections: tuple[Projection, ...]
    smoothing: float
    error: float


@dataclass(frozen=True)
class Outcome:
    """What a mixed search found, how it ended, and what it cost; `notes` are for the user."""

    mix: Mix
    status: Status
    evaluations: int
    trace: tuple[tuple[float, int, float], ...]
    notes: tuple[str, ...]


class MixedSearch:
    """One run over coarse samples; make one, call `run` once."""

    def __init__(
        self,
        samples: LogSamples,
        folds: Tensor,
        *,
        size: int,
        reciprocal: bool,
        bound: str,
        restarts: int,
        search: Search,
        seconds: float,
        smoothing: float | None,
        seed: int,
        progress: Callable[[int, int, int, float], None] | None = None,
    ) -> None:
        """`progress` is called with (term, candidate number, evaluations, best validation error)."""
        self._samples, self._folds, self._size = samples, folds, size
        self._reciprocal, self._bound, self._restarts, self._search = reciprocal, bound, restarts, search
        self._smoothing, self._seed, self._progress = smoothing, seed, progress
        self._generator = torch.Generator().manual_seed(seed)
        self._began = time.perf_counter()
        self._deadline = self._began + seconds
        self._evaluations = 0
        self._trace: list[tuple[float, int, float]] = []

    def run(self, textures: int, candidates: tuple[tuple[str, ...], ...]) -> Outcome:
        """Choose up to `textures` textures; `candidates[j]` are the kinds that texture j may be."""
        best: Mix | None = None
        notes: list[str] = []
        status = Status.CONVERGED
        try:
            for term in range(textures):
                found = self._add(best, candidates[min(term, len(candidates) - 1)], term)
                if found is None:
                    status = Status.BUDGET
                    notes.append(f"the time was up after {term} of {textures} textures: give it a larger budget")
                    break
                if best is not None and found.error > ENOUGH * best.error and len(candidates) == 1:
                    notes.append(f"{term} of {textures} textures kept: one more does not lower the validation error")
                    break
                best = found
                self._note(best.error)
                if term > 0 and len(candidates) == 1:
                    best = self._exchange(best, candidates[0], term)
        except KeyboardInterrupt:
            if best is None:
                raise
            status = Status.INTERRUPTED
            notes.append(f"interrupted after {len(best.kinds)} of {textures} textures")
        assert best is not None  # the first texture's first candidate is tried whatever the time
        return Outcome(best, status, self._evaluations, tuple(self._trace), tuple(notes))

    def _add(self, base: Mix | None, kinds: tuple[str, ...], term: int) -> Mix | None:
        """The best mix with one more texture, or None where the time is up before one was tried."""
        best: Mix | None = None
        for number, kind in enumerate(kinds, 1):
            if self._late() and (best is not None or base is not None):
                break
            trial = self._try(base, kind)
            if best is None or trial.error < best.error:
                best = trial
            if self._progress is not None:
                self._progress(term + 1, number, self._evaluations, best.error)
        return best

    def _try(self, base: Mix | None, kind: str) -> Mix:
        """The mix `base` with one more texture of this kind, refined where it has something to refine."""
        kinds = (kind,) if base is None else (*base.kinds, kind)
        earlier = () if base is None else base.projections
        smoothing = FIRST_SMOOTHING if base is None else base.smoothing
        warps: list[Warp | None] = [next((p.warp for p in earlier if p.warp is not None), None)]
        if takes_warp(kind) and warps == [None]:
            warps += [Warp(width) for width in WARP_WIDTHS]
        trials = []
        for warp in warps:
            if self._late() and trials:
                break
            if is_searched(kind):
                projections = self._refined_start(earlier, kind, warp, smoothing)
            else:
                projections = (*earlier, self._make(kind, warp))
            trials.append(self._judge(kinds, projections, smoothing))
        return min(trials, key=lambda mix: mix.error)

    def _refined_start(
        self, earlier: tuple[Projection, ...], kind: str, warp: Warp | None, smoothing: float
    ) -> tuple[Projection, ...]:
        """Successive halving over random starts: half of them, the better ones, go on with more steps."""
        starts = [(*earlier, self._make(kind, warp)) for _ in range(self._restarts)]
        steps = 4
        while True:
            refined = []
            for projections in starts:
                refined.append(self._descend(projections, smoothing, steps))
                if self._late():
                    break
            refined.sort(key=lambda pair: pair[0])
            starts = [projections for _, projections in refined[: max(1, len(refined) // 2)]]
            if len(refined) == 1 or self._late():
                return starts[0]
            steps *= 2

    def _descend(
        self, projections: tuple[Projection, ...], smoothing: float, steps: int
    ) -> tuple[float, tuple[Projection, ...]]:
        objective = Objective(self._samples, projections, self._shapes(projections), smoothing, self._bound)
        search = replace(self._search, iterations=steps) if hasattr(self._search, "iterations") else self._search
        left = max(self._deadline - time.perf_counter(), 1e-3)
        vector, report = search.minimize(objective, objective.start(), seconds=left, seed=self._seed)
        self._evaluations += report.evaluations
        if report.status is Status.INTERRUPTED:
            raise KeyboardInterrupt
        return report.residual, objective.projections(vector)

    def _exchange(self, mix: Mix, kinds: tuple[str, ...], last: int) -> Mix:
        """Each earlier texture tried as every other fixed kind, as long as that helps."""
        for place in range(last):
            for kind in kinds:
                if self._late():
                    return mix
                if is_searched(kind) or kind in mix.kinds:
                    continue
                warp = next((p.warp for p in mix.projections if p.warp is not None), None)
                projections = list(mix.projections)
                projections[place] = self._make(kind, warp)
                trial = self._judge(
                    (*mix.kinds[:place], kind, *mix.kinds[place + 1 :]), tuple(projections), mix.smoothing
                )
                if trial.error < ENOUGH * mix.error:
                    mix = trial
                    self._note(mix.error)
        return mix

    def _judge(self, kinds: tuple[str, ...], projections: tuple[Projection, ...], smoothing: float) -> Mix:
        folded = Folded.of(self._samples, self._folds, projections, self._shapes(projections))
        self._evaluations += 1
        if self._smoothing is not None:
            return Mix(kinds, projections, self._smoothing, folded.error(self._smoothing))
        best, error = folded.best_smoothing(smoothing)
        return Mix(kinds, projections, best, error)

    def _make(self, kind: str, warp: Warp | None) -> Projection:
        return make(kind, self._reciprocal, warp, self._generator, self._bound)

    def _shapes(self, projections: tuple[Projection, ...]) -> tuple[tuple[int, int], ...]:
        return tuple(texture_shape(projection, self._size) for projection in projections)

    def _late(self) -> bool:
        return time.perf_counter() > self._deadline

    def _note(self, error: float) -> None:
        self._trace.append((time.perf_counter() - self._began, self._evaluations, error))
