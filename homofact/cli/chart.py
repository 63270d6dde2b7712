"""`homofact chart`: error against cost over methods, textures, sizes and searches."""

import re
import sys
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from homofact.cli import options as o
from homofact.cli.places import check_measurement, check_place
from homofact.cli.screen import Screen, say_estimate
from homofact.cli.subject import open_subject
from homofact.cli.tables import chart_table
from homofact.errors import BadInput
from homofact.files.lock import claimed
from homofact.methods.table import methods_with, parsed_label

if TYPE_CHECKING:
    from homofact.config import Config
    from homofact.methods.fitting import Method


@o.configured(
    "chart.sources",
    "output",
    "chart",
    "source",
    "evaluate",
    "fit",
    "seed",
    but=("source.path", "source.subset", "fit.method", "fit.textures", "fit.size", "fit.bytes", "fit.search"),
)
def chart(
    settings: "Config",
    seeds: o.Seeds = 1,
    as_json: o.AsJson = False,
    quiet: o.Quiet = False,
) -> None:
    """Run methods × textures × sizes × searches and draw error against cost.

    Each SOURCE gets NAME.csv with every run, NAME_time (error against
    fitting time) and NAME_cost (error against bytes and fetches), as PNG
    and SVG. Runs that the CSV holds already are not fitted again.
    """
    names = source_names(settings)
    if settings.output.folder is None:
        raise BadInput("out: none given, expected a folder for the charts (--out, or folder under [output])")
    folder, wanted = Path(settings.output.folder), settings.chart

    methods = charted_methods(settings)
    for text in names:
        check_measurement(text)

    from homofact.evaluate.chart import Run, estimate_charts, plan, run_chart
    from homofact.evaluate.chart_ledger import ChartRow, Ledger
    from homofact.evaluate.chart_points import points_of, reference
    from homofact.evaluate.estimate import about
    from homofact.figures.chart import write_charts

    runs = plan(methods, wanted.textures, wanted.sizes, wanted.searches, seeds)
    check_place(folder)

    screen = Screen(as_json, quiet)
    answer, tables, files = [], [], []
    kept, total = 0, len(runs) * len(names)
    with ExitStack() as claims, screen.bar() as bar:
        ledgers = {}
        for text, name in names.items():
            path = folder / f"{name}.csv"
            claims.enter_context(claimed(path))
            ledgers[text] = Ledger(path, settings.output.force)
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


def charted_methods(settings: "Config") -> "dict[str, Method]":
    """The methods by label, as the first of their runs has them.

    What the chart varies is not what [fit] says of it. Raises BadInput for counts or searches that were asked for where
    no method takes any.
    """
    wanted = settings.chart
    names = {parsed_label(label)[0] for label in wanted.methods}
    varied = {"textures": wanted.textures, "size": wanted.sizes, "search": wanted.searches}
    keys = {"textures": "chart.textures", "size": "chart.sizes", "search": "chart.searches"}
    first = {
        name: values[0]
        for name, values in varied.items()
        if keys[name] in settings.given or not names.isdisjoint(methods_with(name))
    }
    return settings.fit.without(*varied).with_settings(first).methods(wanted.methods)


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
