"""`homofact chart`: error against cost over methods, textures, sizes and searches."""

from pathlib import Path
from typing import TYPE_CHECKING

from homofact.cli import options as o
from homofact.cli.screen import Screen
from homofact.cli.subject import sources_of
from homofact.cli.tables import chart_table
from homofact.errors import BadInput
from homofact.methods.table import methods_with, parsed_label

if TYPE_CHECKING:
    from homofact.config import Config
    from homofact.methods.method import Method


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
def chart(settings: "Config", seeds: o.Seeds = 1, as_json: o.AsJson = False, quiet: o.Quiet = False) -> None:
    """Fit many sizes and methods, and draw error against bytes and time.

    It runs methods × textures × sizes × searches. Each SOURCE gets NAME.csv
    with every run, NAME_time (error against fitting time) and NAME_cost (error
    against bytes and fetches), as PNG and SVG. Runs that are already in the
    CSV are not fitted again.
    """
    sources = sources_of(settings, settings.chart.sources)
    if settings.output.folder is None:
        raise BadInput("none given", where="out", expected="a folder for the charts (--out, or folder under [output])")
    folder, asked = Path(settings.output.folder), settings.chart
    methods = charted_methods(settings)

    from homofact.api.charting import chart

    screen = Screen(as_json, quiet)
    with screen.progress() as progress:
        found = chart(
            sources, folder, methods, textures=asked.textures, sizes=asked.sizes, searches=asked.searches,
            seeds=seeds, held_out=settings.evaluate.held_out, seed=settings.seed, force=settings.output.force,
            progress=progress,
        )  # fmt: skip
    for one in found.charts:
        if one.others:
            left = f"{one.others} runs with other settings stay in the file but not in the chart"
            screen.note(f"homofact: {one.files[0]}: {left}")
    if not quiet:
        for one in found.charts:
            title = f"{one.source}: held-out Cole error, ε = {one.rows[0].epsilon:g}"
            screen.show(chart_table(title, [point.record() for point in one.points()], one.reference()))
        screen.show(*map(str, found.files))
    screen.answer(found.record())


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
