"""`homofact compare`: several methods fitted to the same split, side by side; over several sources, their means."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.text import Text

from homofact.cli import options as o
from homofact.cli.places import check_file, check_measurement
from homofact.cli.screen import Screen, say_ending, say_estimate, say_subset
from homofact.cli.subject import check_source, open_subject, warmed_up
from homofact.cli.tables import appearance_tables, cost_table, error_table, mean_table, metric_tables
from homofact.cli.verdicts import brief_lines, refuse_findings, refused_names
from homofact.errors import BadInput, Status
from homofact.files import extras
from homofact.sections import FIT

if TYPE_CHECKING:
    from homofact.brdf.source import Source
    from homofact.config import Config
    from homofact.evaluate.means import MeasuredFit
    from homofact.evaluate.seeds import SeedRows

Seeds = Annotated[
    str,
    typer.Option(
        "--seeds",
        metavar="N|A,B,C",
        help="How many seeds to fit by, from --seed on, or which, on one split: means with their spread.",
        rich_help_panel=FIT,
    ),
]


@o.configured(
    "compare.sources", "compare", "source", "evaluate", "fit", "seed", but=("source.path", "fit.method")
)  # fmt: skip
def compare(
    settings: "Config",
    seeds: Seeds = "1",
    strict: o.Strict = False,
    refuse: o.Refuse = "",
    as_json: o.AsJson = False,
    quiet: o.Quiet = False,
) -> None:
    """Fit several methods to the same samples and print their errors and costs.

    Of several sources, and with --csv or --latex, it gives the means and
    standard deviations over sources and seeds, by method and bytes.
    Ctrl-C ends it with what is compared by then, and exit code 130.
    """
    refused = refused_names(refuse)
    each = _settings_of_each(settings)
    plot, *tables = _files(settings, len(each))
    fits = settings.fit.methods(settings.compare.methods)

    from homofact.evaluate.estimate import TimeEstimate, about, fit_seconds, training_count
    from homofact.evaluate.judging import Judge, chosen_metrics
    from homofact.evaluate.seeds import asked_seeds, fit_seeds

    listed = asked_seeds(settings.seed, seeds)
    names = chosen_metrics(settings.compare.metrics)
    screen = Screen(as_json, quiet)
    done: list[_Compared] = []
    interrupted = False
    with screen.bar() as bar:
        bar.stage("reading")
        subjects = [open_subject(one) for one in each]
        warmed_up(screen)
        held_out, subset = settings.evaluate.held_out, settings.source.subset
        planned = [(subject, label, fit) for subject in subjects for label, fit in fits.items()]
        estimate = TimeEstimate(
            [
                (fit.name, fit_seconds(fit, training_count(subject, fit, held_out, subset)))
                for subject, _, fit in planned
                for _ in listed
            ]
        )
        say_estimate(screen, estimate)
        for subject in subjects:
            rows: dict[str, SeedRows] = {}
            for label, fit in fits.items():
                of = f"{subject.name}, {label}" if len(subjects) > 1 else label
                bar.run(f"{of}, {about(estimate.seconds_left)} left", estimate.done, len(planned) * len(listed))
                try:
                    rows[label] = fit_seeds(subject, fit, listed, held_out, bar, subset, settings.seed)
                except KeyboardInterrupt:
                    if not rows and not done:
                        raise
                    interrupted = True
                    break
                for row in rows[label].rows:
                    estimate.finish(estimate.done, row.seconds_total - row.seconds_read)
                    refuse_findings(row.verdict, label, strict, refused)
                # The fit may have kept its best: a row, but the last one.
                interrupted = rows[label].rows[-1].report.status is Status.INTERRUPTED
                if interrupted:
                    break
            if rows:
                bar.stage("measuring")
                judge = Judge(subject, names)
                values = {
                    label: [judge.measure(row.factorization, row.split) for row in several.rows]
                    for label, several in rows.items()
                }
                done.append(_Compared(subject, rows, values, judge.conditions()))
            if interrupted:
                break
        if plot is not None:
            bar.stage("drawing")
            from homofact.figures.plot import plot_rows

            plot.parent.mkdir(parents=True, exist_ok=True)
            plot_rows(plot, list(done[0].rows.values()))
    for one in done:
        one.show(screen, several=len(each) > 1)
    answer: dict[str, Any] = done[0].answer() if len(each) == 1 else {"sources": [one.answer() for one in done]}
    if len(each) > 1 or any(tables):
        measured = [fit for one in done for fit in one.measured()]
        answer |= _means_written(screen, measured, *tables)
    if plot is not None:
        screen.note(f"The figure: {plot}")
        answer["plot"] = str(plot)
    screen.answer(answer)
    if interrupted:
        if len(each) == 1:
            screen.note(f"homofact: interrupted, {len(done[0].rows)} of {len(fits)} methods are compared")
        else:
            count = sum(len(one.rows) for one in done)
            screen.note(f"homofact: interrupted, {count} of {len(planned)} fits of a method to a source are compared")
        raise typer.Exit(130)


@dataclass(frozen=True)
class _Compared:
    """The methods' fits to one source by every seed, each with its metrics, and under which conditions these hold."""

    source: "Source"
    rows: "dict[str, SeedRows]"
    values: dict[str, list[dict[str, float | None]]]
    conditions: list[str]

    def _records(self) -> dict[str, dict[str, Any]]:
        return {label: rows.record() | {"metrics": _means(self.values[label])} for label, rows in self.rows.items()}

    def show(self, screen: Screen, several: bool) -> None:
        """The tables, and how the fits ended."""
        for label, seeds in self.rows.items():
            for row in seeds.rows:
                of = f"{self.source.name}, " * several + label
                say_ending(screen, row.report, f"{of}, seed {row.settings.seed}" if len(seeds.rows) > 1 else of)
        records = self._records()
        say_subset(screen, next(iter(records.values())))
        if several:
            screen.show(Text(f"\n{self.source.name}", "bold"))
        screen.show(error_table(records), *appearance_tables(records))
        means = {label: _means(values) for label, values in self.values.items()}
        screen.show(*metric_tables(means), *(Text(each) for each in self.conditions), cost_table(records))
        screen.show(*map(Text, brief_lines({label: rows.first.verdict for label, rows in self.rows.items()})))

    def answer(self) -> dict[str, Any]:
        """The JSON form."""
        return {
            "source": self.source.name,
            "rows": [{"label": label, **each} for label, each in self._records().items()],
            "metric_conditions": self.conditions,
        }

    def measured(self) -> "list[MeasuredFit]":
        """Every fit with its numbers."""
        from homofact.evaluate.means import MeasuredFit

        found = []
        for label, seeds in self.rows.items():
            for row, values in zip(seeds.rows, self.values[label], strict=True):
                fit = row.factorization
                found.append(MeasuredFit(self.source.name, label, row.settings.seed, fit.nbytes, fit.fetches, values))
        return found


