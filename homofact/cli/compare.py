"""`homofact compare`: several methods fitted to the same split, side by side."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer
from rich.text import Text

from homofact.cli import options as o
from homofact.cli.places import check_file
from homofact.cli.screen import Screen, say_ending, say_estimate, say_subset
from homofact.cli.subject import check_source, open_subject, warmed_up
from homofact.cli.tables import appearance_tables, cost_table, error_table, metric_tables
from homofact.cli.verdicts import brief_lines, refuse_findings, refused_names
from homofact.errors import Status

if TYPE_CHECKING:
    from homofact.config import Config


@o.configured("source.path", "compare", "source", "evaluate", "fit", "seed", but=("fit.method",))
def compare(
    settings: "Config",
    seeds: o.Seeds = 1,
    strict: o.Strict = False,
    refuse: o.Refuse = "",
    as_json: o.AsJson = False,
    quiet: o.Quiet = False,
) -> None:
    """Fit several methods to the same samples and print their errors and costs.

    Ctrl-C ends it with what is compared by then, and exit code 130.
    """
    refused = refused_names(refuse)
    check_source(settings)
    target = None if settings.compare.plot is None else Path(settings.compare.plot)
    if target is not None:
        check_file(target, ".png", ".pdf", ".svg")
    fits = settings.fit.methods(settings.compare.methods)

    from homofact.evaluate.estimate import TimeEstimate, about, fit_seconds, training_count
    from homofact.evaluate.judging import Judge, chosen_metrics
    from homofact.evaluate.seeds import SeedRows, fit_seeds
    from homofact.figures.plot import plot_rows

    names = chosen_metrics(settings.compare.metrics)
    screen = Screen(as_json, quiet)
    with screen.bar() as bar:
        bar.stage("reading")
        subject = open_subject(settings)
        warmed_up(screen)
        held_out, subset = settings.evaluate.held_out, settings.source.subset
        counts = {label: training_count(subject, fit, held_out, subset) for label, fit in fits.items()}
        estimate = TimeEstimate(
            [(fit.name, fit_seconds(fit, counts[label])) for label, fit in fits.items() for _ in range(seeds)]
        )
        say_estimate(screen, estimate)
        rows: dict[str, SeedRows] = {}
        interrupted = False
        for label, fit in fits.items():
            bar.run(f"{label}, {about(estimate.seconds_left)} left", len(rows) * seeds, len(fits) * seeds)
            try:
                rows[label] = fit_seeds(subject, fit, seeds, held_out, bar, subset)
            except KeyboardInterrupt:
                if not rows:
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
        bar.stage("measuring")
        judge = Judge(subject, names)
        values = {
            label: _means([judge.measure(row.factorization, row.split) for row in several.rows])
            for label, several in rows.items()
        }
        conditions = judge.conditions()
        if target is not None:
            bar.stage("drawing")
            target.parent.mkdir(parents=True, exist_ok=True)
            plot_rows(target, list(rows.values()))
    for label, several in rows.items():
        for row in several.rows:
            of_several = f", seed {row.settings.seed}" if seeds > 1 else ""
            say_ending(screen, row.report, f"{label}{of_several}")
    records = {label: several.record() | {"metrics": values[label]} for label, several in rows.items()}
    say_subset(screen, next(iter(records.values())))
    screen.show(error_table(records), *appearance_tables(records))
    screen.show(*metric_tables(values), *(Text(each) for each in conditions), cost_table(records))
    screen.show(*map(Text, brief_lines({label: several.first.verdict for label, several in rows.items()})))
    answer: dict[str, Any] = {
        "source": subject.name,
        "rows": [{"label": label, **each} for label, each in records.items()],
        "metric_conditions": conditions,
    }
    if target is not None:
        screen.note(f"The figure: {target}")
        answer["plot"] = str(target)
    screen.answer(answer)
    if interrupted:
        screen.note(f"homofact: interrupted, {len(rows)} of {len(fits)} methods are compared")
        raise typer.Exit(130)


def _means(measured: "list[dict[str, float | None]]") -> "dict[str, float | None]":
    """The mean of every metric over the seeds, None where one of them has none."""
    found = {name: [each[name] for each in measured] for name in measured[0]}
    return {
        name: None if None in numbers else sum(number or 0.0 for number in numbers) / len(numbers)
        for name, numbers in found.items()
    }
