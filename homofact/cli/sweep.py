"""`homofact sweep`: every source with every method, on all processors, survived and remembered."""

from collections.abc import Sequence
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table
from rich.text import Text

from homofact.cli import options as o
from homofact.cli.layout import add_figures, add_names, plain_table
from homofact.cli.screen import Screen
from homofact.cli.together import show_together
from homofact.evaluation.wording import figure

if TYPE_CHECKING:
    from homofact.sweeps.summary import FitRow


def sweep(
    file: Annotated[Path, typer.Argument(metavar="SWEEP.toml", help="Sources, methods, bytes, seeds.")],
    out: Annotated[Path, typer.Option(metavar="FOLDER", help="Where the results are, and go on from.")],
    workers: Annotated[
        int | None, typer.Option(metavar="N", help="Processes on this machine. Default: one a processor.")
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(
            metavar="WHERE",
            help="On Dask's workers instead: local, tcp://HOST:8786, a scheduler's .json file, or MODULE:CLASS of a"
            " cluster, such as dask_jobqueue:SLURMCluster.",
        ),
    ] = None,
    retry: Annotated[bool, typer.Option("--retry", help="Try again what was set aside.")] = False,
    svbrdf: Annotated[
        bool,
        typer.Option(
            "--svbrdf",
            help="Take the sources for the clusters of one spatially varying material, with the label map that the"
            " file's section svbrdf names: shared projections, texture arrays, shaders that look the label up.",
        ),
    ] = False,
    basis: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            help="One basis of N textures for all sources, each then N numbers; says from how many on it pays.",
        ),
    ] = None,
    as_json: o.AsJson = False,
    quiet: o.Quiet = False,
) -> None:
    """Fit many sources by several methods, and keep every result.

    What is done is never done again: the same command goes on after
    Ctrl-C, kill -9 or a crash. A source whose worker dies twice is set
    aside and named, as is one that homofact refuses.
    """
    from homofact.api.sweeping import TogetherResult, sweep

    screen = Screen(as_json, quiet)
    with screen.progress() as progress:
        found = sweep(
            file, out, workers=workers, scheduler=scheduler, retry=retry, svbrdf=svbrdf, basis=basis, progress=progress
        )
    if isinstance(found, TogetherResult):
        show_together(found, screen)
    elif not quiet:
        screen.show(summary_table(found.rows))
        screen.show(*(Text(f"set aside: {task.task.words}: {task.reason}") for task in found.aside))
        screen.show(f"{out}: {len(found.rows)} results in results/, {len(found.aside)} set aside")
    screen.answer(found.record())


def summary_table(rows: "Sequence[FitRow]") -> Table:
    """A line a method: how many fits, and medians over them."""
    from homofact.sweeps.summary import by_label, middle

    table = plain_table("Medians")
    add_names(table)
    add_figures(table, "fits", "trusted", "bytes", "fit, s", "log mse", "albedo", "peak", "sky dB")
    for label, some in by_label(rows).items():
        figures = [figure(middle(some, name)) for name in ("log_mse", "albedo_worst", "highlight", "psnr_sky")]
        size, seconds = (median(getattr(row, name) for row in some) for name in ("bytes", "seconds"))
        trusted = sum(row.trusted for row in some)
        table.add_row(Text(label), f"{len(some)}", f"{trusted}", f"{size:.0f}", figure(seconds), *figures)
    return table
