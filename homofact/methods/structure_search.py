"""The search over whole mixes: what each texture is indexed by, where its projection points, which λ and warp.

One number of textures after another, up to as many as are asked for:

* Fixed projections, exhaustively. For every warp all fixed candidates are accumulated together on textures of half the
  size; each mix of them is a block of that matrix (`folded.FixedBank`) and is judged there. The better ones are judged
  again at the search's own size (successive halving by rule, so that neither luck nor the clock has a part in it). The
  best of two, with one more, also decide about reciprocity.
* Searched projections, from there. Starts are the best fixed mixes with their textures loosened (searched from where
  they are fixed), the best mix of one texture less with every other kind beside it, and rotations drawn once for all.
  All of them descend a few steps, the better half some more, and so on; the last few are judged like the fixed ones.

Then exchange: each texture of the winner is taken out and every other kind tried in its place, as long as that helps.
All textures of a trial are solved together and judged by cross-validation with their own λ.

All of this runs on small textures and a subset of the samples; the projections carry over (thesis 4.2). Work is paid
from an `Account`; what an equal account buys is equal. Of more textures the best mix is only taken where it is better
than that of fewer by `ENOUGH`, so more textures asked for are never worse.
"""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import combinations

import torch
from torch import Tensor

from homofact.errors import Status
from homofact.factor.objective import Objective
from homofact.factor.projection import Projection, Warp
from homofact.factor.search.minimize import Search, minimize
from homofact.factor.textures import LogSamples, texture_shape
from homofact.linear.threads import in_parallel
from homofact.methods.effort import Account, cost_of_evaluation, cost_of_solve
from homofact.methods.folded import FixedBank, Folded
from homofact.methods.kinds import WARP_WIDTHS, is_searched, loosened, make, relatives, takes_warp
from homofact.methods.mix import EMPTY, FIRST_SMOOTHING, Mix, freed, is_movable, scale_of, with_all_loose
from homofact.methods.validation import Partition

FREE_WORTH = 0.9  # reciprocity is given up where that leaves fixed mixes less than this share of their error
TELLING = ("theta_i-theta_o", "theta_i-theta_d")  # fixed kinds that, free, tell light from viewer
ENOUGH = 0.995  # a change is worth having when it leaves less than this share of the validation error
ROTATIONS = 20020801  # seeds the rotations that searches start from
BEAM = 4  # fixed mixes that the next step goes on from
FIRST_LOOK = 0.5  # of the search's texture size: what all fixed mixes are first looked at with
DESCENTS = 0.625  # of the search's texture size: what a tournament's projections descend with
FINALISTS = 3  # mixes that are judged in full at the end of a tournament; the best of them is polished
FIRST_STEPS, LAST_STEPS = 6, 24  # iterations of the first and the last round of descents
LEAST_PLACES = 6  # starts that descend in a tournament, whatever is left of the account
LOOKS = 4  # starts that are looked at for every one that may descend
ASIDE = 1e-3  # of a quaternion's length: how far beside its projections a descent starts
POLISH = 40  # iterations of the winner's last descent
EXCHANGES = 3  # rounds of exchange at most
ALL_WARPS_UP_TO = 2  # textures: mixes of one more are looked at with the two best warps, of more with the best


@dataclass(frozen=True)
class Outcome:
    """What a search found, how it ended, and what it cost; `notes` are for the user.

    `levels` are the best mixes of one texture, of two, and so on, with that of the best's number last exchanged.
    """

    mix: Mix
    status: Status
    evaluations: int
    trace: tuple[tuple[float, int, float], ...]
    notes: tuple[str, ...]
    levels: tuple[Mix, ...]


@dataclass(frozen=True)
class StructureSettings:
    """Texels along an axis, reciprocity and bound of every trial; random starts of searched kinds; λ where given.

    With `reciprocal` None trials are reciprocal until fixed mixes meet the data better by `FREE_WORTH` without.
    """

    size: int
    reciprocal: bool | None
    bound: str
    restarts: int
    search: Search
    smoothing: float | None
    seed: int


