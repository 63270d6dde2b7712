"""`homofact info`: what is in a file or in a scene's folder, or what a named material is."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.text import Text

from homofact.cli import options as o
from homofact.cli.places import check_file
from homofact.cli.screen import Screen
from homofact.cli.subject import check_source, open_subject
from homofact.cli.tables import facts_table
from homofact.errors import BadInput

if TYPE_CHECKING:
    from homofact.brdf.source import Source
    from homofact.config import Config


@o.configured("source.path", "source", "seed", but=("source.subset",))
def info(
    settings: "Config",
    drawing: Annotated[
        Path | None, typer.Option("--plot", metavar="FILE.png", help="Draw a slice, lobes and a lit sphere.")
    ] = None,
    as_json: o.AsJson = False,
    quiet: o.Quiet = False,
) -> None:
    """Say what is in a measurement's file, or what a named material is.

    Of the folder of a scene (homofact relight, homofact edit): what it
    holds, and how far off it is.
    """
    if settings.source.path is not None and _scene(Path(settings.source.path), drawing, Screen(as_json, quiet)):
        return
    check_source(settings)
    if drawing is not None:
        check_file(drawing, ".png")

    from homofact.brdf.mending import mending_lines
    from homofact.brdf.pair_density import scheme_of
    from homofact.brdf.source import describe
    from homofact.brdf.suspicion.suspects import suspicions

    screen = Screen(as_json, quiet)
    with screen.bar() as bar:
        bar.stage("reading")
        subject = open_subject(settings)
        facts = describe(subject)
        # Of pairs that were drawn of a table the checks know nothing: they look for rings and steps of an instrument.
        if scheme_of(subject.samples) is None:
            bar.stage("checking units and conventions")
            facts["suspected"] = [each.record() for each in suspicions(subject.samples)]
        if drawing is not None:
            bar.stage("drawing")
            facts |= _draw(drawing, subject)
    # A model's name and parameters read better as rows of their own.
    rows = {name: value for name, value in facts.items() if name not in ("material", "suspected", "gains", "clipped")}
    screen.show(facts_table(subject.name, rows | (facts.get("material") or {})))
    screen.show(*map(Text, mending_lines(subject.samples.provenance)))
    if facts.get("suspected"):
        screen.show("Suspected, with the odds against the data as they stand:", *map(_line, facts["suspected"]))
    screen.answer(facts)


def _scene(place: Path, drawing: Path | None, screen: Screen) -> bool:
    """Show a scene's folder; whether it is one."""
    from homofact.cli.info_scene import scene_facts

    found = scene_facts(place)
    if found is None:
        return False
    title, rows, answer = found
    if drawing is not None:
        raise BadInput(f"plot: {place} is a {rows['kind']}, which has its pictures; expected none")
    screen.show(facts_table(title, rows))
    screen.answer(answer)
    return True


def _line(record: dict[str, Any]) -> str:
    from homofact.brdf.suspicion.check import Suspicion

    return f"- {Suspicion(**record).line()}"


def _draw(picture: Path, subject: "Source") -> dict[str, Any]:
    """Draw the picture; its file, and what it was drawn with."""
    from homofact.brdf.channels import display_of
    from homofact.figures.info_picture import info_picture

    picture.parent.mkdir(parents=True, exist_ok=True)
    report = info_picture(
        picture,
        subject.name,
        subject.reflectance,
        measured=subject.samples if subject.kind == "measurement" else None,
        to_rgb=display_of(subject.samples.channels),
    )
    return {"plot": {"file": str(picture), "exposure": report.exposure, "clipped": report.clipped}}
