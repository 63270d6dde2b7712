"""Planning: the cheapest representation of every material of a scene that meets its tolerances."""

import os
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from homofact.api.places import check_file, check_place
from homofact.api.progress import Progress, ProgressSteps
from homofact.api.refusing import Refusal
from homofact.api.subjects import Place
from homofact.errors import BadInput
from homofact.files.lock import claimed
from homofact.planning.settings import PlanSettings

if TYPE_CHECKING:
    from homofact.evaluation.verdict.verdict import Verdict
    from homofact.planning.plan import MaterialPlan, ScenePlan
    from homofact.planning.scene import Scene
    from homofact.relighting.plan import ObjectPlan

USUAL = PlanSettings()


@dataclass(frozen=True)
class PlanResult:
    """The plan of a scene of materials.

    Attributes
    ----------
    plan : ScenePlan
        The choice for every material, with its errors.
    verdicts : dict of Verdict
        The verdicts on the choices, by material and choice.
    against : ScenePlan or None
        The plan under the other lighting, if one was given.
    folders : dict or None
        The folder of each choice, by source; None if nothing was written.
    plot : Path or None
        The figure.
    """

    plan: "ScenePlan" = field(repr=False)
    verdicts: "Mapping[str, Verdict | None]" = field(repr=False)
    against: "ScenePlan | None" = field(repr=False)
    folders: dict[str, str] | None
    plot: Path | None

    def __str__(self) -> str:
        """Return the choices with their bytes, errors and verdicts in lines."""
        from homofact.api.plan_facts import plan_rows

        return "\n".join(f"{name}: {value}" for name, value in plan_rows(self.record()).items() if value)

    @property
    def warnings(self) -> Sequence[str]:
        """Tolerances that no choice meets, in sentences."""
        from homofact.planning.missed import missed_by_all

        return missed_by_all(self.plan)

    @property
    def missed(self) -> tuple[str, ...]:
        """The labels in `verdicts` whose choices miss the tolerance; these choices are the closest ones found."""
        return tuple(_label(each) for each in self.plan.distinct if each.walk.choice and not each.walk.met)

    def record(self) -> dict[str, Any]:
        """Return the JSON form."""
        from homofact.planning.record import plan_record

        answer = plan_record(self.plan)
        if self.against is not None:
            answer["against"] = plan_record(self.against)
        return answer | {"plot": None if self.plot is None else str(self.plot), "folders": self.folders}


@dataclass(frozen=True)
class TransportPlan:
    """The plan of a relighting scene: how to store each object's transport.

    Attributes
    ----------
    scene : str
        The scene's name.
    light : str
        Its light in words.
    reflected : float
        The tolerance: relative RMS of the reflected light.
    objects : tuple of ObjectPlan
        The choices for each object.
    notes : tuple of str
        Remarks from the planning, in sentences.
    """

    scene: str
    light: str
    reflected: float
    objects: "tuple[ObjectPlan, ...]"
    notes: tuple[str, ...]

    @property
    def warnings(self) -> list[str]:
        """Tolerances that no choice meets, in sentences."""
        return [plan.warning for plan in self.objects if plan.warning]

    @property
    def nbytes(self) -> int:
        """Bytes of all choices."""
        return sum(plan.chosen.bytes for plan in self.objects)

    def record(self) -> dict[str, Any]:
        """Return the JSON form."""
        return transport_record(self.objects) | {"scene": self.scene, "light": self.light}


class PlanRefused(BadInput):
    """A plan that `strict` or `refuse` rejects; `result` is the plan."""

    def __init__(self, why: BadInput, result: PlanResult | TransportPlan) -> None:
        """Copy the location and message of the reason."""
        super().__init__(why.found, where=why.where, expected=why.expected, hint=why.hint)
        self.result = result


