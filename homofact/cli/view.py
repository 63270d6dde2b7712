"""`homofact view`: one self-contained HTML file of a result, to be opened in a browser."""

from pathlib import Path
from typing import Annotated

import typer

from homofact.cli import options as o
from homofact.cli.screen import Screen, say_ending

NAME = "view.html"


def view(
    result: Annotated[
        Path,
        typer.Argument(
            metavar="RESULT",
            help="A result folder, its factorization.npz, an export, or the folder of a relit or prepared scene.",
        ),
    ],
    source: o.MadeFrom = None,
    mesh: Annotated[
        Path | None, typer.Option(metavar="FILE.obj", help="Mesh (OBJ, PLY, glTF) to show the material on.")
    ] = None,
    sky: Annotated[
        list[Path] | None,
        typer.Option(metavar="FILE.hdr", help="Additional sky for a relit scene. You can repeat this option."),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE.html", help="File for the page. Default: view.html in the result's folder."),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace an existing page.")] = False,
    as_json: o.AsJson = False,
    quiet: o.Quiet = False,
) -> None:
    """Write a page that shows a result in a browser, with movable light and camera.

    The page is one HTML file that needs WebGL 2 and no network. It shows the fit, a fit by McCool's projections at
    the same size, and the source side by side on a sphere or a mesh. It also shows their differences, the textures and
    the held-out errors. For a relit scene (from homofact relight) it shows the objects with their shadows, under
    built-in skies, --sky, or a dropped .hdr file. For a prepared scene (from homofact edit) it shows pictures, and
    curves that you can drag.
    """
    from homofact.api.viewing import view

    screen = Screen(as_json, quiet)
    with screen.progress() as progress:
        page = view(result, out, source=source, mesh=mesh, skies=sky or (), force=force, progress=progress)
    for label, ending in page.reports.items():
        say_ending(screen, ending, label)
    if page.caution:
        remedy = ": see the page's notes" if page.source_found else "; --source names it"
        screen.note(f"homofact: {page.caution}{remedy}")
    if not quiet:
        size = f"{page.size / 1000:.0f} kB" if page.size < 1e6 else f"{page.size / 1e6:.1f} MB"
        screen.show(f"The page: {page.file} ({size}): {' | '.join(page.titles)}")
    screen.answer(page.record())
