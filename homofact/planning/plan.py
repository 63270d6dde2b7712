"""The planner: per material the cheapest representation that meets the tolerances under every lighting of a scene.

`plan.search` evaluates rungs (`plan.ladder`): it fits the training samples and measures the errors on held-out samples
and in random views (`plan.measure`). A fit depends on neither lighting nor distance, so it is made once and measured
under each. If the choices together exceed the scene's bytes, `plan.allocate` distributes the bytes.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from homofact.brdf.analytic.lambert import Lambert
from homofact.brdf.scattered import made_of_samples
from homofact.errors import BadInput, HomofactError
from homofact.evaluation.opinion import Opinion, opinion_table
from homofact.evaluation.verdict.verdict import Verdict
from homofact.planning.allocate import Buyer, allocate
from homofact.planning.clock import PlanClock
from homofact.planning.ladder import CONSTANT, LAMBERT, Candidate, FitOptions, fits_among
from homofact.planning.material_fits import MaterialFits, rungs_for
from homofact.planning.measure import RepresentationEvaluator, best_colour
from homofact.planning.scene import NO_BUDGET, Budget, Scene, SceneMaterial
from homofact.planning.search import UNTRUSTED, LadderOutcome, Walk, walk
from homofact.planning.stage import Stage
from homofact.planning.theory import order_needed
from homofact.planning.tolerance import UNLIT, Errors, Tolerance

# Of the lighting's spectrum times the lobe's, what "orders needed" may leave out where the tolerance is no such error.
USUAL_ERROR = 0.05


@dataclass(frozen=True)
class MaterialPlan:
    """What was found for one material; `walk.choice` is the representation, None where none fits the budget.

    There is one judge per lighting. Errors of the walk are in units of the tolerance, margins included: an error of 1
    just meets it.
    """

    material: SceneMaterial
    fits: MaterialFits
    judges: tuple[RepresentationEvaluator, ...]
    tolerance: Tolerance
    walk: Walk
    budget: Budget = NO_BUDGET

    @property
    def name(self) -> str:
        """Return the material's own name, else the source's."""
        return self.material.name or self.fits.source.name

    @property
    def outcome(self) -> LadderOutcome | None:
        """Return the outcome of the choice: its error, bytes and fetches."""
        return None if self.walk.choice is None else self.walk.asked[self.walk.choice]

    @property
    def missed_by(self) -> float:
        """Return error/limit − 1 of the choice with margins: 0 if met, infinite if nothing is in the budget."""
        outcome = self.outcome
        return max(0.0, outcome.error - 1) if outcome is not None else math.inf

    @cached_property
    def needed_orders(self) -> tuple[int, ...]:
        """Return, for each lighting, the order of spherical harmonics that the lobe needs.

        Without the higher orders, the error of the reflected light is the `reflected` limit, or 5% without this limit.
        """
        error = dict(self.tolerance.limits).get("reflected", USUAL_ERROR)
        return tuple(order_needed(self.fits.lobes, judge.lighting, error) for judge in self.judges)

    @property
    def highlight_pixels(self) -> float | None:
        """Return the width of the highlight in pixels; None without a highlight or for a close camera."""
        pixels, width = self.material.pixels, self.fits.highlight
        return None if pixels is None or width is None else pixels * math.sin(width)

    @cached_property
    def colour(self) -> Lambert | None:
        """Return the chosen colour; None if the choice is not one colour, or there is no choice."""
        choice = self.walk.choice
        return best_colour(self.judges, self.tolerance.of_light) if choice is not None and choice.is_colour else None

    @cached_property
    def errors(self) -> tuple[Errors, ...]:
        """All errors of the choice, by lighting; none where there is no choice."""
        choice = self.walk.choice
        return () if choice is None else tuple(self._errors(choice, judge) for judge in self.judges)

    @property
    def opinion(self) -> Opinion | None:
        """Return the predicted grade of the choice; None if its source is known only at its samples."""
        differences = [errors.delta_e_study for errors in self.errors[:1]]
        return opinion_table().law.opinion(differences[0]) if differences and not math.isnan(differences[0]) else None

    @cached_property
    def verdict(self) -> Verdict | None:
        """Return the verdict on the choice and its data."""
        choice = self.walk.choice
        return None if choice is None else self.fits.verdict(choice, self.colour)

    def _errors(self, choice: Candidate, judge: RepresentationEvaluator) -> Errors:
        if self.colour is not None:
            return judge.colour_errors(choice, self.colour)
        return judge.errors(self.fits.fitted(choice)[0])

    def ask(self, candidate: Candidate) -> LadderOutcome:
        """Return a rung's outcome under this plan's lightings and tolerance, from the walk if already measured."""
        if candidate in self.walk.asked:
            return self.walk.asked[candidate]
        return outcome_of(candidate, self.fits, self.judges, self.tolerance)


@dataclass(frozen=True)
class OneSize:
    """The smallest single rung found that meets all materials' tolerances, with the bytes of all materials."""

    candidate: Candidate
    bytes: int
    fetches: float


