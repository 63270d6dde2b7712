"""`homofact plan`: find the smallest representations that meet a scene's tolerance under its lighting."""

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.text import Text

from homofact.cli import options as o
from homofact.cli.layout import hanging
from homofact.cli.plan_relight import choice_table as transport_table
from homofact.cli.plan_tables import choice_table, evidence_table, fetches_in_words, step_table
from homofact.cli.screen import Screen
from homofact.cli.tables import identical_grade
from homofact.cli.verdicts import brief_lines, names_of, noted, strictness
from homofact.evaluation.wording import listed, part_of_limit
from homofact.planning.settings import PlanSettings
from homofact.planning.tolerance import MARGINS, WORDS
from homofact.settings.options import options_of

if TYPE_CHECKING:
    from homofact.api.planning import PlanResult, TransportPlan
    from homofact.evaluation.opinion import Opinion
    from homofact.evaluation.verdict.verdict import Verdict
    from homofact.planning.plan import MaterialPlan, ScenePlan

_SETTINGS = options_of(PlanSettings)
_TILT = "tilt"  # a finding


def plan(
    scene: Annotated[Path, typer.Argument(metavar="SCENE.toml", help="Materials, lighting and tolerance.")],
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Draw error against bytes (.png, .pdf, .svg).")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="Folder for the chosen representations and plan.json.")
    ] = None,
    against: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Also plan for this built-in lighting (such as studio), and print the costs of both plans.",
        ),
    ] = None,
    tolerance: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Replace the scene's tolerances. The tolerance visible allows differences that people do not"
            " notice. It does not work for lists of samples.",
        ),
    ] = None,
    effort: Annotated[str, typer.Option(help=f"{_SETTINGS['effort'].option.help}.")] = str(_SETTINGS["effort"].default),
    budget: Annotated[float | None, typer.Option(metavar="SECONDS", help=f"{_SETTINGS['budget'].option.help}.")] = None,
    count: Annotated[int, typer.Option(help=f"{_SETTINGS['count'].option.help}.")] = _SETTINGS["count"].default,
    force: Annotated[bool, typer.Option("--force", help="Replace an existing plan.")] = False,
    strict: Annotated[
        str,
        typer.Option(
            "--strict",
            metavar="[=P]",
            help="Print the plan, and exit with code 2 if it misses a tolerance or a verdict warns. --strict=0.05"
            " makes a verdict count if the fit is bad with a probability above 5%.",
            show_default=False,
        ),
    ] = "",
    refuse: o.Refuse = "",
    as_json: o.AsJson = False,
    quiet: o.Quiet = False,
) -> None:
    """Find the smallest representation of each material of a scene within your tolerance.

    The plan meets the scene's tolerances under each of the scene's lightings. homofact checks this in rendered views,
    and adds a safety margin for other views. If the byte budget is too small, it distributes the bytes so that the
    picture has the smallest error. For a relighting scene, it chooses the transport settings of each object. The
    command does not correct measurements. If a measured sample was tilted, first undo the tilt with homofact convert
    --calibrate tilt. The documentation explains all this on the page "Plan a scene".
    """
    from homofact.api.planning import PlanRefused, PlanResult, TransportPlan, plan

    screen = Screen(as_json, quiet)
    refused = None
    with screen.progress() as progress:
        try:
            found = plan(
                scene, out, plot=plot, against=against, tolerance=tolerance,
                effort=_SETTINGS["effort"].from_text(effort), budget=budget, count=count, strict=strictness(strict),
                refuse=names_of(refuse), force=force, progress=progress,
            )  # fmt: skip
        except PlanRefused as error:
            # The plan shows what is missed, and what would meet it.
            found, refused = error.result, error
    if isinstance(found, TransportPlan):
        _show_transport(found, screen)
    # Without a folder they are all that there is to see, as of `compare`.
    elif not quiet or out is None:
        _show(found, screen)
    if isinstance(found, PlanResult):
        if found.plot is not None:
            screen.note(f"The figure: {found.plot}")
        if out is not None and found.folders is not None:
            from homofact.planning.export import COLOUR

            screen.note(f"The choices: {out}")
            # A choice with textures, where there is one, shows more than a colour.
            for name in sorted(found.folders.values(), key=lambda each: (out / each / COLOUR).exists())[:1]:
                screen.note(f"Export one to an engine: homofact export {out / name} --out FOLDER --engine three")
    if as_json:
        # With verdicts on what was chosen under the other lighting, which nothing else shows.
        screen.answer(found.record())
    if refused is not None:
        raise refused