def plan(
    scene: "Place | Scene",
    to: Place | None = None,
    *,
    plot: Place | None = None,
    against: str | None = None,
    tolerance: str | None = None,
    effort: str | float = USUAL.effort,
    budget: float | None = None,
    count: int = USUAL.count,
    strict: bool | float = False,
    refuse: Sequence[str] = (),
    force: bool = False,
    progress: Progress | None = None,
) -> PlanResult | TransportPlan:
    """Find the cheapest representation of every material of a scene that meets its tolerances.

    Parameters
    ----------
    scene : path or Scene
        A TOML file with materials, lighting and tolerance, or with objects to relight; or a `planning.scene.Scene`.
    to : path, optional
        The folder for the choices and plan.json. Default: nothing is written.
    plot : path, optional
        A figure of error against bytes (.png, .pdf, .svg).
    against : str, optional
        A second, named lighting, for which homofact also makes a plan.
    tolerance : str, optional
        A named tolerance that replaces the scene's: "visible" allows only differences that people do not notice.
    effort : str or int, optional
        How much each search tries: "quick", "normal", "thorough", or a number of inner evaluations.
    budget : float, optional
        Time limit of each search in seconds. If a search reaches it, the plan is not reproducible.
    count : int, optional
        Number of pairs of directions to sample from an analytic model.
    strict : bool or float, optional
        Raise `PlanRefused` if a tolerance is missed or a verdict warns; a number is the largest accepted probability of
        a bad fit. A plan that misses a tolerance is still written; a plan with a refused fit is not.
    refuse : sequence of str, optional
        Raise `PlanRefused` for a fit with any of these findings.
    force : bool, optional
        Replace a plan that is in the folder.
    progress : callable, optional
        Called with a `ProgressStep` on the way.

    Returns
    -------
    PlanResult or TransportPlan
        The choices. For a relighting scene, how to store each object's transport.

    Raises
    ------
    BadInput
        For a scene or sources that cannot be read, and a folder that already contains files.
    PlanRefused
        If `strict` or `refuse` reject the plan. This is a `BadInput` with the plan as `result`.

    Examples
    --------
    >>> scene = [
    ...     '[[material]]', 'source = "material:phong-10"', 'share = 1.0',
    ...     '[lighting]', 'named = "overcast"',
    ...     '[tolerance]', 'reflected = 0.5',
    ... ]
    >>> _ = Path("scene.toml").write_text("\\n".join(scene))
    >>> found = homofact.plan("scene.toml", count=500)
    >>> [material.name for material in found.plan.materials], found.warnings
    (['phong-10'], ())
    """
    steps = ProgressSteps(progress)
    if isinstance(scene, str | os.PathLike) and _is_relighting(Path(scene)):
        given = {
            "plot": plot, "to": to, "against": against, "tolerance": tolerance,
            "effort": effort != USUAL.effort, "budget": budget, "count": count != USUAL.count, "force": force,
            "refuse": refuse,
        }  # fmt: skip
        return _plan_transport(Path(scene), given, strict is not False, steps)
    refusal = Refusal.of(strict, refuse)
    figure = None if plot is None else Path(plot)
    if figure is not None:
        check_file(figure, ".png", ".pdf", ".svg")
    settings = PlanSettings(effort, budget, count)

    from homofact.planning.clock import PlanClock
    from homofact.planning.export import check_plan_folder, write_plan
    from homofact.planning.ladder import FitOptions
    from homofact.planning.missed import missed_by_all
    from homofact.planning.neighbours import with_larger_measured
    from homofact.planning.plan import plan_scene
    from homofact.planning.scene import read_scene
    from homofact.planning.tolerance import Tolerance
    from homofact.scene.lighting import named_lighting

    folder = None if to is None else Path(to)
    if folder is not None:
        check_plan_folder(folder, force)
        check_place(folder)
    asked = read_scene(Path(scene)) if isinstance(scene, str | os.PathLike) else scene
    if tolerance is not None:
        alike = tuple(replace(each, tolerance=None) for each in asked.materials)
        asked = replace(asked, materials=alike, tolerance=Tolerance.named(tolerance))
    other_lighting = None if against is None else named_lighting(against)
    with claimed(folder) if folder is not None else nullcontext():
        steps.warm_up()
        options = FitOptions(**vars(settings), seed=asked.seed)
        fits: dict[str, Any] = {}
        again = 0 if other_lighting is None else len({material.key for material in asked.materials})
        clock = PlanClock(steps.stage, following=again)
        found = with_larger_measured(plan_scene(asked, options, fits, clock, larger=True), clock.larger)
        other = None
        if other_lighting is not None:
            clock.following = 0
            other = plan_scene(replace(asked, lightings=(other_lighting,)), options, fits, clock)
        verdicts = _verdicts(found, steps)
        missed = missed_by_all(found) if refusal.strict else ()
        refused = None if missed else refusal.first(verdicts)
        if refused is not None:
            raise PlanRefused(refused, PlanResult(found, verdicts, other, None, None))
        steps.stage("writing")
        if figure is not None:
            _draw(figure, found)
        folders = None if folder is None else write_plan(folder, found, force)
    result = PlanResult(found, verdicts, other, folders, figure)
    if missed:
        raise PlanRefused(BadInput(missed[0]), result)
    return result


