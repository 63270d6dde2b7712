"""The planner: per material the cheapest representation that meets a tolerance under a scene's lighting.

Rungs (`plan_ladder`) are asked about by `plan_search`; an answer is a fit to the training samples and its error on
what was held out (`plan.measure`), beside what theory says beforehand (`plan.theory`). A fit does not depend on the
lighting and is made once, whatever lightings it is then measured under.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

from homofact.brdf.source import Source, open_source
from homofact.errors import HomofactError, Report
from homofact.factor.fitted import Fitted
from homofact.scene.half_curve import half_angle_curve
from homofact.scene.lighting import Lighting
from homofact.scene.plan.ladder import CONSTANT, LAMBERT, Candidate, FitOptions, fit_candidate, ladder
from homofact.scene.plan.measure import Errors, Judge
from homofact.scene.plan.scene import Budget, Scene, SceneMaterial, Tolerance
from homofact.scene.plan.search import Outcome, Walk, walk
from homofact.scene.plan.theory import Lobes, order_needed, predicted_error, terms_needed
from homofact.scene.terms import half_angle_terms

# Of the lighting's spectrum times the lobe's, what "orders needed" may leave out where the tolerance is no such error.
USUAL_ERROR = 0.05
Fitter = Callable[[Candidate, Source, FitOptions], tuple[Fitted, Report]]


def fitted_by_method(candidate: Candidate, source: Source, options: FitOptions) -> tuple[Fitted, Report]:
    """The rung fitted to the source's training samples, and the fit's report."""
    found = fit_candidate(candidate, source, options)
    return found.factorization, found.report


@dataclass
class Bench:
    """One material at work: its source, what theory knows of it, every fit made so far and why others failed."""

    text: str
    options: FitOptions
    fitter: Fitter = fitted_by_method
    fits: dict[Candidate, tuple[Fitted, Report]] = field(default_factory=dict)
    refused: dict[Candidate, str] = field(default_factory=dict)

    @cached_property
    def source(self) -> Source:
        """Read or sampled once. Raises BadInput as `open_source` does."""
        return open_source(self.text, count=self.options.count, seed=self.options.seed)

    @cached_property
    def lobes(self) -> Lobes:
        """The material's lobes by order."""
        return Lobes.of(self.source.reflectance)

    @cached_property
    def own_terms(self) -> int:
        """In-out terms that hold 99% of the BRDF itself, whatever light falls on it (`terms.half_angle_terms`)."""
        return half_angle_terms(half_angle_curve(self.source.reflectance).l_star())

    @cached_property
    def rungs(self) -> tuple[Candidate, ...]:
        """The ladder in this material's order."""
        return ladder(len(self.source.samples.channels), self.source.samples.isotropic)

    def fitted(self, candidate: Candidate) -> tuple[Fitted, Report]:
        """The rung's fit, made on first asking."""
        if candidate not in self.fits:
            self.fits[candidate] = self.fitter(candidate, self.source, self.options)
        return self.fits[candidate]


