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
from homofact.evaluation.wording import figure, listed

if TYPE_CHECKING:
    from homofact.sweeps.summary import FitRow

# Columns of the tables, by the names of figures.
_LIGHT = {"albedo_worst": "albedo", "highlight": "highlight", "psnr_sky": "sky dB"}
_LIMITS = {"light_limit": "light", "highlight_limit": "highlight", "sky_limit": "sky"}
_WITHIN = "light, highlight, sky: within these limits, which the verdict estimates; ×2 is a factor of 2"


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
        from homofact.sweeps.summary import mixes_epsilons

        screen.show(*summary_tables(found.rows), *light_lines(found.rows))
        if mixes_epsilons(found.rows):
            screen.show("These fits have more than one ε. Compare their log errors only between fits of the same ε.")
        screen.show(*(Text(f"set aside: {task.task.words}: {task.reason}") for task in found.aside))
        screen.show(f"{out}: {len(found.rows)} results in results/, {len(found.aside)} set aside")
        if found.site is not None:
            screen.show(f"The report: {found.site / 'index.html'}")
    screen.answer(found.record())


def summary_tables(rows: "Sequence[FitRow]") -> list[Table]:
    """Return one line per method: how many of its fits are trusted, and medians over them.

    Lists of samples have the limits of their verdicts instead of figures of light. If other sources have figures of
    light, the limits have a table of their own.
    """
    from homofact.sweeps.summary import by_label, limit_figure, middle, with_values

    names = {each.name for each in with_values(rows)}
    light, limits = ({name: own[name] for name in own if name in names} for own in (_LIGHT, _LIMITS))
    about = "albedo, highlight: factor of error, 1 is exact" if light else _WITHIN
    table = plain_table(f"Medians over all materials and seeds{f' ({about})' if light or limits else ''}")
    second = plain_table(f"Medians over lists of samples ({_WITHIN})")
    for each in (table, second):
        add_names(each)
    add_figures(table, "trusted", "bytes", "fit, s", "log mse", *(light or limits).values())
    add_figures(second, *limits.values())
    for label, some in by_label(rows).items():
        size, seconds = (median(getattr(row, name) for row in some) for name in ("bytes", "seconds"))
        trusted = sum(row.trusted for row in some)
        plain = [f"{trusted} of {len(some)}", f"{size:.0f}", figure(seconds), figure(middle(some, "log_mse"))]
        within = [limit_figure(middle(some, name)) for name in limits]
        table.add_row(Text(label), *plain, *([figure(middle(some, name)) for name in light] or within))
        second.add_row(Text(label), *within)
    return [table, second] if light and limits else [table]


def light_lines(rows: "Sequence[FitRow]") -> list[str]:
    """Return a line on the sources that have no figures of light; empty if all sources have them."""
    from homofact.sweeps.summary import IN_ALL_DIRECTIONS, with_values, without_light

    names = {each.name for each in with_values(rows)}
    columns = listed(list(_LIGHT.values()))
    if some := without_light(rows):
        return [f"{columns} leave out {', '.join(some)}. {IN_ALL_DIRECTIONS}"]
    if names.isdisjoint(_LIGHT) and not names.isdisjoint(_LIMITS):
        return [f"Not measured: {columns}. {IN_ALL_DIRECTIONS}"]
    return []