@dataclass(frozen=True)
class ScenePlan:
    """The plans of all materials in the scene's order; `fits` counts all fits, including those of `one_size`.

    `allocated` is true if the bytes are too few for all tolerances, so that they were distributed over the choices.
    `wanted_bytes` is the sum of the bytes of the choices before this distribution. Each of these choices alone is
    within the budget.
    """

    scene: Scene
    materials: tuple[MaterialPlan, ...]
    one_size: OneSize | None
    planning_fits: int
    fits: int
    exhaustive_fits: int
    allocated: bool = False
    wanted_bytes: int = 0

    @property
    def tolerance_words(self) -> str:
        """The tolerances in words: the scene's, and those of materials that have their own, by name."""
        own = {plan.name: plan.tolerance.describe() for plan in self.distinct if plan.material.tolerance is not None}
        words = [f"for {name}, {limits}" for name, limits in own.items()]
        if len(own) == len(self.distinct) or self.scene.tolerance is None:
            return "; ".join(words)
        return "; ".join([self.scene.tolerance.describe(), *words])

    @property
    def limited_kinds(self) -> tuple[str, ...]:
        """The kinds of error that some material's tolerance limits, each once."""
        return tuple(dict.fromkeys(kind for plan in self.distinct for kind in plan.tolerance.kinds))

    @property
    def distinct(self) -> tuple[MaterialPlan, ...]:
        """Return the plans without repetitions of materials that are listed twice."""
        return tuple({plan.material.key: plan for plan in self.materials}.values())

    @property
    def bytes(self) -> int:
        """Return the bytes of all choices; materials that are listed twice count once."""
        return sum(plan.outcome.bytes for plan in self.distinct if plan.outcome is not None)

    @property
    def fetches(self) -> float:
        """Mean fetches of a picture's pixel, by the shares."""
        return sum(plan.material.share * plan.outcome.fetches for plan in self.materials if plan.outcome is not None)

    @property
    def error(self) -> float:
        """Return the picture's error in units of the tolerance, by shares; infinite if a choice is missing."""
        errors = (math.inf if plan.outcome is None else plan.outcome.error for plan in self.materials)
        return sum(plan.material.share * error for plan, error in zip(self.materials, errors, strict=True))


