"""`homofact plan`: no more than a scene needs, by its lighting and a tolerance."""

from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich import box
from rich.table import Table
from rich.text import Text

from homofact.cli import options as o
from homofact.cli.places import check_file, check_place
from homofact.cli.screen import Screen
from homofact.config import fit_options
from homofact.errors import BadInput
from homofact.evaluate.wording import figure
from homofact.files.lock import claimed
from homofact.methods.search import Search

if TYPE_CHECKING:
    from homofact.scene.plan.plan import MaterialPlan, ScenePlan


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
    count: Annotated[int, typer.Option(help="Pairs drawn from an analytic model.")] = 8000,
    force: Annotated[bool, typer.Option("--force", help="Replace a plan that is in the folder.")] = False,
    strict: Annotated[
        bool, typer.Option("--strict", help="Refuse where the tolerance or the budget is missed: exit 2.")
    ] = False,
    as_json: o.AsJson = False,
    quiet: o.Quiet = False,
) -> None:
    """Find the cheapest representation of every material of a scene that meets its tolerance."""
    if plot is not None:
        check_file(plot, ".png", ".pdf", ".svg")
    searched = Search(effort=fit_options()["effort"]["search"].from_text(effort), budget=budget)
    if count < 100:
        raise BadInput(f"count: found {count}, expected at least 100")

    from homofact.files.atomic import replace_file
    from homofact.linear.normal import warm_up
    from homofact.scene.lighting import named_lighting
    from homofact.scene.plan.export import check_plan_folder, write_plan
    from homofact.scene.plan.figure import plot_plan
    from homofact.scene.plan.ladder import FitOptions
    from homofact.scene.plan.plan import Bench, plan_scene
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

            other = plan_scene(replace(asked, lighting=other_lighting), options, benches, bar.stage)
        if strict and found.warnings:
            raise BadInput(found.warnings[0])
        bar.stage("writing")
        if plot is not None:
            plot.parent.mkdir(parents=True, exist_ok=True)
            replace_file(plot, lambda beside: plot_plan(beside, found))
        folders = None if write is None else write_plan(write, found, force)
    screen.show(choice_table(found), evidence_table(found), *(Text(line) for line in _lines(found, other)))
    for line in found.warnings:
        screen.show(Text(f"Warning: {line}.", "bold red"))
    if plot is not None:
        screen.note(f"The figure: {plot}")
    if write is not None:
        screen.note(f"The choices: {write}")
    answer: dict[str, Any] = found.record()
    if other is not None:
        answer["against"] = other.record()
    screen.answer(answer | {"plot": None if plot is None else str(plot), "folders": folders})


def choice_table(found: "ScenePlan") -> Table:
    """A line a material: its share, the choice and what it costs, and how many fits that took."""
    tolerance = found.scene.tolerance
    table = _table(f"{tolerance.kind} at most {tolerance.value:g} under {found.scene.lighting.name}")
    table.add_column("chosen", no_wrap=True)
    _figures(table, "share", "error", "bytes", "fetches", "fits")
    for each in found.materials:
        choice, outcome = each.walk.choice, each.outcome
        name, share, fits = Text(each.bench.source.name), f"{each.material.share:.0%}", str(each.walk.fits)
        if choice is None or outcome is None:
            table.add_row(name, Text("none", "bold red"), share, "–", "–", "–", fits)
            continue
        error = Text(figure(outcome.error), "bold" if each.walk.met else "bold red")
        table.add_row(name, choice.label, share, error, str(outcome.bytes), str(outcome.fetches), fits)
    return table


def evidence_table(found: "ScenePlan") -> Table:
    """Of each choice: the order that its lobe is needed to, theory's error of the reflected light, and all measured."""
    from homofact.scene.plan.theory import terms_needed

    table = _table("Evidence")
    _figures(table, "order", "terms", "any light", "theory", "reflected", "delta_e", "cole")
    for each in found.materials:
        choice, errors = each.walk.choice, each.errors
        needed = (str(each.needed_order), str(terms_needed(each.needed_order)), str(each.bench.own_terms))
        if choice is None or errors is None:
            table.add_row(Text(each.bench.source.name), *needed, "–", "–", "–", "–")
            continue
        measured = (each.predicted(choice), errors.reflected, errors.delta_e, errors.cole)
        table.add_row(Text(each.bench.source.name), *needed, *map(figure, measured))
    return table


def _table(title: str) -> Table:
    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    table.add_column("", overflow="fold")
    return table


def _figures(table: Table, *names: str) -> None:
    for name in names:
        table.add_column(name, justify="right", no_wrap=True)


def _lines(found: "ScenePlan", other: "ScenePlan | None") -> list[str]:
    lighting = found.scene.lighting
    lines = [
        f"Lighting: {lighting.name}; {lighting.describe_spectrum()}.",
        "order: after which a lobe may be cut under this lighting; terms: of an in-out SVD for that order, and for"
        " 99% of the BRDF in any light. theory: the reflected error before any fit, exact for one colour, for"
        " textures what evenly spaced texels would lose.",
    ]
    if found.scene.tolerance.kind == "cole":
        lines.append("The Cole error weighs all pairs of directions alike: the lighting does not change this plan.")
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
        against = other.scene.lighting
        bills = ", ".join(
            f"{mine.bench.source.name} {_bill(mine)} against {_bill(theirs)} (order {mine.needed_order} against"
            f" {theirs.needed_order})"
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
