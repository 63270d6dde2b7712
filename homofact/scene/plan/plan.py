"""The planner: per material the cheapest representation that meets the tolerances under every lighting of a scene.

Rungs (`plan.ladder`) are asked about by `plan.search`; an answer is a fit to the training samples and its errors on
what was held out and in drawn views (`plan.measure`). A fit depends on neither lighting nor distance and is made once,
whatever it is then measured under. Where the choices together exceed the scene's bytes, `plan.allocate` spends these.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

from homofact.brdf.analytic.lambert import Lambert
from homofact.errors import HomofactError
from homofact.evaluate.verdict.verdict import Verdict
from homofact.scene.plan.allocate import Buyer, allocate
from homofact.scene.plan.bench import Bench
from homofact.scene.plan.ladder import CONSTANT, LAMBERT, Candidate, FitOptions, fits_among
from homofact.scene.plan.measure import Judge, best_colour
from homofact.scene.plan.scene import Budget, Scene, SceneMaterial
from homofact.scene.plan.search import Outcome, Walk, walk
from homofact.scene.plan.stage import Stage
from homofact.scene.plan.theory import order_needed
from homofact.scene.plan.tolerance import MARGINS, Errors, Tolerance

# Of the lighting's spectrum times the lobe's, what "orders needed" may leave out where the tolerance is no such error.
USUAL_ERROR = 0.05


@dataclass
class MaterialPlan:
    """What was found for one material; `walk.choice` is the representation, None where none fits the budget.

    One judge a lighting. Errors of the walk are in units of the tolerance, its margins included: 1 just meets it.
    """

    material: SceneMaterial
    bench: Bench
    judges: tuple[Judge, ...]
    tolerance: Tolerance
    walk: Walk

    @property
    def name(self) -> str:
        """The source's."""
        return self.bench.source.name

    @property
    def outcome(self) -> Outcome | None:
        """The choice's error, bytes and fetches."""
        return None if self.walk.choice is None else self.walk.asked[self.walk.choice]

    @property
    def missed_by(self) -> float:
        """error/limit − 1 of the choice where it misses, margins included; infinite where nothing was in the budget."""
        found = self.outcome
        return max(0.0, found.error - 1) if found is not None else math.inf

    @property
    def needed_orders(self) -> tuple[int, ...]:
        """After which order the lobe may be cut, by lighting: for the tolerance on light, else for 5% of it."""
        error = dict(self.tolerance.limits).get("reflected", USUAL_ERROR)
        return tuple(order_needed(self.bench.lobes, judge.lighting, error) for judge in self.judges)

    @property
    def highlight_pixels(self) -> float | None:
        """How many pixels the highlight is across, None where it has none or the object is close by."""
        pixels, width = self.material.pixels, self.bench.highlight
        return None if pixels is None or width is None else pixels * math.sin(width)

    @cached_property
    def colour(self) -> Lambert | None:
        """The one colour that was chosen; None where the choice has textures, or there is none."""
        choice = self.walk.choice
        return best_colour(self.judges, self.tolerance.of_light) if choice is not None and choice.is_colour else None

    @cached_property
    def errors(self) -> tuple[Errors, ...]:
        """All errors of the choice, by lighting; none where there is no choice."""
        choice = self.walk.choice
        return () if choice is None else tuple(self._errors(choice, judge) for judge in self.judges)

    @cached_property
    def verdict(self) -> Verdict | None:
        """What is found against the choice and its data."""
        choice = self.walk.choice
        return None if choice is None else self.bench.verdict(choice, self.colour)

    def _errors(self, choice: Candidate, judge: Judge) -> Errors:
        if self.colour is not None:
            return judge.colour_errors(choice, self.colour)
        return judge.errors(self.bench.fitted(choice)[0])

    def ask(self, candidate: Candidate) -> Outcome:
        """A rung's answer under this plan's lightings and tolerance, from the walk where it was asked there."""
        if candidate in self.walk.asked:
            return self.walk.asked[candidate]
        return outcome_of(candidate, self.bench, self.judges, self.tolerance)


@dataclass(frozen=True)
class OneSize:
    """The smallest single rung that was found to meet the tolerance for every material; bytes of all together."""

    candidate: Candidate
    bytes: int
    fetches: float


