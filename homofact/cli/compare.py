"""`homofact compare`: several methods fitted to the same split, side by side."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.text import Text

from homofact.cli import options as o
from homofact.cli.places import check_file
from homofact.cli.screen import Screen, say_ending, say_subset
from homofact.cli.subject import check_source, open_subject, warmed_up
from homofact.cli.tables import cost_table, error_table, metric_tables
from homofact.cli.verdicts import brief_lines, refuse_findings

if TYPE_CHECKING:
    from homofact.config import Config


@o.configured("source.path", "compare", "source", "evaluate", "fit", "seed", but=("fit.method",))
def compare(
    settings: "Config",
    strict: o.Strict = False,
    as_json: o.AsJson = False,
    quiet: o.Quiet = False,
) -> None:
    """Fit several methods to the same samples and print their errors and costs."""
    check_source(settings)
    target = None if settings.compare.plot is None else Path(settings.compare.plot)
    if target is not None:
        check_file(target, ".png", ".pdf", ".svg")
    fits = settings.fit.methods(settings.compare.methods)

    from homofact.evaluate.compare import fit_and_measure
    from homofact.evaluate.judging import Judge, chosen_metrics
    from homofact.figures.plot import plot_rows
    from homofact.files.atomic import replace_file

    names = chosen_metrics(settings.compare.metrics)
    screen = Screen(as_json, quiet)
    with screen.bar() as bar:
        bar.stage("reading")
        subject = open_subject(settings)
        warmed_up(screen)
        rows = {}
        for label, fit in fits.items():
            bar.stage(label)
            rows[label] = fit_and_measure(subject, fit, settings.evaluate.held_out, bar, settings.source.subset)
            if strict:
                refuse_findings(rows[label].verdict, label)
        bar.stage("measuring")
        judge = Judge(subject, settings.evaluate.held_out, names)
        values = {label: judge.measure(row) for label, row in rows.items()}
        conditions = judge.conditions()
        if target is not None:
            bar.stage("drawing")
            target.parent.mkdir(parents=True, exist_ok=True)
            replace_file(target, lambda beside: plot_rows(beside, list(rows.values())))
    for label, row in rows.items():
        say_ending(screen, row.report, label)
    records = {label: row.record() | {"metrics": values[label]} for label, row in rows.items()}
    say_subset(screen, next(iter(records.values())))
    screen.show(error_table(records), *metric_tables(values), *(Text(each) for each in conditions), cost_table(records))
    screen.show(*brief_lines({label: row.verdict for label, row in rows.items()}))
    answer: dict[str, Any] = {
        "source": subject.name,
        "rows": [{"label": label, **each} for label, each in records.items()],
        "metric_conditions": conditions,
    }
    if target is not None:
        screen.note(f"The figure: {target}")
        answer["plot"] = str(target)
    screen.answer(answer)