def _show(found: "PlanResult", screen: Screen) -> None:
    plan = found.plan
    steps = step_table(plan)
    # First of all: nothing below is within the tolerance then.
    screen.show(*(Text(f"Warning: {line}.", "bold red") for line in found.warnings))
    screen.show(choice_table(plan), *([] if steps is None else [steps]), *map(Text, _reading_lines(plan)))
    doubted = doubt_lines(found.verdicts, found.missed)
    screen.show(*(Text(doubts, "bold red") for doubts in doubted))
    if doubted and not all(each.tolerance.trusted for each in plan.distinct):
        screen.show("To get only choices that their verdicts trust, add trusted = true to the tolerance.")
    screen.show("", evidence_table(plan), *map(Text, _lines(plan, found.against)))
    verdicts = [hanging(line, len("  - " if line.startswith(" ") else "  ")) for line in finding_lines(found.verdicts)]
    screen.show(*([""] if verdicts else []), *verdicts)


def _show_transport(found: "TransportPlan", screen: Screen) -> None:
    for line in found.notes:
        screen.note(f"homofact: {line}")
    warnings = (Text(f"Warning: {line}.", "bold red") for line in found.warnings)
    screen.show(transport_table(found.objects, found.reflected), *warnings)
    screen.note(f"Of all objects: {found.nbytes / 1000:.0f} kB")


def doubt_lines(verdicts: "Mapping[str, Verdict | None]", missed: Collection[str] = ()) -> list[str]:
    """Return a line on the untrusted choices that meet the tolerance, and one on those that miss it.

    `missed` contains the labels of `verdicts` whose choices miss the tolerance. These choices are only the closest
    found.
    """
    names = [label for label, verdict in verdicts.items() if verdict is not None and not verdict.trusted]
    met, closest = [name for name in names if name not in missed], [name for name in names if name in missed]
    lines = []
    for group, begin, beside in (
        (met, "Before you ship, read", "that the tolerance does not cover"),
        (closest, "What was found is only the closest. Read also", "that the plan does not count"),
    ):
        if group:
            many = len(group) > 1
            whose, name = f"the verdict{'s' * many} on {'; '.join(group)}", "they name" if many else "it names"
            lines.append(f"{begin} {whose} below: {name} faults {beside}.")
    return lines


def finding_lines(verdicts: "Mapping[str, Verdict | None]") -> list[str]:
    """Return the verdict of each choice, and its findings on data and coverage that widen an error bar."""
    from homofact.evaluation.verdict.finding import About

    lines = []
    for label, verdict in verdicts.items():
        if verdict is None:
            continue
        lines += brief_lines({label: verdict})
        lines += [f"  - why it warns: {verdict.cause}"] if verdict.cause else []
        for each in verdict.findings:
            if (each.costs and each.about is not About.FIT) or each.name == _TILT:
                lines.append(f"  - {each.about.title.lower()}: {noted(each)}")
    if any(each.name == _TILT for verdict in verdicts.values() if verdict is not None for each in verdict.findings):
        lines.append(
            "A plan takes measurements as they are. To undo a tilt, run homofact convert SOURCE NEW.csv"
            " --calibrate tilt, and name NEW.csv in the scene."
        )
    return lines


def _reading_lines(found: "ScenePlan") -> list[str]:
    """How to read the choices and their neighbours."""
    from homofact.planning.neighbours import larger

    kinds = [kind for kind in found.limited_kinds if MARGINS[kind] != 1]
    margins = ", ".join(f"{WORDS[kind]} × {MARGINS[kind]:g}" for kind in kinds)
    margin = f", with a margin for views that were not rendered ({margins})" if margins else ""
    steps = map(larger, found.distinct)
    expected = (
        ' An error with "about" is expected from the fits that were made; that step may turn out to err more.'
        if any(step is not None and not step.measured for step in steps)
        else ""
    )
    return [f"of limit: the part of your tolerance that the worst error uses{margin}; up to 100% it is met.{expected}"]


def _one_size_lines(found: "ScenePlan") -> list[str]:
    """Return what one representation for all of several materials would take."""
    if len(found.distinct) == 1:
        return []
    one = found.one_size
    if one is None:
        trusted = " and is trusted" * any(each.tolerance.trusted for each in found.distinct)
        return [f"One size for all: no single representation was found that meets the tolerance{trusted} everywhere."]
    return [
        f"One size for all: {one.candidate.words} for every material takes {one.bytes} bytes and, on average over the"
        f" pixels, {fetches_in_words(one.fetches)}. The plan takes {found.bytes} bytes"
        f" ({_less(found.bytes, one.bytes)}) and {fetches_in_words(found.fetches)}."
    ]