def transport_record(plans: "Sequence[ObjectPlan]") -> dict[str, Any]:
    """Return the JSON form of the plans of one or more objects of a scene."""
    return {
        "reflected": plans[0].reflected,
        "objects": [plan.record() for plan in plans],
        "bytes": sum(plan.chosen.bytes for plan in plans),
        "warnings": [plan.warning for plan in plans if plan.warning],
    }


def _is_relighting(scene: Path) -> bool:
    if not scene.is_file():
        return False
    from homofact.relighting.scene_kind import is_relight_scene

    return is_relight_scene(scene)


def _verdicts(found: "ScenePlan", steps: ProgressSteps) -> "dict[str, Verdict | None]":
    """Return the verdicts on the materials' choices, by material and choice."""
    from homofact.evaluation.estimate import TimeEstimate, verdict_seconds

    chosen = [material for material in found.distinct if material.walk.choice]
    estimate = TimeEstimate(
        [("verdict", verdict_seconds(len(each.fits.source.samples), first=True)) for each in chosen]
    )
    verdicts = {}
    for number, material in enumerate(chosen):
        estimate.begin()
        steps.run(f"judging {_label(material)}", number, len(chosen), estimate.time_left())
        verdicts[_label(material)] = material.verdict
    return verdicts


def _label(material: "MaterialPlan") -> str:
    choice = material.walk.choice
    return material.name if choice is None else f"{material.name}, {material.walk.kept(choice).words}"


def _draw(figure: Path, found: "ScenePlan") -> None:
    from homofact.files.atomic import replace_file
    from homofact.planning.figure import plot_plan

    figure.parent.mkdir(parents=True, exist_ok=True)
    replace_file(figure, lambda beside: plot_plan(beside, found))


def _plan_transport(scene: Path, given: Mapping[str, object], strict: bool, steps: ProgressSteps) -> TransportPlan:
    """Plan the transport of a scene of relighting.

    Raises BadInput for options that apply only to fits, and for a scene without a tolerance. If `strict`, raises
    PlanRefused for a tolerance that cannot be met.
    """
    for name, value in given.items():
        if value:
            raise BadInput(f"{scene} is a scene of relighting, which fits nothing", where=name, expected="none")

    from homofact.relighting.build import open_relight_scene
    from homofact.relighting.scene_file import read_relight_scene

    asked = read_relight_scene(scene)
    if asked.reflected is None:
        raise BadInput(
            where=f"{scene}: tolerance", found="none", expected="reflected = a relative RMS error of the light"
        )
    ready = open_relight_scene(asked, steps.stage)
    found = TransportPlan(asked.name, asked.light.describe(), asked.reflected, ready.plans, ready.notes)
    if strict and found.warnings:
        raise PlanRefused(BadInput(found.warnings[0]), found)
    return found
