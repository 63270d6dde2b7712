"""`homofact plan`: no more than a scene needs, by its lighting and a tolerance."""

from collections.abc import Mapping
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table
from rich.text import Text

from homofact.cli import options as o
from homofact.cli.layout import add_figures, add_names, plain_table
from homofact.cli.places import check_file, check_place
from homofact.cli.plan_relight import plan_relight
from homofact.cli.screen import Screen
from homofact.cli.verdicts import brief_lines, refuse_findings, refused_names
from homofact.config import fit_options
from homofact.errors import BadInput
from homofact.evaluate.wording import figure
from homofact.files.lock import claimed
from homofact.methods.search import Search

if TYPE_CHECKING:
    from homofact.evaluate.verdict.verdict import Verdict
    from homofact.scene.plan.plan import MaterialPlan, ScenePlan


_COUNT = 8000


def plan(
    scene: Annotated[Path, typer.Argument(metavar="SCENE.toml", help="Materials, lighting and tolerance.")],
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Draw error against bytes (.png, .pdf, .svg).")
    ] = None,
    write: Annotated[Path | None, typer.Option(metavar="FOLDER", help="Export the chosen ones and plan.json.")] = None,
    against: Annotated[
        str | None, typer.Option(metavar="NAME", help="Plan under this named lighting too, and compare the bills.")
    ] = None,
    effort: Annotated[
        str,
        typer.Option(help="How much each search tries: quick, normal, thorough, or a number of inner evaluations."),
    ] = "quick",
    budget: Annotated[
        float | None,
        typer.Option(metavar="SECONDS", help="A guard: ends each search, and the plan is then not reproducible."),
    ] = None,
    count: Annotated[int, typer.Option(help="Pairs drawn from an analytic model.")] = _COUNT,
    force: Annotated[bool, typer.Option("--force", help="Replace a plan that is in the folder.")] = False,
    strict: Annotated[
        bool,
        typer.Option(
            "--strict",
            help="Refuse a missed tolerance, and a fit that does something wrong that a picture shows: exit 2.",
        ),
    ] = False,
    refuse: o.Refuse = "",
    as_json: o.AsJson = False,
    quiet: o.Quiet = False,
) -> None:
    """Find the cheapest representation of every material of a scene.

    It meets the scene's tolerances under each of its lightings, in drawn
    views and with a margin for others: docs/planning.md. Where the bytes do
    not suffice, they are shared out so that the picture errs least. Of a
    scene of relighting, it chooses how each object's transport is held:
    docs/relighting.md.
    """
    if scene.is_file() and _of_relighting(scene):
        given = {
            "plot": plot, "write": write, "against": against, "effort": effort != "quick", "budget": budget,
            "count": count != _COUNT, "force": force, "refuse": refuse,
        }  # fmt: skip
        plan_relight(scene, given, strict, Screen(as_json, quiet))
        return
    refused = refused_names(refuse)
    if plot is not None:
        check_file(plot, ".png", ".pdf", ".svg")
    searched = Search(effort=fit_options()["effort"]["search"].from_text(effort), budget=budget)
    if count < 100:
        raise BadInput(f"count: found {count}, expected at least 100")

    from homofact.files.atomic import replace_file
    from homofact.linear.normal import warm_up
    from homofact.scene.lighting import named_lighting
    from homofact.scene.plan.bench import Bench
    from homofact.scene.plan.export import check_plan_folder, write_plan
    from homofact.scene.plan.figure import plot_plan
    from homofact.scene.plan.ladder import FitOptions
    from homofact.scene.plan.plan import plan_scene
    from homofact.scene.plan.record import plan_record
    from homofact.scene.plan.scene import read_scene

    if write is not None:
        check_plan_folder(write, force)
        check_place(write)
    asked = read_scene(scene)
    other_lighting = None if against is None else named_lighting(against)
    screen = Screen(as_json, quiet)
    with claimed(write) if write is not None else nullcontext(), screen.bar() as bar:
        bar.stage("warming up")
        warm_up()
        options = FitOptions(effort=searched.effort, budget=budget, count=count, seed=asked.seed)
        benches: dict[str, Bench] = {}
        found = plan_scene(asked, options, benches, bar.stage)
        other = None
        if other_lighting is not None:
            from dataclasses import replace

            other = plan_scene(replace(asked, lightings=(other_lighting,)), options, benches, bar.stage)
        if strict and found.warnings:
            raise BadInput(found.warnings[0])
        bar.stage("judging the choices")
        verdicts = {
            f"{each.name}, {each.walk.choice.label}": each.verdict for each in found.distinct if each.walk.choice
        }
        for label, verdict in verdicts.items():
            if verdict is not None:
                refuse_findings(verdict, label, strict, refused)
        answer: dict[str, Any] = plan_record(found)
        bar.stage("writing")
        if plot is not None:
            plot.parent.mkdir(parents=True, exist_ok=True)
            replace_file(plot, lambda beside: plot_plan(beside, found))
        folders = None if write is None else write_plan(write, found, force)
    # Without a folder they are all that there is to see, as of `compare`.
    if not quiet or write is None:
        screen.show(choice_table(found), evidence_table(found), *(Text(line) for line in _lines(found, other)))
        screen.show(*(Text(line) for line in finding_lines(verdicts)))
        for line in found.warnings:
            screen.show(Text(f"Warning: {line}.", "bold red"))
    if plot is not None:
        screen.note(f"The figure: {plot}")
    if write is not None:
        screen.note(f"The choices: {write}")
    if other is not None:
        answer["against"] = plan_record(other)
    screen.answer(answer | {"plot": None if plot is None else str(plot), "folders": folders})


