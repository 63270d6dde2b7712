"""`homofact plan`: no more than a scene needs, by its lighting and a tolerance."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table
from rich.text import Text

from homofact.cli import options as o
from homofact.cli.layout import add_figures, add_names, plain_table
from homofact.cli.plan_relight import choice_table as transport_table
from homofact.cli.screen import Screen
from homofact.cli.verdicts import brief_lines, names_of, noted, strictness
from homofact.evaluation.wording import figure
from homofact.planning.settings import PlanSettings
from homofact.settings.options import options_of

if TYPE_CHECKING:
    from homofact.api.planning import PlanResult, TransportPlan
    from homofact.evaluation.verdict.verdict import Verdict
    from homofact.planning.plan import MaterialPlan, ScenePlan

_SETTINGS = options_of(PlanSettings)


def plan(
    scene: Annotated[Path, typer.Argument(metavar="SCENE.toml", help="Materials, lighting and tolerance.")],
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Draw error against bytes (.png, .pdf, .svg).")
    ] = None,
    write: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="Export the chosen representations, and plan.json.")
    ] = None,
    against: Annotated[
        str | None, typer.Option(metavar="NAME", help="Also plan for this named lighting, and compare the costs.")
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
            help="Exit with code 2 if a tolerance is missed or a verdict warns; --strict=0.05 moves the threshold.",
            show_default=False,
        ),
    ] = "",
    refuse: o.Refuse = "",
    as_json: o.AsJson = False,
    quiet: o.Quiet = False,
) -> None:
    """Find the smallest representation of each material of a scene within your tolerance.

    The plan meets the scene's tolerances under each of its lightings, in
    rendered views and with a margin for other views: docs/planning.md. If the
    byte budget is too small, it distributes the bytes so that the picture has
    the smallest error. For a relighting scene, it chooses the transport
    settings of each object: docs/relighting.md.
    """
    from homofact.api.planning import PlanResult, TransportPlan, plan

    screen = Screen(as_json, quiet)
    with screen.progress() as progress:
        found = plan(
            scene, write, plot=plot, against=against, effort=_SETTINGS["effort"].from_text(effort),
            budget=budget, count=count, strict=strictness(strict), refuse=names_of(refuse), force=force,
            progress=progress,
        )  # fmt: skip
    if isinstance(found, TransportPlan):
        _show_transport(found, screen)
    # Without a folder they are all that there is to see, as of `compare`.
    elif not quiet or write is None:
        _show(found, screen)
    if isinstance(found, PlanResult):
        if plot is not None:
            screen.note(f"The figure: {plot}")
        if write is not None:
            screen.note(f"The choices: {write}")
    if as_json:
        # With verdicts on what was chosen under the other lighting, which nothing else shows.
        screen.answer(found.record())


def _show(found: "PlanResult", screen: Screen) -> None:
    plan = found.plan
    screen.show(choice_table(plan), evidence_table(plan), *(Text(line) for line in _lines(plan, found.against)))
    screen.show(*(Text(line) for line in finding_lines(found.verdicts)))
    for line in found.warnings:
        screen.show(Text(f"Warning: {line}.", "bold red"))


def _show_transport(found: "TransportPlan", screen: Screen) -> None:
    for line in found.notes:
        screen.note(f"homofact: {line}")
    warnings = (Text(f"Warning: {line}.", "bold red") for line in found.warnings)
    screen.show(transport_table(found.objects, found.reflected), *warnings)
    screen.note(f"Of all objects: {found.nbytes / 1000:.0f} kB")


def choice_table(found: "ScenePlan") -> Table:
    """One line per material: its share, the choice, how much of the tolerance it uses, what it costs, its fits."""
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
    """List each choice under each lighting: the order that its lobe needs, and all errors, without margins."""
    from homofact.planning.theory import terms_needed

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
    """A line on each choice, and what is noted of its data, or was not measured, where that widens an error bar."""
    from homofact.evaluation.verdict.finding import About

    lines = []
    for label, verdict in verdicts.items():
        if verdict is None:
            continue
        lines += brief_lines({label: verdict})
        for each in verdict.findings:
            if each.costs and each.about is not About.FIT:
                lines.append(f"  - {each.about.title.lower()}: {noted(each)}")
    return lines


def _name(each: "MaterialPlan") -> Text:
    pixels = each.material.pixels
    return Text(each.name if pixels is None else f"{each.name}, {pixels} pixels")


def _lighting_names(found: "ScenePlan") -> str:
    return " and ".join(each.name for each in found.scene.lightings)


def _lines(found: "ScenePlan", other: "ScenePlan | None") -> list[str]:
    lines = [f"Lighting: {each.name}; {each.describe_spectrum()}." for each in found.scene.lightings]
    lines.append(
        "order: the harmonic order at which the lobe can be cut under this lighting; terms: those of an in-out SVD"
        " for that order. of tolerance: the largest part of a limit that is used, with the margin for unseen views."
    )
    for each in found.distinct:
        if each.highlight_pixels is not None:
            lines.append(
                f"{each.name} at {each.material.pixels} pixels: its highlight covers {each.highlight_pixels:.2g}."
            )
    if not found.scene.tolerance.of_light:
        lines.append(
            "The Cole error weighs all pairs of directions equally, so the lighting does not change this plan."
        )
    if found.allocated:
        lines.append(
            f"The choices that meet the tolerance exceed {found.scene.budget.bytes} bytes. The plan distributes these"
            f" to minimize the picture's error: {found.error:.0%} of the tolerance, weighted by the materials' shares."
        )
    one = found.one_size
    if one is None:
        lines.append("One size for all: no single representation was found that meets the tolerance everywhere.")
    else:
        lines.append(
            f"One size for all: {one.candidate.label} for every material takes {one.bytes} bytes and {one.fetches:.3g}"
            f" fetches per pixel. The plan takes {found.bytes} bytes ({_less(found.bytes, one.bytes)}) and"
            f" {found.fetches:.3g}."
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