def outcome_of(
    candidate: Candidate, fits: MaterialFits, judges: tuple[RepresentationEvaluator, ...], tolerance: Tolerance
) -> LadderOutcome:
    """Fit a rung where it needs one, and measure it under each lighting.

    A representation within all limits is judged too if the tolerance asks for a trusted one.
    """
    samples = fits.source.samples
    model = None
    if candidate.is_colour:
        model = best_colour(judges, tolerance.of_light)
        cost = model.nbytes, 0, 0
        errors = [judge.colour_errors(candidate, model, tolerance.kinds) for judge in judges]
    else:
        try:
            fit = fits.fitted(candidate)[0]
        except HomofactError as error:
            # A rung that cannot be fitted to these samples is no answer, and no reason to give no other.
            fits.refused[candidate.fit] = str(error)
            most = candidate.most_bytes(len(samples.channels)), candidate.most_fetches(samples.isotropic)
            return LadderOutcome(math.inf, *most, candidate.textures)
        cost = fit.nbytes * candidate.texel_bytes // 4, fit.fetches, len(fit.terms)
        errors = [judge.errors(fit, tolerance.kinds) for judge in judges]
    used = [tolerance.used(under) for under in errors]
    excess = sum(math.log(max(limit.ratio, 1.0)) for under in errors for limit in tolerance.uses(under))
    worst = max(range(len(used)), key=lambda k: used[k].ratio)
    most = used[worst]
    where = "" if most.kind in UNLIT else judges[worst].lighting.name
    trusted = True
    if tolerance.trusted and most.ratio <= 1:
        trusted = fits.verdict(candidate, model).trusted
    if not trusted:
        return LadderOutcome(UNTRUSTED, *cost, most.kind, most.error, where, trusted, excess)
    return LadderOutcome(most.ratio, *cost, most.kind, most.error, where, trusted, excess)


def plan_material(
    material: SceneMaterial,
    fits: MaterialFits,
    stages: tuple[Stage, ...],
    tolerance: Tolerance,
    budget: Budget,
    before: Callable[[Candidate, int | None], object] = lambda candidate, most: None,
) -> MaterialPlan:
    """Walk the ladder for one material; `before` as `planning.search.walk` has it.

    Raises BadInput for a limit on what people would grade where the source is known only at its samples.
    """
    if "delta_e_study" in tolerance.kinds and made_of_samples(fits.source.reflectance):
        raise BadInput(
            where="tolerance",
            found=f"delta_e_study (that of visible) for {fits.source.name}, which is known only at its samples",
            expected="another limit, such as delta_e: there is no picture of the samples to grade",
        )
    # Some errors see none of the scene's light: one stage will do, and the 9 terms would be had for nothing.
    used = stages if tolerance.of_light else stages[:1]
    judges = tuple(RepresentationEvaluator(fits.source, stage, fits.options, material.pixels) for stage in used)
    walked = walk(
        rungs_for(fits, tolerance),
        lambda candidate: outcome_of(candidate, fits, judges, tolerance),
        1.0,
        channels=len(fits.source.samples.channels),
        isotropic=fits.source.samples.isotropic,
        most_bytes=math.inf if budget.bytes is None else budget.bytes,
        most_fetches=math.inf if budget.fetches is None else budget.fetches,
        light_reads={CONSTANT: max(stage.lighting.reads for stage in stages), LAMBERT: 9},
        before=before,
    )
    return MaterialPlan(material, fits, judges, tolerance, walked, budget)