@dataclass(frozen=True)
class ScenePlan:
    """The answer: a plan a material, in the scene's order; `fits` are all that were made, those of `one_size` too.

    `allocated` says whether the choices share out the bytes because they would not all meet the tolerance within them.
    """

    scene: Scene
    materials: tuple[MaterialPlan, ...]
    one_size: OneSize | None
    planning_fits: int
    fits: int
    exhaustive_fits: int
    allocated: bool = False

    @property
    def distinct(self) -> tuple[MaterialPlan, ...]:
        """Each choice once, where a material is listed again."""
        return tuple({each.material.key: each for each in self.materials}.values())

    @property
    def bytes(self) -> int:
        """Of the choices; what is listed twice once."""
        return sum(each.outcome.bytes for each in self.distinct if each.outcome is not None)

    @property
    def fetches(self) -> float:
        """Mean fetches of a picture's pixel, by the shares."""
        return sum(each.material.share * each.outcome.fetches for each in self.materials if each.outcome is not None)

    @property
    def error(self) -> float:
        """Of the picture, by the shares, in units of the tolerance; infinite where a material has no representation."""
        return sum(
            each.material.share * (math.inf if each.outcome is None else each.outcome.error) for each in self.materials
        )

    @property
    def warnings(self) -> tuple[str, ...]:
        """What was not met, in sentences that begin with the material's name."""
        lines = []
        for each in self.distinct:
            found, choice = each.outcome, each.walk.choice
            if found is None or choice is None:
                lines.append(f"{each.name}: no representation fits the budget")
            elif not each.walk.met:
                limit = dict(each.tolerance.limits)[found.kind]
                where = f" under {found.lighting}" if len(each.judges) > 1 else ""
                within = f" within {self.scene.budget.bytes} bytes" if self.allocated else ""
                margin = MARGINS[found.kind] - 1
                kept = f" with the margin of {margin:.0%} for other views" if margin > 0 else ""
                lines.append(
                    f"{each.name}: {found.kind} {limit:g} cannot be met{where}{within}; the best reachable is"
                    f" {found.value:.3g} by {choice.label}, missing it by {each.missed_by:.0%}{kept}"
                )
        return tuple(lines)


def outcome_of(candidate: Candidate, bench: Bench, judges: tuple[Judge, ...], tolerance: Tolerance) -> Outcome:
    """Fit a rung where it needs one, and measure it under each lighting."""
    samples = bench.source.samples
    if candidate.is_colour:
        model = best_colour(judges, tolerance.of_light)
        cost = model.nbytes, 0, 0
        found = [judge.colour_errors(candidate, model, tolerance.kinds) for judge in judges]
    else:
        try:
            fit = bench.fitted(candidate)[0]
        except HomofactError as error:
            # A rung that cannot be fitted to these samples is no answer, and no reason to give no other.
            bench.refused[candidate.fit] = str(error)
            most = candidate.most_bytes(len(samples.channels)), candidate.most_fetches(samples.isotropic)
            return Outcome(math.inf, *most, candidate.textures)
        cost = fit.nbytes * candidate.texel_bytes // 4, fit.fetches, len(fit.terms)
        found = [judge.errors(fit, tolerance.kinds) for judge in judges]
    used = [tolerance.used(each) for each in found]
    worst = max(range(len(used)), key=lambda k: used[k].ratio)
    most = used[worst]
    # The Cole error is of no lighting.
    where = judges[worst].lighting.name if most.kind != "cole" else ""
    return Outcome(most.ratio, *cost, most.kind, most.error, where)


def plan_material(
    material: SceneMaterial, bench: Bench, stages: tuple[Stage, ...], tolerance: Tolerance, budget: Budget
) -> MaterialPlan:
    """Walk the ladder for one material."""
    # The Cole error sees no light: one stage will do, and the 9 terms would be had for nothing.
    used = stages if tolerance.of_light else stages[:1]
    judges = tuple(Judge(bench.source, stage, bench.options, material.pixels) for stage in used)
    found = walk(
        rungs_for(bench, tolerance),
        lambda candidate: outcome_of(candidate, bench, judges, tolerance),
        1.0,
        channels=len(bench.source.samples.channels),
        isotropic=bench.source.samples.isotropic,
        most_bytes=math.inf if budget.bytes is None else budget.bytes,
        most_fetches=math.inf if budget.fetches is None else budget.fetches,
        light_reads={CONSTANT: max(stage.lighting.reads for stage in stages), LAMBERT: 9},
    )
    return MaterialPlan(material, bench, judges, tolerance, found)


