"""`homofact convert`: a source written in another format, chosen by the ending of the new file."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from homofact.cli import options as o
from homofact.cli.screen import Screen

if TYPE_CHECKING:
    from homofact.config import Config


@o.configured("output.force", "source", "seed", but=("source.path", "source.subset", "source.clipped"))
def convert(
    settings: "Config",
    source: Annotated[str, typer.Argument(metavar="IN", help="A measurement file, material:NAME, or a result.")],
    target: Annotated[
        Path,
        typer.Argument(
            metavar="OUT",
            help="The new file: .binary (MERL), .bsdf (RGL, Mitsuba's measured), .csv, .npz, .dat (ALTA), .xml (WINDOW,"
            " Radiance), .brdf or .anisotropicbsdf (Ansys Speos).",
        ),
    ],
    form: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Format, if several use the same file name extension: zemax (for .bsdf), or tree (for .xml: a"
            " tensor tree instead of Klems bands). Default: RGL for .bsdf, Klems bands for .xml.",
            show_default=False,
        ),
    ] = None,
    undo: Annotated[
        str,
        typer.Option(
            metavar="NAMES",
            help="Names of conventions to undo, separated by commas, as homofact info prints them: cosine-o, srgb,"
            " elevation, ... Works for .csv, .npz and .dat. An unknown name makes the command list all names.",
            show_default=False,
        ),
    ] = "",
    as_json: o.AsJson = False,
    quiet: o.Quiet = False,
) -> None:
    """Convert a measurement, a named material or a fit to the format given by the file name extension of OUT."""
    from homofact.api.converting import convert

    asked = settings.source
    screen = Screen(as_json, quiet)
    with screen.progress() as progress:
        found = convert(
            source, target, form=form, undo=[name.strip() for name in undo.split(",") if name.strip()],
            channels=asked.channels, count=asked.count, scheme=asked.scheme, calibrate=asked.calibrate,
            seed=settings.seed, force=settings.output.force, progress=progress,
        )  # fmt: skip
    if not quiet:
        screen.show(f"{found.file}: {found.format}, {found.size} bytes", *found.notes)
    screen.answer(found.record())