@dataclass
class MaterialPlan:
    """What was found for one material; `walk.choice` is the representation, None where none fits the budget."""

    material: SceneMaterial
    bench: Bench
    judge: Judge
    tolerance: Tolerance
    walk: Walk

    @property
    def outcome(self) -> Outcome | None:
        """The choice's error, bytes and fetches."""
        return None if self.walk.choice is None else self.walk.asked[self.walk.choice]

    @property
    def missed_by(self) -> float:
        """error/tolerance − 1 of the choice where it misses, else 0; infinite where nothing was within the budget."""
        found = self.outcome
        return max(0.0, found.error / self.tolerance.value - 1) if found is not None else float("inf")

    @property
    def needed_order(self) -> int:
        """After which order the lobe may be cut under this lighting: for the tolerance on light, else for 5% of it."""
        error = self.tolerance.value if self.tolerance.kind == "reflected" else USUAL_ERROR
        return order_needed(self.bench.lobes, self.judge.lighting, error)

    def predicted(self, candidate: Candidate) -> float:
        """Theory's relative error of the reflected light."""
        return predicted_error(candidate, self.bench.lobes, self.judge.lighting)

    @cached_property
    def errors(self) -> Errors | None:
        """All three errors of the choice."""
        choice = self.walk.choice
        if choice is None:
            return None
        if choice.is_colour:
            return self.judge.colour_errors(choice, self.tolerance.kind)[1]
        return self.judge.errors(self.bench.fitted(choice)[0])

    def ask(self, candidate: Candidate) -> Outcome:
        """A rung's answer under this plan's lighting and tolerance, from the walk where it was asked there."""
        if candidate in self.walk.asked:
            return self.walk.asked[candidate]
        return outcome_of(candidate, self.bench, self.judge, self.tolerance.kind)

    def record(self) -> dict[str, Any]:
        """JSON-able."""
        choice, found = self.walk.choice, self.outcome
        return {
            "source": self.material.source,
            "name": self.bench.source.name,
            "share": self.material.share,
            "choice": None
            if choice is None
            else {**_record(choice), "bytes": found.bytes, "fetches": found.fetches}
            if found is not None
            else None,
            "met": self.walk.met,
            "error": None if found is None else found.error,
            "missed_by": self.missed_by,
            "predicted_reflected": None if choice is None else self.predicted(choice),
            "measured": None if self.errors is None else vars(self.errors),
            "needed_order": self.needed_order,
            "predicted_terms": terms_needed(self.needed_order),
            "predicted_terms_any_light": self.bench.own_terms,
            "fits": self.walk.fits,
            "refused": {each.label: why for each, why in self.bench.refused.items()},
            "asked": [
                {**_record(each), **vars(answer), "predicted_reflected": self.predicted(each)}
                for each, answer in self.walk.asked.items()
            ],
        }


@dataclass(frozen=True)
class OneSize:
    """The smallest single rung that was found to meet the tolerance for every material; bytes of all together."""

    candidate: Candidate
    bytes: int
    fetches: float


@dataclass(frozen=True)
class ScenePlan:
    """The answer: a plan a material, in the scene's order; `fits` are all that were made, those of `one_size` too."""

    scene: Scene
    materials: tuple[MaterialPlan, ...]
    one_size: OneSize | None
    fits: int
    exhaustive_fits: int

    @property
    def planning_fits(self) -> int:
        """Fits that the choices took, one for materials that are the same."""
        seen = {each.material.source: each.walk.fits for each in self.materials}
        return sum(seen.values())

    @property
    def bytes(self) -> int:
        """Of the choices, a material that is listed twice once."""
        seen = {each.material.source: each.outcome for each in self.materials}
        return sum(found.bytes for found in seen.values() if found is not None)

    @property
    def fetches(self) -> float:
        """Mean fetches of a picture's pixel, by the shares."""
        return sum(each.material.share * each.outcome.fetches for each in self.materials if each.outcome is not None)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What was not met, in sentences that begin with the material's name."""
        lines = []
        for each in self.materials:
            name, tolerance = each.bench.source.name, each.tolerance
            if each.outcome is None:
                lines.append(f"{name}: no representation fits the budget")
            elif not each.walk.met and each.walk.choice is not None:
                lines.append(
                    f"{name}: {tolerance.kind} {tolerance.value:g} cannot be met; the best reachable is"
                    f" {each.outcome.error:.3g} by {each.walk.choice.label}, missing it by {each.missed_by:.0%}"
                )
        limit = self.scene.budget.bytes
        if limit is not None and self.bytes > limit:
            lines.append(f"budget: the choices take {self.bytes} bytes together, {self.bytes - limit} over {limit}")
        return tuple(lines)

    def record(self) -> dict[str, Any]:
        """JSON-able."""
        lighting, one = self.scene.lighting, self.one_size
        return {
            "scene": self.scene.name,
            "seed": self.scene.seed,
            "tolerance": {self.scene.tolerance.kind: self.scene.tolerance.value},
            "budget": vars(self.scene.budget),
            "lighting": {
                "name": lighting.name,
                "description": lighting.words,
                "last_excited_order": lighting.last_excited,
                "energy_by_order": (lighting.energies / lighting.energies.sum()).tolist(),
            },
            "materials": [each.record() for each in self.materials],
            "bytes": self.bytes,
            "fetches_per_pixel": self.fetches,
            "one_size_fits_all": None
            if one is None
            else {**_record(one.candidate), "bytes": one.bytes}
            | {"fetches_per_pixel": one.fetches, "bytes_saved": one.bytes - self.bytes},
            "fits": self.planning_fits,
            "fits_with_one_size": self.fits,
            "exhaustive_fits": self.exhaustive_fits,
            "warnings": list(self.warnings),
        }


