"""`homofact report`: a sweep's results as a static site."""

from pathlib import Path
from typing import Annotated

import typer

from homofact.cli import options as o
from homofact.cli.screen import Screen


def report(
    folder: Annotated[Path, typer.Argument(metavar="SWEEP", help="The folder of a sweep.")],
    out: Annotated[Path, typer.Option(metavar="SITE", help="Where the site goes: a new folder.")],
    against: Annotated[
        Path | None,
        typer.Option(metavar="SWEEP", help="An earlier sweep: what got better or worse since.", show_default=False),
    ] = None,
    viewers: Annotated[
        bool, typer.Option("--viewers/--no-viewers", help="A page of homofact view for every fit with textures.")
    ] = True,
    force: Annotated[bool, typer.Option("--force", help="Replace a report that is there.")] = False,
    as_json: o.AsJson = False,
    quiet: o.Quiet = False,
) -> None:
    """Write the report of a sweep: a site that opens without network.

    Charts and a table of all fits, the worst ten by each metric, what
    was set aside, what changed since an earlier sweep, a page for every
    material with its pictures, textures, verdict and viewer; CSV and
    Parquet of everything. Open SITE/index.html.
    """
    from homofact.files.folder import check_new_folder
    from homofact.files.kinds import SITE

    check_new_folder(out, SITE, force)

    from homofact.sweep.report.site import write_site
    from homofact.sweep.report.tables import NO_PARQUET, parquet_there

    screen = Screen(as_json, quiet)
    with screen.bar() as bar:
        bar.stage("reading the results")
        site = write_site(folder, out, against, viewers=viewers, force=force, told=bar.run)
    if not parquet_there():
        screen.note(f"homofact: {NO_PARQUET}")
    if not quiet:
        screen.show(f"The report: {out / 'index.html'} ({site.files} files, {site.size / 1e6:.1f} MB)")
    screen.answer({"folder": str(folder), "site": str(out), "files": site.files, "bytes": site.size, **site.record})
