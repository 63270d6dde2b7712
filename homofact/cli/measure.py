"""`homofact measure`: the directions to measure next, their order on a goniometer, and whether to stop."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from homofact.cli import options as o
from homofact.cli.screen import Screen
from homofact.cli.tables import facts_table
from homofact.errors import BadInput

if TYPE_CHECKING:
    from homofact.api.measuring import MeasureResult
    from homofact.config import Config

_GONIOMETER, _PLAN = "The goniometer", "What to choose"


def _limits(name: str, text: str) -> tuple[float, float]:
    try:
        low, high = (float(word) for word in text.split(","))
    except ValueError:
        raise BadInput(where=name, found=repr(text), expected="two degrees such as 0,80") from None
    return low, high


@o.configured("output.force", "seed")
def measure(
    settings: "Config",
    samples: Annotated[
        list[str] | None,
        typer.Argument(metavar="SAMPLES...", help="Files of all samples so far; none for the first round."),
    ] = None,
    directions: Annotated[
        int | None,
        typer.Option(
            help="Number of single directions to choose. Default: 5.", show_default=False, rich_help_panel=_PLAN
        ),
    ] = None,
    incidences: Annotated[
        int | None,
        typer.Option(
            help="Number of incidences to choose instead, each measured at all views.",
            show_default=False,
            rich_help_panel=_PLAN,
        ),
    ] = None,
    stop: Annotated[
        float, typer.Option(help="Stop if three more rings change the picture by less.", rich_help_panel=_PLAN)
    ] = 0.01,
    channels: Annotated[
        str, typer.Option(help="Columns to fill in, separated by commas; later rounds take those of SAMPLES.")
    ] = "R,G,B",
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE.csv", help="File for the directions, to be filled in.", show_default=False),
    ] = None,
    complete: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.csv",
            help="File for the completed material, as samples for homofact factorize.",
            show_default=False,
        ),
    ] = None,
    theta_i: Annotated[
        str, typer.Option(metavar="A,B", help="Limits of the light's angle, in degrees.", rich_help_panel=_GONIOMETER)
    ] = "0,80",
    theta_o: Annotated[
        str,
        typer.Option(metavar="A,B", help="Limits of the detector's angle, in degrees.", rich_help_panel=_GONIOMETER),
    ] = "0,80",
    phi: Annotated[
        str,
        typer.Option(
            metavar="A,B",
            help="Limits of the azimuth between both, in degrees; 180 is the side of the mirror direction.",
            rich_help_panel=_GONIOMETER,
        ),
    ] = "0,180",
    separation: Annotated[
        float, typer.Option(help="Least angle between light and detector, in degrees.", rich_help_panel=_GONIOMETER)
    ] = 5.0,
    resolution: Annotated[
        float, typer.Option(help="Angles are multiples of it, in degrees.", rich_help_panel=_GONIOMETER)
    ] = 0.25,
    rings: Annotated[
        float,
        typer.Option(help="Step of the detector's angle of an incidence, in degrees.", rich_help_panel=_GONIOMETER),
    ] = 10.0,
    azimuths: Annotated[
        float, typer.Option(help="Step of the azimuth of an incidence, in degrees.", rich_help_panel=_GONIOMETER)
    ] = 20.0,
    speed: Annotated[
        float, typer.Option(help="Speed of each axis, in degrees per second.", rich_help_panel=_GONIOMETER)
    ] = 10.0,
    settle: Annotated[
        float, typer.Option(help="Settling time of each axis that has moved, in seconds.", rich_help_panel=_GONIOMETER)
    ] = 1.0,
    as_json: o.AsJson = False,
    quiet: o.Quiet = False,
) -> None:
    """Choose the directions that a goniometer should measure next.

    It combines the samples so far with statistics of 128 materials, and
    chooses the directions that lower the expected error of pictures, albedo
    and highlight most. Fill in the CSV, and run it again with all files.
    """
    limits = {name: _limits(name, text) for name, text in (("theta_i", theta_i), ("theta_o", theta_o), ("phi", phi))}

    from homofact.api.measuring import measure
    from homofact.measuring.goniometer import Goniometer

    goniometer = Goniometer(
        **limits, separation=separation, resolution=resolution, rings=rings, azimuths=azimuths, speed=speed,
        settle=settle,
    )  # fmt: skip
    screen = Screen(as_json, quiet)
    with screen.progress() as progress:
        found = measure(
            list(samples or []) or None, directions=directions, incidences=incidences, goniometer=goniometer, to=out,
            complete=complete, channels=tuple(name.strip() for name in channels.split(",")), stop=stop,
            seed=settings.seed, force=settings.output.force, progress=progress,
        )  # fmt: skip
    if found.misfit > 3:
        screen.note(
            f"homofact: the material is unlike the 128 known ones: errors are {found.misfit:.1f} times as wide as usual"
        )
    if not (quiet and found.files):
        screen.show(*_shown(found))
    screen.show(*(f"{file}" for file in found.files))
    screen.answer(found.record())


def _shown(found: "MeasureResult") -> list[object]:
    count = 0 if found.samples is None else len(found.samples)
    told = found.foretold
    factors = {
        name: ", ".join(f"{value:.3g} ± {factor - 1:.0%}" for value, factor in zip(*both, strict=True))
        for name, both in (
            ("albedo", (told.albedo, told.albedo_factor)), ("highlight", (told.highlight, told.highlight_factor)),
        )
    }  # fmt: skip
    at = ", ".join(f"{degrees:g}°" for degrees in told.degrees)
    facts = {
        "samples so far": str(count),
        "sphere PSNR": f"about {told.psnr:.1f} dB, above {told.psnr_least:.1f} dB for nine of ten materials",
        "albedo": f"{factors['albedo']} at {at}",
        "within 6°": f"{factors['highlight']} of the highlight",
        "chosen": f"{len(found.angles)} directions"
        + (f" of {len(found.incidences)} incidences" if found.incidences else ""),
        "they leave": f"{found.remaining:.0%} of the expected squared error",
        "moves": f"{found.seconds:.0f} s in this order, {found.seconds_unordered:.0f} s as chosen",
        "they change": f"the picture by {found.change:.1%}",
        "three rings": f"change the picture by {found.change_by_rings:.1%}: {'stop' if found.stop else 'go on'}",
    }
    shown: list[object] = [facts_table("Where to measure next", facts)]
    if not found.files:
        shown += [f"theta_i {one:g}, theta_o {two:g}, phi {three:g}" for one, two, three in found.angles]
    return shown