def outcome_of(candidate: Candidate, bench: Bench, judge: Judge, kind: str) -> Outcome:
    """Fit a rung where it needs one, and measure it."""
    if candidate.is_colour:
        model, errors = judge.colour_errors(candidate, kind)
        return Outcome(errors.of(kind), model.nbytes, 0)
    try:
        fit = bench.fitted(candidate)[0]
    except HomofactError as error:
        # A rung that cannot be fitted to these samples is no answer, and no reason to give no other.
        bench.refused[candidate] = str(error)
        samples = bench.source.samples
        most = candidate.most_bytes(len(samples.channels)), candidate.most_fetches(samples.isotropic)
        return Outcome(float("inf"), *most, candidate.textures)
    return Outcome(judge.errors(fit, (kind,)).of(kind), fit.nbytes, fit.fetches, len(fit.terms))


def plan_material(
    material: SceneMaterial, bench: Bench, lighting: Lighting, tolerance: Tolerance, budget: Budget
) -> MaterialPlan:
    """Walk the ladder for one material."""
    judge = Judge(bench.source, lighting, bench.options)
    # The Cole error sees no light, so the 9 terms of it would be had for nothing.
    rungs = tuple(each for each in bench.rungs if tolerance.kind != "cole" or each.method != LAMBERT)
    found = walk(
        rungs,
        lambda candidate: outcome_of(candidate, bench, judge, tolerance.kind),
        tolerance.value,
        channels=len(bench.source.samples.channels),
        isotropic=bench.source.samples.isotropic,
        most_bytes=float("inf") if budget.bytes is None else budget.bytes,
        most_fetches=float("inf") if budget.fetches is None else budget.fetches,
        light_reads={CONSTANT: lighting.reads, LAMBERT: 9},
    )
    return MaterialPlan(material, bench, judge, tolerance, found)


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
    plans: dict[str, MaterialPlan] = {}
    for material in scene.materials:
        bench = tables.setdefault(material.source, Bench(material.source, used))
        stage(bench.source.name)
        same = plans.get(material.source)
        if same is None:
            plans[material.source] = plan_material(material, bench, scene.lighting, scene.tolerance, scene.budget)
    found = tuple(replace(plans[each.source], material=each) for each in scene.materials)
    stage("one size for all")
    one = one_size(tuple(plans.values()), found)
    fits = sum(len(plan.bench.fits) + len(plan.bench.refused) for plan in plans.values())
    exhaustive = sum(sum(not each.is_colour for each in plan.bench.rungs) for plan in plans.values())
    return ScenePlan(scene, found, one, fits, exhaustive)


def one_size(distinct: tuple[MaterialPlan, ...], shown: tuple[MaterialPlan, ...]) -> OneSize | None:
    """The smallest single rung that meets the tolerance for all, looked for upwards from the dearest choice.

    None where some material's tolerance was not met at all, or where no rung of the dearest one's method serves all.
    """
    if not all(plan.walk.met for plan in distinct):
        return None
    dearest = max(distinct, key=lambda plan: plan.outcome.bytes if plan.outcome is not None else 0)
    first = dearest.walk.choice
    rungs = dearest.bench.rungs
    offered = [each for each in rungs[rungs.index(first) :] if first is not None and each.method == first.method]
    if first is not None and first.is_colour:
        offered = [first, *(each for each in rungs if each.is_colour and each != first)]
    for candidate in offered:
        answers: dict[str, Outcome] = {}
        for plan in distinct:
            answers[plan.material.source] = answer = plan.ask(candidate)
            if answer.error > plan.tolerance.value:
                break
        else:
            total = sum(answer.bytes for answer in answers.values())
            fetches = sum(plan.material.share * answers[plan.material.source].fetches for plan in shown)
            return OneSize(candidate, total, fetches)
    return None


def _record(candidate: Candidate) -> dict[str, Any]:
    return {"method": candidate.method, "textures": candidate.textures, "size": candidate.size}
