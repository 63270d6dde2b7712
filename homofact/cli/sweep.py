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
from homofact.cli.places import check_place
from homofact.cli.screen import Screen
from homofact.errors import BadInput
from homofact.evaluate.wording import figure

if TYPE_CHECKING:
    from homofact.sweep.summary import FitRow


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
    if workers is not None and workers < 1:
        raise BadInput(f"workers: found {workers}, expected 1 or more")
    if svbrdf or basis is not None:
        from homofact.cli.together import basis_of, svbrdf_of

        beside = {"workers": workers is not None, "scheduler": scheduler is not None, "retry": retry}
        beside["basis"] = svbrdf and basis is not None
        for name in (name for name, given in beside.items() if given):
            what = "--svbrdf" if svbrdf else "--basis"
            raise BadInput(f"{name}: found it beside {what}, which is one fit, in this process")
        screen = Screen(as_json, quiet)
        if basis is not None:
            basis_of(file, basis, out, screen)
        else:
            svbrdf_of(file, out, screen)
        return
    check_place(out)

    from homofact.sweep.cluster import Cluster
    from homofact.sweep.local import Ending, Local
    from homofact.sweep.progress import Progress
    from homofact.sweep.run import State, sweep
    from homofact.sweep.summary import rows_of, summary_records
    from homofact.sweep.sweep_file import read_sweep

    asked = read_sweep(file)
    if asked.svbrdf is not None:
        raise BadInput(f"{file}: found a section [svbrdf], expected --svbrdf beside it, or none")
    screen = Screen(as_json, quiet)
    count = workers or _processors()
    engine = Local(out, count) if scheduler is None else Cluster(out, scheduler, count, screen.note)
    progress = Progress(count)
    with screen.bar() as bar:
        bar.stage("reading the sources")

        def told(state: State, ending: Ending | None) -> None:
            if ending is None:
                screen.note(f"homofact: {progress.begin(state)}")
            else:
                progress.end(state, ending)
                if ending.seconds is None:
                    screen.note(f"homofact: {ending.task.words}: {progress.misfortune(state, ending)}")
            bar.run(progress.words(), len(state.tasks) - state.left, len(state.tasks))

        state = sweep(asked, out, engine, told, retry)
    rows = rows_of(out)
    aside = [each for each in state.aside.values() if each.final]
    if not quiet:
        screen.show(summary_table(rows))
        screen.show(*(Text(f"set aside: {each.task.words}: {each.reason}") for each in aside))
        screen.show(f"{out}: {len(rows)} results in results/, {len(aside)} set aside")
    screen.answer(
        {
            "folder": str(out),
            "name": asked.name,
            "tasks": len(state.tasks),
            "done_before": state.before,
            "done": state.done,
            "set_aside": [{**each.task.record(), "reason": each.reason, "deaths": each.deaths} for each in aside],
            "error": summary_records(rows),
        }
    )


def _processors() -> int:
    import os

    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def summary_table(rows: "Sequence[FitRow]") -> Table:
    """A line a method: how many fits, and medians over them."""
    from homofact.sweep.summary import by_label, middle

    table = plain_table("Medians")
    add_names(table)
    add_figures(table, "fits", "trusted", "bytes", "fit, s", "log mse", "albedo", "peak", "sky dB")
    for label, some in by_label(rows).items():
        figures = [figure(middle(some, name)) for name in ("log_mse", "albedo_worst", "highlight", "psnr_sky")]
        size, seconds = (median(getattr(row, name) for row in some) for name in ("bytes", "seconds"))
        trusted = sum(row.trusted for row in some)
        table.add_row(Text(label), f"{len(some)}", f"{trusted}", f"{size:.0f}", figure(seconds), *figures)
    return table
