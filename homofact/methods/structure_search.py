"""The search over whole mixes: what each texture is indexed by, where its projection points, which λ and warp.

If there are known mixes that often win (`known_mixes`), only these are evaluated, and the best of them are refined by
descent (`known_search`). Otherwise, and for more textures than known mixes have, the search treats one number of
textures after another, up to the requested number:

* Fixed projections are searched exhaustively. For every warp all fixed candidates are accumulated together on textures
  of half the size. Each mix of them is a block of that matrix (`folded.FixedBank`) and is judged with it. The better
  half is judged again at the search's own size (successive halving by a fixed rule, so the result does not depend on
  chance or on time). The best mixes of two textures, extended by a third one, also decide about reciprocity.
* Searched projections start from these mixes. The starts are the best fixed mixes with loosened textures (searched from
  their fixed place), the best mix of one texture less with each other kind added, and a fixed set of random rotations.
  All of them descend a few steps, the better half descends further, and so on; the last few are judged like the fixed
  ones.

Then follow exchanges: each texture of the winner is replaced by every other kind, as long as this lowers the error. All
textures of a trial are solved together and judged by cross-validation with their own λ.

All of this runs on small textures and a subset of the samples; the projections carry over (thesis 4.2). A `FitBudget`
limits the work; the same budget gives the same result. A mix of more textures is only chosen if it is better by
`ENOUGH` than the best mix of fewer, so requesting more textures never gives a worse fit.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import combinations

import torch

from homofact.errors import Advice, Status
from homofact.factor.projection import Projection, Warp
from homofact.methods.effort import FitBudget
from homofact.methods.kinds import WARP_WIDTHS, is_searched, loosened, make, relatives, takes_warp
from homofact.methods.known_search import finished, looked_at
from homofact.methods.materials import Banks, Materials
from homofact.methods.mix import EMPTY, FIRST_SMOOTHING, Mix, freed, scale_of, with_all_loose
from homofact.methods.tournament import BEAM, LOOKS, tournament
from homofact.methods.trials import StructureSettings, Trials

FREE_WORTH = 0.9  # reciprocity is given up where that leaves fixed mixes less than this share of their error
_TELLING = ("theta_i-theta_o", "theta_i-theta_d")  # fixed kinds that, free, tell light from viewer
ENOUGH = 0.995  # a change is worth having when it leaves less than this share of the validation error
ROTATIONS = 20020801  # seeds the rotations that searches start from
_FIRST_LOOK = 0.5  # of the search's texture size: what all fixed mixes are first looked at with
_EXCHANGES = 3  # rounds of exchange at most
_ALL_WARPS_UP_TO = 2  # textures: mixes of one more are looked at with the two best warps, of more with the best


@dataclass(frozen=True)
class SearchOutcome:
    """The result of a search, its status and its cost; `notes` are for the user.

    `levels` are the best mixes of one texture, of two, and so on; exchanges have improved the mix with as many textures
    as the best one. `known` is true if all of them are known mixes.
    """

    mix: Mix
    status: Status
    evaluations: int
    trace: tuple[tuple[float, int, float], ...]
    notes: tuple[str, ...]
    levels: tuple[Mix, ...]
    known: bool = False


def kept_note(kept: int, textures: int) -> str:
    """Return the note of a fit that keeps fewer textures than it may have."""
    return f"the search kept {kept} of {textures} textures: more do not lower the validation error"


class StructureSearch:
    """One search over coarse samples; create a new object for each call of `run`."""

    def __init__(
        self,
        materials: Materials,
        settings: StructureSettings,
        budget: FitBudget,
        progress: Callable[[int, int, float], None] | None = None,
    ) -> None:
        """Set up a search that calls `progress` with (textures, evaluations, best error) after each group of trials."""
        self._materials, self._settings, self._progress = materials, settings, progress
        self._budget = budget
        self._trials = Trials(materials, settings, budget)
        self._reciprocal = settings.reciprocal is not False
        # The same rotations whatever the seed: which are tried is no matter of luck.
        self._generator = torch.Generator().manual_seed(ROTATIONS)
        self._began = time.perf_counter()
        self._best = EMPTY
        self._trace: list[tuple[float, int, float]] = []
        self._notes: list[str] = []
        self._note_of_freedom = ""
        self._banks: dict[Warp | None, Banks] = {}
        self._best_warps: list[Warp | None] = []
        self._levels: list[Mix] = []
        self._known = False

    def run(self, textures: int, candidates: tuple[tuple[str, ...], ...]) -> SearchOutcome:
        """Choose up to `textures` textures; texture j has a kind in candidates[j], or in the last entry.

        If each texture has only one candidate kind, the search uses all textures.
        """
        pinned = all(len(kinds) == 1 for kinds in candidates)
        notes = self._notes
        if self._settings.known.note and not pinned:
            notes.append(self._settings.known.note)
        status = Status.CONVERGED
        try:
            if pinned:
                self._run_pinned(tuple(candidates[min(j, len(candidates) - 1)][0] for j in range(textures)))
            else:
                self._run_free(textures, candidates[0])
                kept = len(self._best.kinds)
                if kept < textures:
                    notes.append(kept_note(kept, textures))
        except KeyboardInterrupt:
            if not self._best.kinds:
                raise
            status = Status.INTERRUPTED
            notes.append(f"interrupted: the best mix so far has {len(self._best.kinds)} of {textures} textures")
        # Free of reciprocity, the best mix may still have it: θh and θd are the same both ways.
        if self._note_of_freedom and any(own.one_way for own in self._best.projections):
            notes.append(self._note_of_freedom)
        if self._budget.late and status is Status.CONVERGED:
            status = Status.GUARD
        levels = tuple(self._best if len(level.kinds) == len(self._best.kinds) else level for level in self._levels)
        return SearchOutcome(
            self._best, status, self._budget.evaluations, tuple(self._trace), tuple(notes), levels, self._known
        )

    def _run_free(self, textures: int, kinds: tuple[str, ...]) -> None:
        fixed = tuple(kind for kind in kinds if not is_searched(kind))
        searched = tuple(kind for kind in kinds if is_searched(kind))
        whole, known = self._budget.left, 0
        # A system's cost grows with the cube of its texels: later textures get more of the budget.
        weights = [(count + 1) ** 2 for count in range(textures)]
        for count in range(1, textures + 1):
            until = whole * 0.7 * sum(weights[:count]) / sum(weights)
            undecided = self._settings.reciprocal is None and self._reciprocal and count == min(textures, 2)
            looked = self._known_mixes(kinds, count)
            if looked:
                known = count
                if undecided and self._better_free(looked[0], fixed, self._trials.glanced):
                    looked = self._known_mixes(kinds, count)
                judged = [self._finished(looked, count == textures)]
            elif known:
                judged = []
            else:
                judged = self._fixed_mixes(fixed, count)
                if undecided and judged and self._better_free(judged[0], fixed, self._judged_alike):
                    judged = self._fixed_mixes(fixed, count, again=True)
            if known < count and ((searched and count > 1) or not judged):
                before = self._levels[-1] if self._levels else EMPTY
                starts = self._starts(judged, before, fixed, searched)
                judged += tournament(self._trials, starts, until)
            judged.sort(key=lambda mix: mix.error)
            self._levels.append(judged[0])
            self._offer(judged[0])
            if self._budget.late:
                return
        self._known = known == textures
        if self._known:
            return
        # Of two textures every fixed pair has been judged, and every kind has been tried beside the best single one.
        for _ in range(_EXCHANGES if textures > 2 or not self._budget.over else 0):
            best = self._best
            self._exchange(kinds)
            if not self._best.error < ENOUGH * best.error or self._budget.over:
                break

    def _known_mixes(self, kinds: tuple[str, ...], count: int) -> list[Mix]:
        """Return the known mixes of `count` textures after a quick evaluation, best first; may be empty.

        For one texture, every fixed kind is evaluated too, because some materials are simpler than most.
        """
        mixes = self._settings.known.of(count, kinds, self._reciprocal, self._settings.bound)
        if count == 1 and mixes:
            mixes += [EMPTY.with_one_more(kind, self._make(kind, None)) for kind in kinds if not is_searched(kind)]
        return looked_at(self._trials, mixes)

    def _finished(self, looked: list[Mix], last: bool) -> Mix:
        """Return the best known mix: fully optimized if the search ends at its size, otherwise only evaluated."""
        if last or self._settings.every_level:
            mix = finished(self._trials, looked)
        else:
            mix = self._trials.beside(lambda mix: self._trials.judge(mix, None), looked[:1])[0]
        self._tell(len(mix.kinds), mix.error)
        return mix

    def _better_free(self, best: Mix, fixed: tuple[str, ...], look: Callable[[Mix], tuple[Mix, FitBudget]]) -> bool:
        """Return whether non-reciprocal mixes are clearly better; if so, stop requiring reciprocity.

        `look` evaluates the best mix with and without reciprocity, with one more texture that can distinguish light
        from viewer. Without such a texture, a mix might not show the gain. Fixed kinds show it before the search spends
        effort on searched ones. The caller has to choose the non-reciprocal mixes again.
        """
        more = [name for name in _TELLING if name in fixed and name not in best.kinds]

        def asked(reciprocal: bool) -> float:
            mixes = [best.with_one_more(name, self._make(name, best.warp)) for name in more] or [best]
            both = [
                replace(mix, projections=tuple(replace(own, reciprocal=reciprocal) for own in mix.projections))
                for mix in mixes
            ]
            return min(mix.error for mix in self._trials.beside(look, both))

        kept, without = asked(True), asked(False)
        if not without < FREE_WORTH * kept:
            return False
        self._reciprocal, self._banks = False, {}
        self._note_of_freedom = (
            f"the fit is not reciprocal, f(ωi, ωo) is not f(ωo, ωi): the validation error was {kept:.3g} with"
            f" reciprocity and {without:.3g} without ({Advice('reciprocal', True)} enforces reciprocity)"
        )
        earlier = [freed(mix) for mix in self._levels]
        self._levels = self._trials.beside(lambda mix: self._trials.judge(mix, scale_of(mix.smoothing)), earlier)
        self._best = self._levels[-1] if self._levels else EMPTY
        return True

    def _judged_alike(self, mix: Mix) -> tuple[Mix, FitBudget]:
        return self._trials.judge(mix, scale_of(mix.smoothing))

    def _run_pinned(self, kinds: tuple[str, ...]) -> None:
        """Add textures of given kinds one by one, each time keeping the best of several starts and warps."""
        mix = EMPTY
        whole = self._budget.left
        for count, kind in enumerate(kinds, 1):
            starts: list[Mix] = []
            for warp in self._warps(mix, kind):
                alone = [make(kind, self._reciprocal, warp, self._generator, self._settings.bound)]
                if is_searched(kind):
                    alone = self._searched_starts(kind, warp, self._settings.restarts)
                starts += [mix.with_one_more(kind, projection) for projection in alone]
            mix = tournament(self._trials, starts, whole * count / len(kinds))[0]
            self._best = mix
            self._tell(count, mix.error)

    def _warps(self, base: Mix, kind: str) -> list[Warp | None]:
        """Return the warps to try with one more texture; only the mix's own warp if it has one."""
        if base.warp is not None or not takes_warp(kind):
            return [base.warp]
        return [None, *(Warp(width) for width in WARP_WIDTHS)]

    # Fixed projections.

    def _fixed_mixes(self, fixed: tuple[str, ...], count: int, again: bool = False) -> list[Mix]:
        """Return the best mixes of `count` fixed kinds, fully evaluated; empty if there are too few kinds.

        It tries all warps; for many textures, or `again`, only the best warps.
        """
        warps: list[Warp | None] = [None, *(Warp(width) for width in WARP_WIDTHS)]
        if count > _ALL_WARPS_UP_TO or again:
            warps = self._best_warps[: 2 if count <= _ALL_WARPS_UP_TO + 1 else 1]
        smoothing = scale_of(self._levels[-1].smoothing) if self._levels else FIRST_SMOOTHING
        trials: list[tuple[tuple[int, ...], Warp | None]] = []
        for warp in warps:
            for chosen in combinations(range(len(fixed)), count):
                # A mix that no warp touches is the same under all of them.
                if warp is None or any(takes_warp(fixed[j]) for j in chosen):
                    trials.append((chosen, warp))
        if not trials:
            return []
        self._make_banks(fixed, warps)

        def first_look(trial: tuple[tuple[int, ...], Warp | None]) -> tuple[float, FitBudget]:
            budget = self._budget.beside()
            folded = self._banks[trial[1]].mix(trial[0])
            return self._trials.smoothed(folded, (smoothing,) * count, budget, separately=False)[1], budget

        looks = self._trials.beside(first_look, trials)
        order = sorted(range(len(trials)), key=lambda place: looks[place])
        chosen = [trials[place] for place in order[: max(BEAM + 2, len(trials) // 20)]]
        settled = self._trials.beside(lambda trial: self._settled(fixed, trial, smoothing, separately=False), chosen)
        order = sorted(range(len(chosen)), key=lambda place: settled[place].error)
        if count <= _ALL_WARPS_UP_TO:
            self._best_warps = list(dict.fromkeys(chosen[place][1] for place in order))[:2]
        mixes = sorted(settled, key=lambda mix: mix.error)[:BEAM]
        if count > 1:
            scale = scale_of(mixes[0].smoothing)
            best = [chosen[order[0]]]
            mixes[:1] = self._trials.beside(lambda trial: self._settled(fixed, trial, scale, separately=True), best)
            mixes.sort(key=lambda mix: mix.error)
        self._tell(count, mixes[0].error)
        return mixes

    def _make_banks(self, fixed: tuple[str, ...], warps: list[Warp | None]) -> None:
        """Accumulate the linear systems of all fixed kinds for the first quick evaluation, warp by warp."""
        wanted = [warp for warp in warps if warp not in self._banks]

        def made(warp: Warp | None) -> tuple[Banks, FitBudget]:
            projections = tuple(self._make(kind, warp) for kind in fixed)
            budget = self._budget.beside()
            lookups = sum(projection.lookups for projection in projections)
            budget.spend(self._materials.cost(lookups, 0))
            shapes = self._trials.shapes(projections, _FIRST_LOOK)
            return self._materials.bank(projections, shapes), budget

        self._banks.update(zip(wanted, self._trials.beside(made, wanted), strict=True))

    def _settled(
        self, fixed: tuple[str, ...], trial: tuple[tuple[int, ...], Warp | None], smoothing: float, separately: bool
    ) -> tuple[Mix, FitBudget]:
        """Return a fixed mix at the search's size, with one λ for all textures, or one per texture if `separately`."""
        budget = self._budget.beside()
        chosen, warp = trial
        projections = tuple(self._banks[warp].projections[j] for j in chosen)
        mix = Mix(tuple(fixed[j] for j in chosen), projections, (smoothing,) * len(chosen))
        best, error = self._trials.smoothed(self._trials.folded(mix, budget), mix.smoothing, budget, separately)
        return replace(mix, smoothing=best, error=error), budget

    # Searched projections.

    def _starts(self, judged: list[Mix], before: Mix, fixed: tuple[str, ...], searched: tuple[str, ...]) -> list[Mix]:
        """Return starting mixes for the search of one more texture, the most promising first."""
        starts = [loose for mix in judged for loose in [with_all_loose(mix)] if loose is not None]
        warp = before.warp if before.kinds else (judged[0].warp if judged else None)
        movable = any(projection.rotation is not None for projection in before.projections)
        for kind in fixed if movable else ():
            if kind not in before.kinds:
                starts.append(before.with_one_more(kind, self._make(kind, warp)))
        for kind in searched:
            starts += [before.with_one_more(kind, projection) for projection in self._searched_starts(kind, warp, 0)]
        for _ in range(LOOKS * self._settings.restarts):
            starts += [before.with_one_more(kind, self._make(kind, warp)) for kind in searched]
        return starts

    def _searched_starts(self, kind: str, warp: Warp | None, random: int) -> list[Projection]:
        """Return starts of a searched kind: the rotations of related fixed kinds, and `random` random ones."""
        own = warp if takes_warp(kind) else None
        placed = [loosened(self._make(name, own)) for name in relatives(kind)]
        starts = [projection for projection in placed if projection is not None]
        return starts + [self._make(kind, warp) for _ in range(random)]

    def _exchange(self, kinds: tuple[str, ...]) -> None:
        """Replace each texture of the best mix by every other kind."""
        best = self._best
        starts: list[Mix] = []
        for place in range(len(best.kinds)):
            rest = best.without(place)
            for kind in kinds:
                if is_searched(kind):
                    starts += [rest.with_one_more(kind, self._make(kind, best.warp))]
                elif kind not in best.kinds:
                    starts.append(rest.with_one_more(kind, self._make(kind, best.warp)))
        order = torch.randperm(len(starts), generator=self._generator).tolist()
        better = tournament(self._trials, [starts[place] for place in order], self._budget.granted)
        if better:
            self._offer(better[0])

    # Keeping count.

    def _offer(self, mix: Mix) -> None:
        """Accept `mix` if it is sufficiently better than the best mix; each added texture has to lower the error."""
        more = max(len(mix.kinds) - len(self._best.kinds), 1)
        if mix.error < ENOUGH**more * self._best.error:
            self._best = mix
        self._tell(len(mix.kinds), self._best.error)

    def _tell(self, textures: int, error: float) -> None:
        if not self._trace or error < self._trace[-1][2]:
            self._trace.append((time.perf_counter() - self._began, self._budget.evaluations, error))
        if self._progress is not None:
            self._progress(textures, self._budget.evaluations, error)

    def _make(self, kind: str, warp: Warp | None) -> Projection:
        return make(kind, self._reciprocal, warp, self._generator, self._settings.bound)