def grade_lines(opinions: "Sequence[tuple[str, Opinion | None]]") -> list[str]:
    """Return a line with the expected grade of each choice, and a line with the choices without a grade."""
    graded = [(name, each) for name, each in opinions if each is not None]
    lines = []
    if graded:
        grades = ", ".join(f"{name} {each.score:.1f} ({each.low:.1f} to {each.high:.1f})" for name, each in graded)
        lines.append(
            f"Grades that people are expected to give, from 1 to 5 (in brackets the range of 90% of studies): {grades}."
            f" Identical pictures get {identical_grade()}."
        )
    without = [name for name, each in opinions if each is None]
    if without:
        whose = "its" if len(without) == 1 else "their"
        lines.append(
            f"Not graded: {listed(without)}, known only at {whose} samples. A grade compares pictures of the fit and of"
            " its source."
        )
    return lines


def _reference_lines(found: "ScenePlan") -> list[str]:
    """For which materials the reference follows a GGX model beyond the samples, and what this hides."""
    from homofact.brdf.scattered import models_the_rest

    lit = [each for each in found.distinct if each.tolerance.of_light]
    modelled = [each for each in lit if models_the_rest(each.fits.source.reflectance)]
    if not modelled:
        return []
    line = (
        f"{listed([each.name for each in modelled])}: light is compared with an interpolation of the samples. Beyond"
        " the measured angles the interpolation follows a GGX model, which favours GGX choices there."
    )
    if not all("cole" in each.tolerance.kinds for each in modelled):
        line += " To judge choices at the samples too, add a limit on cole."
    return [line]


def _lines(found: "ScenePlan", other: "ScenePlan | None") -> list[str]:
    lines = [
        "order: spherical-harmonic order that the lobe needs under this lighting; terms: in-out SVD terms for it;"
        " reflected: relative RMS error."
    ]
    lines += [f"{each.name} {each.describe_spectrum()}." for each in found.scene.lightings]
    lines += _reference_lines(found)
    for each in found.distinct:
        if each.highlight_pixels is not None:
            lines.append(
                f"{each.name}, an object {each.material.pixels} pixels wide: its highlight is about"
                f" {each.highlight_pixels:.2g} pixels wide."
            )
    lines += grade_lines([(each.name, each.opinion) for each in found.distinct if each.errors])
    if not any(each.tolerance.of_light for each in found.distinct):
        lines.append(
            "The Cole error weighs all pairs of directions equally, so the lighting does not change this plan."
            if "cole" in found.limited_kinds
            else "This tolerance has its own light, so the scene's lighting does not change this plan."
        )
    if found.allocated:
        lines.append(
            f"The best choices together take {found.wanted_bytes} bytes, more than the {found.scene.budget.bytes} of"
            " the budget. The plan distributes these so that the materials' errors, each in parts of its limit and"
            f" weighted by its share of the picture, have the least sum: {part_of_limit(found.error)}."
        )
    lines += _one_size_lines(found)
    lines.append(
        f"Fits made: {found.planning_fits} to find the choices, then {found.fits - found.planning_fits} for the rest of"
        f" this output. To fit every candidate to every material, {found.exhaustive_fits} fits would be needed."
    )
    if other is not None:
        against = other.scene.lightings[0]
        bills = ", ".join(
            f"{mine.name} {_bill(mine)} against {_bill(theirs)} (order {max(mine.needed_orders)} against"
            f" {max(theirs.needed_orders)})"
            for mine, theirs in zip(found.materials, other.materials, strict=True)
        )
        comparable = all(each.walk.met for plan in (found, other) for each in plan.distinct)
        less = f" ({_less(found.bytes, other.bytes)})" if comparable else ""
        lines.append(
            f"Against {against.name}, which {against.describe_spectrum()}: {found.bytes} bytes against"
            f" {other.bytes}{less}. {bills}."
        )
        if not comparable:
            lines.append(
                "missed: the best representation misses the tolerance, so its bytes are not those of meeting it."
            )
    return lines


def _bill(each: "MaterialPlan") -> str:
    return "nothing" if each.outcome is None else f"{each.outcome.bytes} bytes{'' if each.walk.met else ' (missed)'}"


def _less(mine: int, theirs: int) -> str:
    return f"{1 - mine / theirs:.0%} less" if mine <= theirs else f"{mine / theirs - 1:.0%} more"