def rungs_for(bench: Bench, tolerance: Tolerance) -> tuple[Candidate, ...]:
    """The rungs that are to be told apart under a tolerance."""
    return tuple(each for each in bench.rungs if tolerance.of_light or each.method != LAMBERT)


def plan_scene(
    scene: Scene,
    options: FitOptions | None = None,
    benches: dict[str, Bench] | None = None,
    stage: Callable[[str], None] = lambda _: None,
) -> ScenePlan:
    """Plan a scene; `benches` by source carries fits over from another plan, `stage` hears which material is at work.

    Raises BadInput for sources that cannot be read, and for materials that reflect nothing of the lighting.
    """
    used = replace(FitOptions() if options is None else options, seed=scene.seed)
    tables = {} if benches is None else benches
    stages = tuple(Stage.of(each, scene.seed) for each in scene.lightings)
    plans: dict[tuple[str, int | None], MaterialPlan] = {}
    for material in scene.materials:
        bench = tables.setdefault(material.source, Bench(material.source, used))
        stage(bench.source.name)
        if material.key not in plans:
            plans[material.key] = plan_material(material, bench, stages, scene.tolerance, scene.budget)
    distinct = tuple(plans.values())
    limit = scene.budget.bytes
    over = limit is not None and sum(each.outcome.bytes for each in distinct if each.outcome is not None) > limit
    if over and limit is not None:
        stage("sharing out the bytes")
        share_out(distinct, scene, limit)
    planning = sum(each.walk.fits for each in distinct)
    found = tuple(replace(plans[each.key], material=each) for each in scene.materials)
    stage("one size for all")
    one = one_size(distinct, found)
    used_benches = {id(each.bench): each.bench for each in distinct}.values()
    fits = sum(len(bench.fits) + len(bench.refused) for bench in used_benches)
    exhaustive = sum(fits_among(bench.rungs) for bench in used_benches)
    return ScenePlan(scene, found, one, planning, fits, exhaustive, over)


def share_out(plans: tuple[MaterialPlan, ...], scene: Scene, most_bytes: int) -> None:
    """Give the plans the choices that make the picture's error least within so many bytes."""
    most_fetches = math.inf if scene.budget.fetches is None else scene.budget.fetches
    buyers = [
        Buyer(
            sum(each.share for each in scene.materials if each.key == plan.material.key),
            rungs_for(plan.bench, plan.tolerance),
            plan.walk.asked,
            lambda candidate, plan=plan: outcome_of(candidate, plan.bench, plan.judges, plan.tolerance),
            len(plan.bench.source.samples.channels),
            plan.bench.source.samples.isotropic,
            most_fetches,
        )
        for plan in plans
    ]
    for plan, choice in zip(plans, allocate(buyers, most_bytes), strict=True):
        plan.walk.choice = choice
        plan.walk.met = choice is not None and plan.walk.asked[choice].error <= plan.walk.tolerance


def one_size(distinct: tuple[MaterialPlan, ...], shown: tuple[MaterialPlan, ...]) -> OneSize | None:
    """The smallest single rung that meets the tolerance for all, looked for upwards from the dearest choice.

    None where some material's tolerance was not met at all, or where no rung of the dearest one's method serves all.
    """
    if not all(plan.walk.met for plan in distinct):
        return None
    dearest = max(distinct, key=lambda plan: plan.outcome.bytes if plan.outcome is not None else 0)
    first = dearest.walk.choice
    if first is None:
        return None
    rungs = dearest.bench.rungs
    offered = [
        each for each in rungs[rungs.index(first) :] if (each.method, each.storage) == (first.method, first.storage)
    ]
    if first.is_colour:
        offered = [first, *(each for each in rungs if each.is_colour and each != first)]
    for candidate in offered:
        answers: dict[tuple[str, int | None], Outcome] = {}
        for plan in distinct:
            answers[plan.material.key] = answer = plan.ask(candidate)
            if answer.error > 1:
                break
        else:
            total = sum(answer.bytes for answer in answers.values())
            fetches = sum(plan.material.share * answers[plan.material.key].fetches for plan in shown)
            return OneSize(candidate, total, fetches)
    return None