def _of_relighting(scene: Path) -> bool:
    from homofact.scene.transport.scene import is_relight_scene

    return is_relight_scene(scene)


def choice_table(found: "ScenePlan") -> Table:
    """A line a material: its share, the choice, how much of the tolerance it uses, what it costs, its fits."""
    table = plain_table(f"{found.scene.tolerance.describe()} under {_lighting_names(found)}")
    add_names(table, longest=max(len(_name(each)) for each in found.materials))
    table.add_column("chosen")
    add_figures(table, "share", "of tolerance", "bytes", "fetches", "fits")
    for each in found.materials:
        choice, outcome = each.walk.choice, each.outcome
        share, fits = f"{each.material.share:.0%}", str(each.walk.fits)
        if choice is None or outcome is None:
            table.add_row(_name(each), Text("none", "bold red"), share, "–", "–", "–", fits)
            continue
        error = Text(f"{outcome.error:.0%}", "bold" if each.walk.met else "bold red")
        table.add_row(_name(each), choice.label, share, error, str(outcome.bytes), str(outcome.fetches), fits)
    return table


def evidence_table(found: "ScenePlan") -> Table:
    """Of each choice under each lighting: the order that its lobe is needed to, and all errors, without margins."""
    from homofact.scene.plan.theory import terms_needed

    table = plain_table("Evidence")
    add_names(table, longest=max(len(_name(each)) for each in found.materials))
    several = len(found.materials[0].judges) > 1
    if several:
        table.add_column("under")
    add_figures(table, "order", "terms", "reflected", "ΔE", "p95", "peak", "cole")
    for each in found.materials:
        for k, (judge, order) in enumerate(zip(each.judges, each.needed_orders, strict=True)):
            row: list[str | Text] = [_name(each) if k == 0 else ""]
            row += [judge.lighting.name] if several else []
            row += [str(order), str(terms_needed(order))]
            if each.errors:
                errors = each.errors[k]
                kinds = ("reflected", "delta_e", "delta_e_p95", "delta_e_peak", "cole")
                row += [figure(errors.of(kind)) for kind in kinds]
            else:
                row += ["–"] * 5
            table.add_row(*row)
    return table


def finding_lines(verdicts: "Mapping[str, Verdict | None]") -> list[str]:
    """A line on each choice, and in full what is odd in its data or was not measured, where a picture shows it."""
    from homofact.evaluate.verdict.finding import About

    lines = []
    for label, verdict in verdicts.items():
        if verdict is None:
            continue
        lines += brief_lines({label: verdict})
        for each in verdict.findings:
            if each.matters and each.about is not About.FIT:
                lines.append(f"  - {each.about.title.lower()}, {each.grade.value}: {each.line()}")
    return lines


def _name(each: "MaterialPlan") -> Text:
    pixels = each.material.pixels
    return Text(each.name if pixels is None else f"{each.name}, {pixels} pixels")


def _lighting_names(found: "ScenePlan") -> str:
    return " and ".join(each.name for each in found.scene.lightings)


def _lines(found: "ScenePlan", other: "ScenePlan | None") -> list[str]:
    lines = [f"Lighting: {each.name}; {each.describe_spectrum()}." for each in found.scene.lightings]
    lines.append(
        "order: after which a lobe may be cut under this lighting; terms: of an in-out SVD for that order. of"
        " tolerance: the largest part of a limit that is used, with the margin for views that were not drawn."
    )
    for each in found.distinct:
        if each.highlight_pixels is not None:
            lines.append(
                f"{each.name} at {each.material.pixels} pixels: its highlight covers {each.highlight_pixels:.2g}."
            )
    if not found.scene.tolerance.of_light:
        lines.append("The Cole error weighs all pairs of directions alike: the lighting does not change this plan.")
    if found.allocated:
        lines.append(
            f"The choices that meet the tolerance exceed {found.scene.budget.bytes} bytes: these are shared out so that"
            f" the picture errs least, {found.error:.0%} of the tolerance by the materials' shares."
        )
    one = found.one_size
    if one is None:
        lines.append("One size for all: no single representation was found that meets the tolerance everywhere.")
    else:
        lines.append(
            f"One size for all: {one.candidate.label} for every material, {one.bytes} bytes and {one.fetches:.3g}"
            f" fetches a pixel. The plan: {found.bytes} bytes ({_less(found.bytes, one.bytes)}), {found.fetches:.3g}."
        )
    lines.append(
        f"Fits: {found.planning_fits} to choose, {found.fits} with one size for all; an exhaustive search needs"
        f" {found.exhaustive_fits}."
    )
    if other is not None:
        against = other.scene.lightings[0]
        bills = ", ".join(
            f"{mine.name} {_bill(mine)} against {_bill(theirs)} (order {max(mine.needed_orders)} against"
            f" {max(theirs.needed_orders)})"
            for mine, theirs in zip(found.materials, other.materials, strict=True)
        )
        lines.append(
            f"Against {against.name}, which {against.describe_spectrum()}: {found.bytes} bytes against {other.bytes}"
            f" ({_less(found.bytes, other.bytes)}). {bills}."
        )
    return lines


def _bill(each: "MaterialPlan") -> str:
    return "nothing" if each.outcome is None else f"{each.outcome.bytes} bytes{'' if each.walk.met else ' (missed)'}"


def _less(mine: int, theirs: int) -> str:
    return f"{1 - mine / theirs:.0%} less" if mine <= theirs else f"{mine / theirs - 1:.0%} more"
