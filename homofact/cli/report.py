"""`homofact report`: a sweep's results as a static site."""

from pathlib import Path
from typing import Annotated

import typer

from homofact.cli import options as o
from homofact.cli.screen import Screen


def report(
    folder: Annotated[Path, typer.Argument(metavar="SWEEP", help="The folder of a sweep.")],
    out: Annotated[Path, typer.Option(metavar="SITE", help="New folder for the site.")],
    against: Annotated[
        Path | None,
        typer.Option(
            metavar="SWEEP",
            help="Earlier sweep to compare with. The report shows what has become better or worse since then.",
            show_default=False,
        ),
    ] = None,
    viewers: Annotated[
        bool,
        typer.Option("--viewers/--no-viewers", help="Include a page of homofact view for every fit with textures."),
    ] = True,
    force: Annotated[bool, typer.Option("--force", help="Replace an existing report.")] = False,
    as_json: o.AsJson = False,
    quiet: o.Quiet = False,
) -> None:
    """Write the report of a sweep as a website that works offline.

    The site has charts and a table of all fits, the worst ten by each metric, the fits that failed, and the changes
    since an earlier sweep (--against). Each material has a page with its pictures, textures, verdict and viewer. CSV
    and Parquet files contain all figures. Open SITE/index.html.
    """
    from homofact.api.reporting import report

    screen = Screen(as_json, quiet)
    with screen.progress() as progress:
        site = report(folder, out, against=against, viewers=viewers, force=force, progress=progress)
    if site.left_out:
        screen.note(f"homofact: {site.left_out}")
    if not quiet:
        screen.show(f"The report: {site.index} ({site.files} files, {site.size / 1e6:.1f} MB)")
    screen.answer(site.record())
