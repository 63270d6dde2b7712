"""`homofact chart`: error against cost over methods, textures, sizes and searches."""

import re
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from homofact.cli import options as o
from homofact.cli.places import check_place
from homofact.cli.screen import Screen, say_estimate
from homofact.cli.subject import method_settings, open_subject
from homofact.cli.tables import chart_table
from homofact.errors import BadInput

if TYPE_CHECKING:
    from homofact.config import Config


def chart(
    context: typer.Context,
    sources: Annotated[
        list[str] | None,
        typer.Argument(metavar="SOURCE...", help="Measurements' files, or material:NAME.", show_default=False),
    ] = None,
    out: o.Out = None,
    force: Annotated[
        bool | None,
        typer.Option("--force/--no-force", help="Fit everything anew instead of going on.", rich_help_panel="Output"),
    ] = None,
    chart_methods: Annotated[
        str | None,
        typer.Option(
            "--methods",
            help="Names with commas; mccool:A+B has the fixed projections A and B. Default: mccool,cole,search.",
            show_default=False,
        ),
    ] = None,
    texture_counts: Annotated[
        str | None,
        typer.Option("--textures", help="Counts of textures, with commas. Default: 1,2,3.", show_default=False),
    ] = None,
    sizes: Annotated[
        str | None,
        typer.Option(help="Texels on a side, with commas. Default: 8,16,32.", show_default=False),
    ] = None,
    searches: Annotated[
        str | None,
        typer.Option(
            help="How search refines, with commas: gradient, powell, nlopt-NAME. Default: gradient.",
            show_default=False,
        ),
    ] = None,
    channels: o.Channels = None,
    count: o.Count = None,
    scheme: o.Scheme = None,
    held_out: o.HeldOut = None,
    parameterization: o.Parameterization = None,
    reciprocal: o.Reciprocal = None,
    solver: o.Solver = None,
    smoothing: o.Smoothing = None,
    epsilon: o.Epsilon = None,
    together: o.Together = None,
    restarts: o.Restarts = None,
    validation: o.Validation = None,
    budget: o.Budget = None,
    refine: o.Refine = None,
    search_size: o.SearchSize = None,
    search_samples: o.SearchSamples = None,
    copies: o.Copies = None,
    mirrored: o.Mirrored = None,
    robust: o.Robust = None,
    confidence: o.Confidence = None,
    quantize: o.Quantize = None,
    bound: o.Bound = None,
    map: o.Map = None,
    decomposition: o.Decomposition = None,
    seed: o.Seed = None,
    seeds: o.Seeds = 1,
    config: o.ConfigFile = None,
    as_json: o.AsJson = False,
    quiet: o.Quiet = False,
) -> None:
    """Run methods × textures × sizes × searches and draw error against cost.

    Each SOURCE gets NAME.csv with every run, NAME_time (error against
    fitting time) and NAME_cost (error against bytes and fetches), as PNG
    and SVG. Runs that the CSV holds already are not fitted again.
    """
    from homofact.config import load_config

    settings = load_config(config, o.given(context))
    names = source_names(settings)
    if settings.output.folder is None:
        raise BadInput("out: none given, expected a folder for the charts (--out, or folder under [output])")
    folder, wanted = Path(settings.output.folder), settings.chart

    from homofact.evaluate.chart import Run, estimate_charts, plan, run_chart
    from homofact.evaluate.chart_ledger import ChartRow, Ledger
    from homofact.evaluate.chart_points import points_of, reference
    from homofact.evaluate.estimate import about
    from homofact.figures.chart import write_charts

    # What the chart varies must not be refused for what [fit] says of it.
    fit = replace(settings.fit, textures=wanted.textures[0], size=wanted.sizes[0], search=wanted.searches[0])
    methods = {label: method_settings(fit, label) for label in wanted.methods}
    runs = plan(methods, wanted.textures, wanted.sizes, wanted.searches, seeds)
    check_place(folder)
    ledgers = {text: Ledger(folder / f"{name}.csv", settings.output.force) for text, name in names.items()}

    screen = Screen(as_json, quiet)
    answer, tables, files = [], [], []
    kept, total = 0, len(runs) * len(names)
    with screen.bar() as bar:
        try:
            bar.stage("reading")
            subjects = {
                text: open_subject(replace(settings, source=replace(settings.source, path=text))) for text in names
            }
            held_out = settings.evaluate.held_out
            estimate = estimate_charts([(subjects[text], ledgers[text]) for text in names], runs, held_out)
            say_estimate(screen, estimate)
            for text, subject in subjects.items():
                before = kept

                def started(place: int, run: Run, before: int = before, name: str = subject.name) -> None:
                    nonlocal kept
                    kept = before + place
                    bar.run(f"{name}: {run.name}, {about(estimate.seconds_left)} left", kept, total)

                def ended(place: int, row: ChartRow, before: int = before) -> None:
                    estimate.finish(before + place, row.seconds_total - row.seconds_read)

                rows = run_chart(subject, runs, ledgers[text], held_out, started, bar, ended)
                kept = before + len(runs)
                files += [ledgers[text].path, *write_charts(folder, names[text], rows)]
                points = points_of(rows)
                base = reference(points)
                answer += [row.record() for row in rows]
                title = f"{subject.name}: held-out Cole error, ε = {rows[0].epsilon:g}"
                tables.append(
                    chart_table(title, [point.record() for point in points], None if base is None else base.error.mean)
                )
                others = len(ledgers[text]) - len(rows)
                if others > 0:
                    screen.note(f"homofact: {ledgers[text].path}: {others} runs of other settings stay, not drawn")
        except KeyboardInterrupt as error:
            print(
                f"homofact: interrupted, {kept} of {total} runs are kept in {folder}: the same command goes on there"
                f"{', without --force' if settings.output.force else ''}",
                file=sys.stderr,
            )
            raise typer.Exit(130) from error
    if not quiet:
        screen.show(*tables, *(f"{path}" for path in files))
    screen.answer({"rows": answer, "files": [str(path) for path in files]})


def source_names(settings: "Config") -> dict[str, str]:
    """Each source's text and the name that its files get. Raises BadInput for none, and for two of one name."""
    texts = settings.chart.sources or ((settings.source.path,) if settings.source.path is not None else ())
    if not texts:
        raise BadInput("SOURCE: none given, expected files or material:NAME (or sources under [chart])")
    names: dict[str, str] = {}
    for text in texts:
        stem = text.removeprefix("material:") if text.startswith("material:") else Path(text).stem
        name = re.sub(r"[^\w.+-]", "_", stem) or "_"
        if name in names.values():
            raise BadInput(f"SOURCE: found two named {name}, expected names that differ: their files would be the same")
        names[text] = name
    return names
