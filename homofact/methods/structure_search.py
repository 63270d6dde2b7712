"""The search over whole mixes: which kind each texture is, where its projection points, which λ and warp.

A beam search over kinds. At every level each mix in the beam is tried with one more texture of every
fixed kind, and the best of the beam with one more of a searched kind, refined from several random
starts of which the losers stop early (successive halving). All textures of a trial are solved together
and judged by cross-validation with their own best λ. Then the winner is loosened: each fixed texture is
tried as the searched kind it is a point of, from there downhill, jointly with all others.

All of this runs on small textures and a subset of the samples; the projections carry over (thesis 4.2).
The search ends when the textures are used up, when one more does not lower the validation error, or
when the time is; what it returns is always the best mix judged so far.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import torch

from homofact.errors import Status
from homofact.factor.objective import Objective
from homofact.factor.projection import Projection, Warp
from homofact.factor.search.best import Search
from homofact.factor.textures import LogSamples, texture_shape
from homofact.methods.kinds import WARP_WIDTHS, is_isotropic, is_searched, loosened, make, takes_warp
from homofact.methods.validation import Folded, Partition

FIRST_SMOOTHING = 1e-3
ENOUGH = 0.995  # a change is worth having when it leaves less than this share of the validation error
BEAM = 4


@dataclass(frozen=True)
class Mix:
    """Chosen projections with their kinds, the λ of every texture, and their validation error."""

    kinds: tuple[str, ...]
    projections: tuple[Projection, ...]
    smoothing: tuple[float, ...]
    error: float

    @property
    def warp(self) -> Warp | None:
        """The stretch of the half vector that its textures share."""
        return next((p.warp for p in self.projections if p.warp is not None), None)


EMPTY = Mix((), (), (), float("inf"))


@dataclass(frozen=True)
class Outcome:
    """What a mixed search found, how it ended, and what it cost; `notes` are for the user."""

    mix: Mix
    status: Status
    evaluations: int
    trace: tuple[tuple[float, int, float], ...]
    notes: tuple[str, ...]


@dataclass(frozen=True)
class MixSettings:
    """Texels a side, reciprocity and bound of every trial; starts and search of searched kinds; λ where it is given."""

    size: int
    reciprocal: bool
    bound: str
    restarts: int
    search: Search
    smoothing: float | None
    seconds: float
    seed: int


class MixedSearch:
    """One run over coarse samples; make one, call `run` once."""

    def __init__(
        self,
        samples: LogSamples,
        partitions: tuple[Partition, ...],
        settings: MixSettings,
        progress: Callable[[int, int, float], None] | None = None,
    ) -> None:
        """`progress` is called with (term, evaluations, best validation error) after every trial."""
        self._samples, self._partitions, self._settings, self._progress = samples, partitions, settings, progress
        self._generator = torch.Generator().manual_seed(settings.seed)
        self._began = time.perf_counter()
        self._deadline = self._began + settings.seconds
        self._evaluations = 0
        self._best = EMPTY
        self._trace: list[tuple[float, int, float]] = []

    def run(self, textures: int, candidates: tuple[tuple[str, ...], ...]) -> Outcome:
        """Choose up to `textures` textures, of the kinds in candidates[j] for texture j (its last entry from there on).

        Where a list of kinds is given texture by texture, or only one kind, all textures are used.
        """
        pinned = all(len(kinds) == 1 for kinds in candidates)
        notes: list[str] = []
        status = Status.CONVERGED
        beam: list[Mix] = [EMPTY]
        try:
            for term in range(1, textures + 1):
                # No texture may use up the time of those after it.
                self._deadline = self._began + self._settings.seconds * term / textures
                if term > 1 and self._late() and not pinned:
                    status = Status.BUDGET
                    notes.append(f"the time was up after {term - 1} of {textures} textures: give it a larger budget")
                    break
                kinds = candidates[min(term, len(candidates)) - 1]
                trials = sorted(self._level(beam, kinds, term, textures, pinned), key=lambda mix: mix.error)
                if term > 1:
                    best = [self._settled(mix) for mix in _distinct(trials)[:BEAM]]
                    trials = sorted(best, key=lambda mix: mix.error)
                    self._note(trials[0].error)
                if self._late():
                    status = Status.BUDGET
                if not pinned and beam[0].error * ENOUGH < trials[0].error:
                    notes.append(
                        f"{term - 1} of {textures} textures kept: one more does not lower the validation error"
                    )
                    break
                beam = _distinct(trials)[:BEAM]
                self._best = beam[0]
            self._deadline = self._began + self._settings.seconds
            if not pinned:
                self._loosen()
        except KeyboardInterrupt:
            if not self._best.kinds:
                raise
            status = Status.INTERRUPTED
            notes.append(f"interrupted after {len(self._best.kinds)} of {textures} textures")
        return Outcome(self._best, status, self._evaluations, tuple(self._trace), tuple(notes))

    def _level(self, beam: list[Mix], kinds: tuple[str, ...], term: int, textures: int, pinned: bool) -> list[Mix]:
        """The mixes of the beam with one more texture, as many as the time allows, and at least one."""
        trials: list[Mix] = []
        # Loosening finds what a fixed kind is near to; a search from random starts is for the last texture, and
        # for kinds that know the azimuth, where no fixed kind is near.
        searched = [
            kind for kind in kinds if is_searched(kind) and (pinned or term == textures or not is_isotropic(kind))
        ]
        fixed = [kind for kind in kinds if not is_searched(kind)]
        # The best mix with every kind comes first, so that a short budget has seen them all beside it.
        growths = [(beam[0], kind) for kind in fixed + searched]
        growths += [(mix, kind) for mix in beam[1:] for kind in fixed]
        for mix, kind in growths:
            if trials and self._late():
                break
            if kind in mix.kinds and not is_searched(kind) and not pinned:
                continue
            for warp in self._warps(mix, kind, trials):
                if trials and self._late():
                    break
                trial = self._grown(mix, kind, warp)
                trials.append(trial)
                if not self._best.kinds:
                    self._best = trial
                self._note(trial.error)
                if self._progress is not None:
                    self._progress(term, self._evaluations, min(each.error for each in trials))
        return trials

    def _warps(self, base: Mix, kind: str, trials: list[Mix]) -> list[Warp | None]:
        """The warps to try: the base's own where it has one, else all, or for a search the best two met so far."""
        if base.warp is not None or not takes_warp(kind):
            return [base.warp]
        every: list[Warp | None] = [None, *(Warp(width) for width in WARP_WIDTHS)]
        if not is_searched(kind):
            return every
        met = [mix.warp for mix in sorted(trials, key=lambda mix: mix.error) if takes_warp(mix.kinds[-1])]
        return list(dict.fromkeys(met))[:2] if met else every

    def _grown(self, base: Mix, kind: str, warp: Warp | None) -> Mix:
        """`base` with one more texture of this kind, refined where it has something to refine."""
        if is_searched(kind):
            projections = self._refined_start(base, kind, warp)
        else:
            projections = (*base.projections, self._make(kind, warp))
        return self._judge((*base.kinds, kind), projections, _with_one_more(base.smoothing))

    def _refined_start(self, base: Mix, kind: str, warp: Warp | None) -> tuple[Projection, ...]:
        """Successive halving over random starts: half of them, the better ones, go on with more steps."""
        starts = [(*base.projections, self._make(kind, warp)) for _ in range(self._settings.restarts)]
        steps = 4
        while True:
            refined = []
            for projections in starts:
                refined.append(self._descend(projections, _with_one_more(base.smoothing), steps))
                if self._late():
                    break
            refined.sort(key=lambda pair: pair[0])
            starts = [projections for _, projections in refined[: max(1, len(refined) // 2)]]
            if len(refined) == 1 or self._late():
                return starts[0]
            steps *= 2

    def _descend(
        self, projections: tuple[Projection, ...], smoothing: tuple[float, ...], steps: int
    ) -> tuple[float, tuple[Projection, ...]]:
        objective = Objective(self._samples, projections, self._shapes(projections), smoothing, self._settings.bound)
        search = self._settings.search.limited(steps)
        left = max(self._deadline - time.perf_counter(), 1e-3)
        vector, report = search.minimize(objective, objective.start(), seconds=left, seed=self._settings.seed)
        self._evaluations += report.evaluations
        if report.status is Status.INTERRUPTED:
            raise KeyboardInterrupt
        return report.residual, objective.projections(vector)

    def _loosen(self) -> None:
        """Each fixed texture tried as the searched kind it is a point of, as long as that helps."""
        for place, kind in enumerate(self._best.kinds):
            projection = loosened(self._best.projections[place])
            if projection is None or is_searched(kind):
                continue
            if self._late():
                return
            projections = list(self._best.projections)
            projections[place] = projection
            _, refined = self._descend(tuple(projections), self._best.smoothing, 24)
            kinds = (*self._best.kinds[:place], projection.coordinates, *self._best.kinds[place + 1 :])
            trial = self._judge(kinds, refined, self._best.smoothing)
            if trial.error < ENOUGH * self._best.error:
                self._best = trial
                self._note(trial.error)

    def _judge(self, kinds: tuple[str, ...], projections: tuple[Projection, ...], smoothing: tuple[float, ...]) -> Mix:
        folded = Folded.of(self._samples, self._partitions, projections, self._shapes(projections))
        self._evaluations += 1
        if self._settings.smoothing is not None:
            given = (self._settings.smoothing,) * len(kinds)
            return Mix(kinds, projections, given, folded.error(given))
        return Mix(kinds, projections, *folded.best_smoothing(smoothing, self._deadline))

    def _settled(self, mix: Mix) -> Mix:
        """The mix with λ chosen texture by texture, which is dearer than one for all."""
        if self._settings.smoothing is not None or self._late():
            return mix
        folded = Folded.of(self._samples, self._partitions, mix.projections, self._shapes(mix.projections))
        smoothing, error = folded.best_each(mix.smoothing, deadline=self._deadline)
        return replace(mix, smoothing=smoothing, error=error)

    def _make(self, kind: str, warp: Warp | None) -> Projection:
        return make(kind, self._settings.reciprocal, warp, self._generator, self._settings.bound)

    def _shapes(self, projections: tuple[Projection, ...]) -> tuple[tuple[int, int], ...]:
        return tuple(texture_shape(projection, self._settings.size) for projection in projections)

    def _late(self) -> bool:
        return time.perf_counter() > self._deadline

    def _note(self, error: float) -> None:
        if not self._trace or error < self._trace[-1][2]:
            self._trace.append((time.perf_counter() - self._began, self._evaluations, error))


def _with_one_more(smoothing: tuple[float, ...]) -> tuple[float, ...]:
    """The λs of a mix that grows: the new texture starts with the last one's, or the usual first."""
    return (*smoothing, smoothing[-1] if smoothing else FIRST_SMOOTHING)


def _distinct(mixes: list[Mix]) -> list[Mix]:
    """The mixes without those that hold the same kinds as a better one before them: a beam of one kind is none."""
    seen: set[tuple[str, ...]] = set()
    result = []
    for mix in mixes:
        key = tuple(sorted(mix.kinds))
        if key not in seen:
            seen.add(key)
            result.append(mix)
    return result
