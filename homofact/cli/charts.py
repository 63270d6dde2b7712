"""`homofact compare --chart`: error against cost over methods, textures, sizes and searches."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.text import Text

from homofact.cli.tables import chart_endings, chart_grades, chart_table
from homofact.errors import BadInput
from homofact.methods.table import methods_with, parsed_label
from homofact.sections import CHARTED

if TYPE_CHECKING:
    from collections.abc import Sequence

    from homofact.cli.screen import Screen
    from homofact.config import Config
    from homofact.methods.method import Method
    from homofact.sections import CompareSettings, FitSection, SourceSettings

# What `compare` gives without a chart.
_TABLES = ("plot", "csv", "latex", "by_source", "metrics")


def draw_charts(
    settings: "Config",
    folder: Path,
    sources: "list[SourceSettings]",
    seeds: str,
    splits: int,
    screen: "Screen",
    quiet: bool,
) -> None:
    """Draw the charts of all sources into the folder, and print their tables.

    Raises BadInput for settings of a comparison's tables, which a chart does not use.
    """
    asked = settings.compare
    for name in _TABLES:
        if f"compare.{name}" in settings.given:
            raise BadInput("given beside a chart", where=name, expected="one of the two")
    if not seeds.isdecimal() or int(seeds) < 1:
        raise BadInput(where="seeds", found=repr(seeds), expected="a whole number of at least 1 for a chart")
    varied = varied_settings(asked)
    methods = charted_methods(settings, screen)

    from homofact.api.charting import chart
    from homofact.evaluation.chart_points import best_lower_on

    with screen.progress() as progress:
        found = chart(
            list(sources), folder, methods, textures=varied["textures"], sizes=varied["size"],
            searches=varied["search"], seeds=int(seeds), splits=splits, held_out=settings.evaluate.held_out,
            seed=settings.seed, force=settings.output.force, progress=progress,
        )  # fmt: skip
    for one in found.charts:
        if one.others:
            left = f"{one.others} runs with other settings stay in the file but not in the chart"
            screen.note(f"homofact: {one.files[0]}: {left}")
    if not quiet:
        for one in found.charts:
            title = f"{one.source}: held-out Cole error, ε = {one.rows[0].epsilon:g}"
            points = one.points()
            records, losses = [point.record() for point in points], best_lower_on(points)
            screen.show(chart_table(title, records, one.reference(), losses))
            screen.show(*map(Text, chart_endings(records)), *chart_grades(records))
        screen.show(*map(str, found.files))
    screen.answer(found.record())


def varied_settings(asked: "CompareSettings") -> dict[str, Any]:
    """Return the settings that a chart varies, with their given values or the defaults."""
    return {name: getattr(asked, name) or usual for name, usual in CHARTED.items()}


def charted_methods(settings: "Config", screen: "Screen") -> "dict[str, Method]":
    """Return the methods by label, with the settings of a chart's first run; print settings without effect.

    The values that the chart varies override [fit].
    """
    wanted = settings.compare
    names = {parsed_label(label)[0] for label in wanted.methods}
    varied = varied_settings(wanted)
    first = {
        name: values[0]
        for name, values in varied.items()
        if getattr(wanted, name) is not None or not names.isdisjoint(methods_with(name))
    }
    return _made(settings.fit.without(*varied).with_settings(first), wanted.methods, screen)


def compared_methods(settings: "Config", screen: "Screen") -> "dict[str, Method]":
    """Return the methods by label, for a comparison without a chart; a note names settings without effect.

    Raises BadInput for several numbers of textures, sizes or searches, which only a chart accepts.
    """
    first = {}
    for name in CHARTED:
        values = getattr(settings.compare, name)
        if values is not None and len(values) > 1:
            several = ", ".join(map(str, values))
            raise BadInput(where=name, found=several, expected="one value, or a folder for a chart (--chart FOLDER)")
        if values is not None:
            first[name] = values[0]
    return _made(settings.fit.with_settings(first), settings.compare.methods, screen)


def _made(section: "FitSection", labels: "Sequence[str]", screen: "Screen") -> "dict[str, Method]":
    unused = section.unused(labels)
    methods = section.without(*unused).methods(labels)
    for words in unused.values():
        screen.note(f"homofact: {words}")
    return methods
