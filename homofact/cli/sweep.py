"""`homofact sweep`: fit every source by every method on all processors, with results that survive crashes."""

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
    out: Annotated[
        Path, typer.Option(metavar="FOLDER", help="Folder for the results; an interrupted sweep continues from it.")
    ],
    workers: Annotated[
        int | None, typer.Option(metavar="N", help="Processes on this machine. Default: one per processor.")
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(
            metavar="WHERE",
            help="Run on Dask workers instead: local (on this machine), tcp://HOST:8786 or a scheduler's .json file"
            " (a running scheduler), or MODULE:CLASS (a Dask cluster class, such as dask_jobqueue:SLURMCluster).",
        ),
    ] = None,
    retry: Annotated[bool, typer.Option("--retry", help="Retry the fits that failed in an earlier run.")] = False,
    svbrdf: Annotated[
        bool,
        typer.Option(
            "--svbrdf",
            help="Treat the sources as the clusters of one spatially varying material. The section svbrdf of"
            " SWEEP.toml names the label map. Writes shared projections, texture arrays and shaders.",
        ),
    ] = False,
    basis: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            help="Fit one basis of N textures for all sources, and N coefficients per source and channel. Prints the"
            " number of sources from which on the basis needs fewer bytes than separate textures.",
        ),
    ] = None,
    as_json: o.AsJson = False,
    quiet: o.Quiet = False,
) -> None:
    """Fit many sources by several methods, and save every result.

    At the end the command writes a report, FOLDER/report/index.html. To add a viewer for every fit, or to compare
    with an earlier sweep, run homofact report. After Ctrl-C, kill -9 or a crash, run the same command again: it
    continues and does not repeat finished fits. If a source kills its worker twice, or homofact refuses it, the
    sweep skips it and prints its name.
    """
    from homofact.api.sweeping import TogetherResult, sweep

    screen = Screen(as_json, quiet)
    with screen.progress() as progress:
        found = sweep(
            file, out, workers=workers, scheduler=scheduler, retry=retry, svbrdf=svbrdf, basis=basis, site=True,
            progress=progress,
        )  # fmt: skip
    if isinstance(found, TogetherResult):
        show_together(found, screen)
    elif not quiet:
        from homofact.sweeps.summary import mixes_epsilons, without_light

        screen.show(summary_table(found.rows))
        if lists := without_light(found.rows):
            screen.show(f"albedo, peak and sky dB leave out {', '.join(lists)}: they are unknown for lists of samples.")
        if mixes_epsilons(found.rows):
            screen.show("These fits have more than one ε. Compare their log errors only between fits of the same ε.")
        screen.show(*(Text(f"set aside: {task.task.words}: {task.reason}") for task in found.aside))
        screen.show(f"{out}: {len(found.rows)} results in results/, {len(found.aside)} set aside")
        if found.site is not None:
            screen.show(f"The report: {found.site / 'index.html'}")
    screen.answer(found.record())


def summary_table(rows: "Sequence[FitRow]") -> Table:
    """Return one line per method: the number of fits, and medians over them."""
    from homofact.sweeps.summary import by_label, middle

    table = plain_table(
        "Medians over all materials and seeds (albedo, highlight: the factor by which the light is wrong, 1 is right)"
    )
    add_names(table)
    add_figures(table, "fits", "trusted", "bytes", "fit, s", "log mse", "albedo", "highlight", "sky dB")
    for label, some in by_label(rows).items():
        figures = [figure(middle(some, name)) for name in ("log_mse", "albedo_worst", "highlight", "psnr_sky")]
        size, seconds = (median(getattr(row, name) for row in some) for name in ("bytes", "seconds"))
        trusted = sum(row.trusted for row in some)
        table.add_row(Text(label), f"{len(some)}", f"{trusted}", f"{size:.0f}", figure(seconds), *figures)
    return table