def plan_scene(
    scene: Scene,
    options: FitOptions | None = None,
    fits_by_source: dict[str, MaterialFits] | None = None,
    clock: PlanClock | None = None,
    larger: bool = False,
) -> ScenePlan:
    """Plan a scene; `fits_by_source` reuses the fits of another plan, and reports each fit to `clock`.

    If `larger`, the clock also expects the fits of `neighbours.with_larger_measured`, which the caller runs next.

    Raises BadInput as `plan_material`, for sources that cannot be read, and for materials that reflect nothing of the
    lighting.
    """
    used = replace(FitOptions() if options is None else options, seed=scene.seed)
    known = {} if fits_by_source is None else fits_by_source
    clock = PlanClock(lambda words, left: None) if clock is None else clock
    distinct_keys = {material.key for material in scene.materials}
    trusted = any(scene.tolerance_of(material).trusted for material in scene.materials)
    clock.expect(len(distinct_keys), len(distinct_keys) if larger else 0, trusted)
    clock.stage("preparing the lighting")
    stages = tuple(Stage.of(lighting, scene.seed) for lighting in scene.lightings)
    under = f"under {' and '.join(lighting.name for lighting in scene.lightings)}"
    plans: dict[Any, MaterialPlan] = {}
    for material in scene.materials:
        fits = known.setdefault(material.source, MaterialFits(material.source, used))
        if material.key in plans:
            continue
        clock.stage(f"reading {material.name or material.source}")
        place = f" ({len(plans) + 1} of {len(distinct_keys)})" if len(distinct_keys) > 1 else ""
        clock.material(fits, f"planning {material.name or fits.source.name}{place} {under}")
        plans[material.key] = plan_material(
            material, fits, stages, scene.tolerance_of(material), scene.budget, clock.asking
        )
    distinct = tuple(plans.values())
    limit = scene.budget.bytes
    wanted = sum(plan.outcome.bytes for plan in distinct if plan.outcome is not None)
    over = limit is not None and wanted > limit
    if over and limit is not None:
        clock.stage("distributing the bytes")
        distinct = share_out(distinct, scene, limit)
    planning = sum(plan.walk.fits for plan in distinct)
    by_key = {plan.material.key: plan for plan in distinct}
    shown = tuple(replace(by_key[material.key], material=material) for material in scene.materials)
    clock.stage("looking for one size for all")
    one = one_size(distinct, shown)
    different = {id(plan.fits): plan.fits for plan in distinct}.values()
    count = sum(len(fits.made) + len(fits.refused) for fits in different)
    exhaustive = sum(fits_among(fits.rungs) for fits in different)
    return ScenePlan(scene, shown, one, planning, count, exhaustive, over, wanted)


def share_out(plans: tuple[MaterialPlan, ...], scene: Scene, most_bytes: int) -> tuple[MaterialPlan, ...]:
    """Return the plans with the choices of least picture error within the scene's bytes."""
    most_fetches = math.inf if scene.budget.fetches is None else scene.budget.fetches
    buyers = [
        Buyer(
            sum(material.share for material in scene.materials if material.key == plan.material.key),
            rungs_for(plan.fits, plan.tolerance),
            dict(plan.walk.asked),
            lambda candidate, plan=plan: outcome_of(candidate, plan.fits, plan.judges, plan.tolerance),
            len(plan.fits.source.samples.channels),
            plan.fits.source.samples.isotropic,
            most_fetches,
        )
        for plan in plans
    ]
    shared = []
    for plan, buyer, choice in zip(plans, buyers, allocate(buyers, most_bytes), strict=True):
        met = choice is not None and buyer.asked[choice].error <= plan.walk.tolerance
        shared.append(replace(plan, walk=replace(plan.walk, asked=buyer.asked, choice=choice, met=met)))
    return tuple(shared)


def one_size(distinct: tuple[MaterialPlan, ...], shown: tuple[MaterialPlan, ...]) -> OneSize | None:
    """Return the smallest single rung that meets all tolerances, searched upwards from the largest choice.

    None if some material's tolerance was not met at all, or if no rung of the same method and storage as the largest
    choice meets all.
    """
    if not all(plan.walk.met for plan in distinct):
        return None
    dearest = max(distinct, key=lambda plan: plan.outcome.bytes if plan.outcome is not None else 0)
    first = dearest.walk.choice
    if first is None:
        return None
    rungs = dearest.fits.rungs
    offered = [
        candidate
        for candidate in rungs[rungs.index(first) :]
        if (candidate.family, candidate.storage) == (first.family, first.storage)
    ]
    if first.is_colour:
        offered = [first, *(candidate for candidate in rungs if candidate.is_colour and candidate != first)]
    for candidate in offered:
        answers: dict[Any, LadderOutcome] = {}
        for plan in distinct:
            answers[plan.material.key] = answer = plan.ask(candidate)
            if answer.error > 1:
                break
        else:
            total = sum(answer.bytes for answer in answers.values())
            fetches = sum(plan.material.share * answers[plan.material.key].fetches for plan in shown)
            return OneSize(candidate, total, fetches)
    return None