class StructureSearch:
    """One run over coarse samples; make one, call `run` once."""

    def __init__(
        self,
        samples: LogSamples,
        partitions: tuple[Partition, ...],
        settings: StructureSettings,
        account: Account,
        progress: Callable[[int, int, float], None] | None = None,
    ) -> None:
        """`progress` is called with (textures, evaluations, best validation error) after every group of trials."""
        self._samples, self._partitions, self._settings, self._progress = samples, partitions, settings, progress
        self._account = account
        self._reciprocal = settings.reciprocal is not False
        # The same rotations whatever the seed: which are tried is no matter of luck.
        self._generator = torch.Generator().manual_seed(ROTATIONS)
        self._began = time.perf_counter()
        self._best = EMPTY
        self._trace: list[tuple[float, int, float]] = []
        self._notes: list[str] = []
        self._banks: dict[Warp | None, FixedBank] = {}
        self._best_warps: list[Warp | None] = []
        self._levels: list[Mix] = []

    def run(self, textures: int, candidates: tuple[tuple[str, ...], ...]) -> Outcome:
        """Choose up to `textures` textures, of the kinds in candidates[j] for texture j (its last entry from there on).

        Where a kind is given texture by texture, or only one, all textures are used.
        """
        pinned = all(len(kinds) == 1 for kinds in candidates)
        notes = self._notes
        status = Status.CONVERGED
        try:
            if pinned:
                self._run_pinned(tuple(candidates[min(j, len(candidates) - 1)][0] for j in range(textures)))
            else:
                self._run_free(textures, candidates[0])
                kept = len(self._best.kinds)
                if kept < textures:
                    notes.append(f"{kept} of {textures} textures kept: more do not lower the validation error")
        except KeyboardInterrupt:
            if not self._best.kinds:
                raise
            status = Status.INTERRUPTED
            notes.append(f"interrupted: the best mix so far has {len(self._best.kinds)} of {textures} textures")
        if self._account.late and status is Status.CONVERGED:
            status = Status.GUARD
        levels = tuple(self._best if len(each.kinds) == len(self._best.kinds) else each for each in self._levels)
        return Outcome(self._best, status, self._account.evaluations, tuple(self._trace), tuple(notes), levels)

    def _run_free(self, textures: int, kinds: tuple[str, ...]) -> None:
        fixed = tuple(kind for kind in kinds if not is_searched(kind))
        searched = tuple(kind for kind in kinds if is_searched(kind))
        judged: list[Mix] = []
        whole = self._account.left
        # A system's cost grows with the cube of its texels: later textures get more of the account.
        weights = [(count + 1) ** 2 for count in range(textures)]
        for count in range(1, textures + 1):
            until = whole * 0.7 * sum(weights[:count]) / sum(weights)
            judged = self._fixed_mixes(fixed, count)
            if self._settings.reciprocal is None and self._reciprocal and count == min(textures, 2):
                judged = self._decided(judged, fixed)
            if (searched and count > 1) or not judged:
                before = self._levels[-1] if self._levels else EMPTY
                starts = self._starts(judged, before, fixed, searched)
                judged += self._tournament(starts, until)
            judged.sort(key=lambda mix: mix.error)
            self._levels.append(judged[0])
            self._offer(judged[0])
            if self._account.late:
                return
        # Of two textures every fixed pair has been judged, and every kind has been tried beside the best single one.
        for _ in range(EXCHANGES if textures > 2 or not self._account.over else 0):
            best = self._best
            self._exchange(kinds)
            if not self._best.error < ENOUGH * best.error or self._account.over:
                break

    def _decided(self, judged: list[Mix], fixed: tuple[str, ...]) -> list[Mix]:
        """The fixed mixes to go on from: without reciprocity where that is worth it.

        The best mix is judged both ways with one texture more that could tell light from viewer: without it a mix may
        be blind to what it would gain, and fixed kinds show it before anything has been spent on searched ones. Mixes
        without reciprocity are chosen anew.
        """
        if not judged:
            return judged
        best = judged[0]
        more = [name for name in TELLING if name in fixed and name not in best.kinds]

        def asked(reciprocal: bool) -> float:
            mixes = [best.with_one_more(name, self._make(name, best.warp)) for name in more] or [best]
            both = [
                replace(mix, projections=tuple(replace(each, reciprocal=reciprocal) for each in mix.projections))
                for mix in mixes
            ]
            scale = scale_of(best.smoothing)
            return min(mix.error for mix in self._beside(lambda mix: self._judge(mix, scale), both))

        kept, without = asked(True), asked(False)
        if not without < FREE_WORTH * kept:
            return judged
        self._reciprocal, self._banks = False, {}
        anew = self._fixed_mixes(fixed, len(self._levels) + 1, again=True)
        self._best = freed(self._best)
        self._notes.append(
            "not reciprocal: fixed textures meet the data better without,"
            f" validation error {without:.3g} instead of {kept:.3g} (--reciprocal to enforce it)"
        )
        self._levels = [freed(mix) for mix in self._levels]
        return anew

    def _run_pinned(self, kinds: tuple[str, ...]) -> None:
        """Textures of given kinds, one after another; the best of their starts and warps goes on."""
        mix = EMPTY
        whole = self._account.left
        for count, kind in enumerate(kinds, 1):
            starts: list[Mix] = []
            for warp in self._warps(mix, kind):
                alone = [make(kind, self._reciprocal, warp, self._generator, self._settings.bound)]
                if is_searched(kind):
                    alone = self._searched_starts(kind, warp, self._settings.restarts)
                starts += [mix.with_one_more(kind, projection) for projection in alone]
            mix = self._tournament(starts, whole * count / len(kinds))[0]
            self._best = mix
            self._tell(count, mix.error)

    def _warps(self, base: Mix, kind: str) -> list[Warp | None]:
        """The warps to try with one more texture: the mix's own where it has one."""
        if base.warp is not None or not takes_warp(kind):
            return [base.warp]
        return [None, *(Warp(width) for width in WARP_WIDTHS)]

    # Fixed projections.

    def _fixed_mixes(self, fixed: tuple[str, ...], count: int, again: bool = False) -> list[Mix]:
        """The best mixes of `count` fixed kinds, judged in full; none where there are too few kinds.

        Over all warps, or `again` and for many textures over the best.
        """
        warps: list[Warp | None] = [None, *(Warp(width) for width in WARP_WIDTHS)]
        if count > ALL_WARPS_UP_TO or again:
            warps = self._best_warps[: 2 if count <= ALL_WARPS_UP_TO + 1 else 1]
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

        def first_look(trial: tuple[tuple[int, ...], Warp | None]) -> tuple[float, Account]:
            account = self._account.beside()
            folded = self._banks[trial[1]].mix(trial[0])
            return self._smoothed(folded, (smoothing,) * count, account, each=False)[1], account

        looks = self._beside(first_look, trials)
        order = sorted(range(len(trials)), key=lambda place: looks[place])
        chosen = [trials[place] for place in order[: max(BEAM + 2, len(trials) // 20)]]
        found = self._beside(lambda trial: self._settled(fixed, trial, smoothing, each=False), chosen)
        order = sorted(range(len(chosen)), key=lambda place: found[place].error)
        if count <= ALL_WARPS_UP_TO:
            self._best_warps = list(dict.fromkeys(chosen[place][1] for place in order))[:2]
        mixes = sorted(found, key=lambda mix: mix.error)[:BEAM]
        if count > 1:
            scale = scale_of(mixes[0].smoothing)
            mixes[:1] = self._beside(lambda trial: self._settled(fixed, trial, scale, each=True), [chosen[order[0]]])
            mixes.sort(key=lambda mix: mix.error)
        self._tell(count, mixes[0].error)
        return mixes

    def _make_banks(self, fixed: tuple[str, ...], warps: list[Warp | None]) -> None:
        """All fixed kinds accumulated together for the first look, warp by warp."""
        wanted = [warp for warp in warps if warp not in self._banks]

        def made(warp: Warp | None) -> tuple[FixedBank, Account]:
            projections = tuple(self._make(kind, warp) for kind in fixed)
            account = self._account.beside()
            lookups = sum(projection.lookups for projection in projections)
            account.spend(cost_of_evaluation(self._samples.logs.shape[0], lookups, 0))
            shapes = self._shapes(projections, FIRST_LOOK)
            return FixedBank.of(self._samples, self._partitions, projections, shapes), account

        self._banks.update(zip(wanted, self._beside(made, wanted), strict=True))

    def _settled(
        self, fixed: tuple[str, ...], trial: tuple[tuple[int, ...], Warp | None], smoothing: float, each: bool
    ) -> tuple[Mix, Account]:
        """A fixed mix at the search's own size, with one λ for all of its textures, or one for `each`."""
        account = self._account.beside()
        chosen, warp = trial
        projections = tuple(self._banks[warp].projections[j] for j in chosen)
        mix = Mix(tuple(fixed[j] for j in chosen), projections, (smoothing,) * len(chosen))
        found, error = self._smoothed(self._folded(mix, account), mix.smoothing, account, each)
        return replace(mix, smoothing=found, error=error), account

    def _smoothed(
        self, folded: Folded, start: tuple[float, ...], account: Account, each: bool
    ) -> tuple[tuple[float, ...], float]:
        """(λ of every texture, error): the given λ, or the best for all textures alike, or for `each` from there."""
        if self._settings.smoothing is not None:
            return self._judged(folded, (self._settings.smoothing,) * len(start), account)
        # λ is found on one fold of each partition, the mix is judged by all of them.
        smoothing, _ = folded.best_smoothing(start, account, 1)
        if each and len(start) > 1:
            smoothing, _ = folded.best_each(smoothing, account, folds=1)
        return self._judged(folded, smoothing, account)

    def _judged(
        self, folded: Folded, smoothing: tuple[float, ...], account: Account, folds: int | None = None
    ) -> tuple[tuple[float, ...], float]:
        account.spend(folded.solves(folds) * cost_of_solve(folded.unknowns))
        return smoothing, folded.error(smoothing, folds)

    # Searched projections.

    def _starts(self, judged: list[Mix], before: Mix, fixed: tuple[str, ...], searched: tuple[str, ...]) -> list[Mix]:
        """What the searched projections of one more texture start from, the likeliest first."""
        starts = [loose for mix in judged for loose in [with_all_loose(mix)] if loose is not None]
        warp = before.warp if before.kinds else (judged[0].warp if judged else None)
        movable = any(projection.rotation is not None for projection in before.projections)
        for kind in fixed if movable else ():
            if kind not in before.kinds:
                starts.append(before.with_one_more(kind, self._make(kind, warp)))
        for kind in searched:
            starts += [before.with_one_more(kind, each) for each in self._searched_starts(kind, warp, 0)]
        for _ in range(LOOKS * self._settings.restarts):
            starts += [before.with_one_more(kind, self._make(kind, warp)) for kind in searched]
        return starts

    def _searched_starts(self, kind: str, warp: Warp | None, random: int) -> list[Projection]:
        """Rotations of a searched kind: those that its fixed relatives stand at, and `random` ones."""
        own = warp if takes_warp(kind) else None
        placed = [loosened(self._make(name, own)) for name in relatives(kind)]
        found = [projection for projection in placed if projection is not None]
        return found + [self._make(kind, warp) for _ in range(random)]

    def _tournament(self, starts: list[Mix], until: float) -> list[Mix]:
        """The best few of `starts`, best first: all descend a few steps, the better half some more, and so on.

        As many of the starts take part as can be paid for with `until` units spent in all, at least `LEAST_PLACES`;
        descents are compared with one λ for all.
        """
        if not starts:
            return []
        searched = [mix for mix in starts if is_movable(mix)]
        rest = [mix for mix in starts if not is_movable(mix)]
        # Where projections have moved into place there is less for λ to smooth over.
        scale = 0.1 * scale_of(starts[0].smoothing)
        steps, spare = FIRST_STEPS, until - self._account.spent
        if searched:
            # A round costs about as much as the one before it, half of the starts with twice the steps; of the rest a
            # third is for looking at more starts than can descend, and a third for judging.
            each = max(self._cost(mix, DESCENTS) for mix in searched) * (1 + FIRST_STEPS)
            places = max(LEAST_PLACES, int(spare / (3 * each)))
            searched = searched[: LOOKS * places]
            if len(searched) > places:
                looks = self._beside(lambda mix: self._looked(mix, scale), searched)
                order = sorted(range(len(searched)), key=lambda place: looks[place])
                searched = [searched[place] for place in sorted(order[:places])]
        while searched:
            ranked = self._beside(lambda mix, steps=steps: self._descended(mix, scale, steps, DESCENTS), searched)
            ranked.sort(key=lambda pair: pair[0])
            searched = [mix for _, mix in ranked]
            if steps >= LAST_STEPS or self._account.late:
                break
            searched = searched[: max(2, math.ceil(len(searched) / 2))]
            steps *= 2
        mixes = self._beside(lambda mix: self._judge(mix, scale), [*searched[:FINALISTS], *rest[:BEAM]])
        best = min(mixes, key=lambda mix: mix.error)
        rest = [mix for mix in mixes if mix is not best]
        return sorted((*self._beside(self._polished, [best]), *rest), key=lambda mix: mix.error)

    def _polished(self, mix: Mix) -> tuple[Mix, Account]:
        """The mix with λ texture by texture, after a longer descent with these; judged there."""
        account = self._account.beside()
        folded = self._folded(mix, account)
        smoothing, error = self._smoothed(folded, (scale_of(mix.smoothing),) * len(mix.kinds), account, each=True)
        mix = replace(mix, smoothing=smoothing, error=error)
        if not is_movable(mix):
            return mix, account
        (_, moved), more = self._descended(mix, None, POLISH, 1.0)
        account.add(more)
        _, error = self._judged(self._folded(moved, account), smoothing, account)
        return min(mix, replace(moved, error=error), key=lambda each: each.error), account

    def _exchange(self, kinds: tuple[str, ...]) -> None:
        """Each texture of the best mix taken out, and every other kind tried in its place."""
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
        found = self._tournament([starts[place] for place in order], self._account.granted)
        if found:
            self._offer(found[0])

    def _descended(self, mix: Mix, scale: float | None, steps: int, share: float) -> tuple[tuple[float, Mix], Account]:
        """((R, the mix there), account): its searched projections moved together, with one λ or (None) its own.

        The textures have a `share` of the search's size.
        """
        account = self._account.beside()
        smoothing = mix.smoothing if scale is None else (scale,) * len(mix.kinds)
        objective = Objective(
            self._samples, mix.projections, self._shapes(mix.projections, share), smoothing, self._settings.bound
        )
        left = max(account.deadline - time.perf_counter(), 1e-3)
        start = aside(objective.start())
        vector, report = minimize(
            self._settings.search.limited(steps), objective, start, seconds=left, seed=self._settings.seed
        )
        account.spend(report.evaluations * self._cost(mix, share), report.evaluations)
        if report.status is Status.INTERRUPTED:
            raise KeyboardInterrupt
        return (report.residual, replace(mix, projections=objective.projections(rounded(vector)))), account

    def _looked(self, mix: Mix, scale: float) -> tuple[float, Account]:
        """(R, account) where the mix stands."""
        account = self._account.beside()
        shapes = self._shapes(mix.projections, DESCENTS)
        smoothing = (scale,) * len(mix.kinds)
        objective = Objective(self._samples, mix.projections, shapes, smoothing, self._settings.bound)
        account.spend(self._cost(mix, DESCENTS))
        return objective.error(objective.start()), account

    def _judge(self, mix: Mix, scale: float) -> tuple[Mix, Account]:
        account = self._account.beside()
        folded = self._folded(mix, account)
        smoothing, error = self._smoothed(folded, (scale,) * len(mix.kinds), account, each=False)
        return replace(mix, smoothing=smoothing, error=error), account

    def _folded(self, mix: Mix, account: Account) -> Folded:
        account.spend(self._cost(mix))
        return Folded.of(self._samples, self._partitions, mix.projections, self._shapes(mix.projections))

    # Keeping count.

    def _cost(self, mix: Mix, share: float = 1.0) -> float:
        """Units of one evaluation of a mix with textures of a share of the search's size."""
        texels = sum(rows * columns for rows, columns in self._shapes(mix.projections, share))
        lookups = sum(projection.lookups for projection in mix.projections)
        return cost_of_evaluation(self._samples.logs.shape[0], lookups, texels)

    def _beside(self, function: Callable, pieces: list) -> list:
        """The function's results of all pieces, their accounts added; on threads where the search allows it."""
        run = in_parallel if self._settings.search.independent else (lambda each, all: [each(one) for one in all])
        results = run(function, pieces)
        for _, account in results:
            self._account.add(account)
        return [result for result, _ in results]

    def _offer(self, mix: Mix) -> None:
        """Take `mix` where it is enough better than the best of no more textures: each one more has to earn it."""
        more = max(len(mix.kinds) - len(self._best.kinds), 1)
        if mix.error < ENOUGH**more * self._best.error:
            self._best = mix
        self._tell(len(mix.kinds), self._best.error)

    def _tell(self, textures: int, error: float) -> None:
        if not self._trace or error < self._trace[-1][2]:
            self._trace.append((time.perf_counter() - self._began, self._account.evaluations, error))
        if self._progress is not None:
            self._progress(textures, self._account.evaluations, error)

    def _make(self, kind: str, warp: Warp | None) -> Projection:
        return make(kind, self._reciprocal, warp, self._generator, self._settings.bound)

    def _shapes(self, projections: tuple[Projection, ...], share: float = 1.0) -> tuple[tuple[int, int], ...]:
        size = max(2, round(share * self._settings.size))
        return tuple(texture_shape(projection, size) for projection in projections)


def aside(vector: Tensor) -> Tensor:
    """The vector (V,) a little beside, always in the same direction.

    On a fixed projection symmetry makes slopes zero. What is left of them is rounding, which differs between machines,
    and a descent that starts there would grow it.
    """
    return vector + ASIDE * torch.sin(1 + torch.arange(len(vector), dtype=vector.dtype, device=vector.device))


def rounded(vector: Tensor) -> Tensor:
    """Quaternions (V,) of unit length on a grid of 2⁻¹⁴.

    Rounding differs between processors in the last bits, and a descent magnifies that. Cut off after every descent, it
    does not grow from one to the next, so that other machines end in the same projections.
    """
    quaternions = vector.reshape(-1, 4)
    return torch.round(quaternions / quaternions.norm(dim=1, keepdim=True) * 2**14).reshape(-1) / 2**14