def _settings_of_each(settings: "Config") -> "list[Config]":
    """The settings of each source. Raises BadInput where there is none, or a file is missing."""
    sources = settings.compare.sources
    if not sources:
        check_source(settings)
        return [settings]
    for text in sources:
        check_measurement(text)
    return [replace(settings, source=replace(settings.source, path=text)) for text in sources]


def _files(settings: "Config", sources: int) -> tuple[Path | None, ...]:
    """Where the figure, the CSV and the LaTeX go. Raises BadInput where one cannot be put."""
    asked = settings.compare
    if asked.plot is not None and sources > 1:
        raise BadInput(f"plot: found {sources} sources, expected one for a figure")
    places = []
    for given, endings in ((asked.plot, (".png", ".pdf", ".svg")), (asked.csv, (".csv",)), (asked.latex, (".tex",))):
        places.append(None if given is None else Path(given))
        if given is not None:
            check_file(Path(given), *endings)
    if asked.plot is not None:
        extras.check("plot", "matplotlib")
    return tuple(places)


def _means_written(
    screen: Screen, measured: "list[MeasuredFit]", csv: Path | None, latex: Path | None
) -> dict[str, Any]:
    """Show the means over sources and seeds, and write them to the files that are asked for."""
    from homofact.evaluate.means import csv_of, latex_of, mean_rows
    from homofact.files.atomic import write_text

    rows = mean_rows(measured)
    screen.show(mean_table(rows))
    answer: dict[str, Any] = {
        "means": [
            {
                "method": row.method,
                "bytes": row.nbytes,
                "fetches": row.fetches,
                "sources": row.sources,
                "fits": row.fits,
            }
            | {"metrics": {name: spread and spread.record() for name, spread in row.spreads.items()}}
            for row in rows
        ]
    }
    for place, write, what in ((csv, csv_of, "csv"), (latex, latex_of, "latex")):
        if place is not None:
            place.parent.mkdir(parents=True, exist_ok=True)
            write_text(place, write(measured))
            screen.note(f"The table: {place}")
            answer[what] = str(place)
    return answer


def _means(measured: list[dict[str, float | None]]) -> Mapping[str, float | None]:
    """The mean of every metric over the seeds, None where one of them has none."""
    found = {name: [each[name] for each in measured] for name in measured[0]}
    return {
        name: None if None in numbers else sum(number or 0.0 for number in numbers) / len(numbers)
        for name, numbers in found.items()
    }
