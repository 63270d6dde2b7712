"""`homofact compare`: several methods fitted to the same split, side by side; their means, or a chart over sizes."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.text import Text

from homofact.cli import options as o
from homofact.cli.charts import compared_methods, draw_charts
from homofact.cli.layout import hanging
from homofact.cli.screen import Screen, say_ending, say_subset
from homofact.cli.subject import sources_of
from homofact.cli.tables import (
    appearance_tables,
    cost_table,
    error_table,
    mean_table,
    metric_tables,
    pair_table,
    size_table,
)
from homofact.cli.verdicts import brief_lines, names_of, strictness
from homofact.errors import BadInput
from homofact.evaluation.wording import counted, figure, listed
from homofact.files.kinds import EXPORT, RESULT
from homofact.sections import FIT

if TYPE_CHECKING:
    from homofact.api.compared import SourceComparison
    from homofact.api.comparing_fits import FitsComparison
    from homofact.config import Config
    from homofact.evaluation.compare import ComparisonRow
    from homofact.evaluation.repeats import RepeatedRows

Seeds = Annotated[
    str,
    typer.Option(
        "--seeds",
        metavar="N|A,B,C",
        help="Number of seeds, starting with --seed, or a list of seeds. All seeds use the same splits. The command"
        " prints means and standard deviations.",
        rich_help_panel=FIT,
    ),
]
Splits = Annotated[
    int,
    typer.Option(
        "--splits",
        metavar="N",
        help="Repeat all fits with this many different sets of held-out samples. The command prints means and"
        " standard deviations and, for each pair of methods, the number of sets on which the first has the smaller"
        " error.",
        rich_help_panel=FIT,
    ),
]


@o.configured(
    "compare.sources", "compare", "output.force", "source", "evaluate", "fit", "seed",
    but=("source.path", "fit.method", "fit.textures", "fit.size", "fit.search"),
)  # fmt: skip
def compare(
    settings: "Config",
    seeds: Seeds = "1",
    splits: Splits = 1,
    strict: o.Strict = "",
    refuse: o.Refuse = "",
    as_json: o.AsJson = False,
    quiet: o.Quiet = False,
) -> None:
    """Fit several methods to the same samples and print their errors and costs.

    With several sources, or with --csv or --latex, it prints or writes the mean and standard deviation over sources,
    seeds and splits, for each method and number of bytes. With --bytes, the method search chooses the number and shapes
    of its textures within the budget. The methods mccool, cole, svd and nmf get the largest textures that fit into it.
    Models have no textures, so --bytes does not affect them. After Ctrl-C it prints the finished comparisons and exits
    with code 130.

    If the SOURCES are folders of fits, it compares these fits with their source on the same samples. With --on
    FILE, it compares them with another measurement instead. --plot FILE.png draws the result.

    With --chart it fits every combination of method, number of textures, size and optimizer (--search). For each SOURCE
    it writes NAME.csv with all runs, and two charts as PNG and SVG: NAME_time (error against fitting time) and
    NAME_cost (error against bytes and fetches). It does not repeat fits that are
    already in the CSV, unless you give --force.
    """
    asked = settings.compare
    others = [place for place in asked.sources if not (RESULT.is_at(Path(place)) or EXPORT.is_at(Path(place)))]
    missing = [place for place in others if not (place.startswith("material:") or Path(place).exists())]
    if missing and len(others) < len(asked.sources):
        raise BadInput(where=missing[0], found="no such folder", expected="the folder of a fit, like the other ones")
    if asked.sources and not others:
        made_anew = {"seeds": seeds != "1", "splits": splits != 1, "strict": bool(strict), "refuse": bool(refuse)}
        made_anew |= {name: getattr(asked, name) is not None for name in ("chart", "csv", "latex")}
        for name in (name for name, given in made_anew.items() if given):
            raise BadInput("given beside saved fits", where=name, expected="sources with it")
        _compare_fits(settings, Screen(as_json, quiet))
        return
    if asked.on is not None:
        raise BadInput(where="on", found="it beside sources to fit", expected="the folders of saved fits")
    sources = sources_of(settings, asked.sources)
    screen = Screen(as_json, quiet)
    if asked.chart is not None:
        for name, value in (("strict", strict), ("refuse", refuse)):
            if value:
                raise BadInput("given beside a chart", where=name, expected="one of the two")
        draw_charts(settings, Path(asked.chart), sources, seeds, splits, screen, quiet)
        return
    fits = compared_methods(settings, screen)

    from homofact.api.comparing import compare

    with screen.progress() as progress:
        found = compare(
            sources if len(sources) > 1 else sources[0], fits, held_out=settings.evaluate.held_out,
            seeds=seeds, splits=splits, seed=settings.seed, metrics=asked.metrics, plot=asked.plot,
            csv=asked.csv, latex=asked.latex, by_source=asked.by_source,
            strict=strictness(strict), refuse=names_of(refuse), progress=progress,
        )  # fmt: skip
    if not (quiet and found.files):
        for source in found.sources:
            _show(source, screen, found.several)
        if found.with_means:
            screen.show(mean_table(found.means()))
    for warning in found.warnings:
        screen.note(f"homofact: {warning}")
    for name, file in found.files.items():
        screen.note(f"The {'figure' if name == 'plot' else 'table'}: {file}")
    screen.answer(found.record())
    if found.interrupted:
        what = "fits of a method to a source" if found.several else "methods"
        screen.note(f"homofact: interrupted, {found.fits_done} of {found.fits} {what} are compared")
        raise typer.Exit(130)


def _compare_fits(settings: "Config", screen: Screen) -> None:
    """Saved fits beside each other, on the samples of their source or of another."""
    asked = settings.compare
    on = None if asked.on is None else sources_of(settings, [asked.on])[0]

    from homofact.api.comparing_fits import compare_fits

    with screen.progress() as progress:
        found = compare_fits(asked.sources, on=on, metrics=asked.metrics, plot=asked.plot, progress=progress)
    if on is not None:
        seen = "a fit to this file itself has seen most of them"
        screen.note(f"homofact: the errors are on all samples of {found.source}; {seen}")
    elif found.part == "source":
        screen.note(
            f"homofact: the held-out samples of {listed(found.unlike)} are unknown or others than those of"
            f" {next(iter(found.fits))}, so the errors are on all samples"
        )
    metrics = metric_tables({label: record["metrics"] for label, record in found.records.items()})
    screen.show(error_table(found.records), *appearance_tables(found.records), *metrics, *map(Text, found.conditions))
    screen.show(*map(Text, _ratio_lines(found)), size_table(found.records))
    said = {label: record["verdict"] for label, record in found.records.items() if record["verdict"] is not None}
    screen.show(*(hanging(f"{label}: {verdict['summary']}", 2) for label, verdict in said.items()))
    if found.plot is not None:
        screen.note(f"The picture: {found.plot}")
    screen.answer(found.record())


def _ratio_lines(found: "FitsComparison") -> list[str]:
    """The errors of the best fit over those of each other one, with their intervals, and what these show."""
    lines = []
    for label, several in found.ratios.items():
        parts = (
            f"{name.replace('_', ' ')} {figure(one.ratio)} ({figure(one.low)} to {figure(one.high)})"
            for name, one in several.items()
        )
        count = next(iter(several.values())).count
        lines.append(
            f"Errors of {found.best} divided by those of {label} (in brackets the 95% interval, from {count} samples):"
            f" {', '.join(parts)}"
        )
    if not all(one.clear for several in found.ratios.values() for one in several.values()):
        lines.append("An interval that contains 1 shows no difference.")
    return lines


def _show(compared: "SourceComparison", screen: Screen, several: bool) -> None:
    """The tables of one source, and how the fits ended."""
    for label, seeds in compared.rows.items():
        for row in seeds.rows:
            of = f"{compared.source.name}, " * several + label
            say_ending(screen, row.report, f"{of}, {_drawn(seeds, row)}" if len(seeds.rows) > 1 else of)
    records = compared.records()
    say_subset(screen, next(iter(records.values())))
    if several:
        screen.show(Text(f"\n{compared.source.name}", "bold"))
    screen.show(error_table(records), *appearance_tables(records))
    pairs = compared.split_by_split()
    screen.show(*([pair_table(pairs)] if pairs else []), *metric_tables(compared.metrics()))
    screen.show(*map(Text, compared.conditions), cost_table(records))
    screen.show(
        *map(Text, brief_lines({_judged(label, rows): rows.first.verdict for label, rows in compared.rows.items()}))
    )


def _judged(label: str, seeds: "RepeatedRows") -> str:
    """The label of a verdict: of several fits it is that on the first, with how many of them are trusted."""
    if len(seeds.rows) == 1:
        return label
    trusted = sum(row.verdict.trusted for row in seeds.rows)
    return f"{label}, {_drawn(seeds, seeds.first)} (trusted: {trusted} of {counted(len(seeds.rows), 'fit')})"


def _drawn(seeds: "RepeatedRows", row: "ComparisonRow") -> str:
    """Return the seed, the split or both that tell the fit of a row from the others by its method."""
    words = {"seed": (seeds.seeds, row.settings.seed), "split": (seeds.splits, row.split.seed)}
    return " ".join(f"{name} {own}" for name, (several, own) in words.items() if len(several) > 1)
