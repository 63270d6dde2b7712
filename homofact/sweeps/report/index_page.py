"""The page of a whole sweep: charts, the table of all fits, the worst of them, what changed, what was set aside.

The page contains its data as JSON, with one list per fit, and draws the visible part. The JSON has figures with six
digits; the tables beside the page have all digits. It has only figures that at least one fit has. A limit that is not
stated is "unknown".
"""

import math
from collections.abc import Mapping, Sequence
from statistics import median
from typing import Any

from homofact.evaluation.metric_table import Metric
from homofact.sweeps.report.columns import TITLES, median_notes, notes
from homofact.sweeps.report.comparison import SweepComparison, word, worst
from homofact.sweeps.report.html import PACKAGE, page_html
from homofact.sweeps.report.material_page import FitFiles
from homofact.sweeps.report.reading import ReadSweep, ReportedFit
from homofact.sweeps.summary import Limit, by_label, middle, value_of, with_values
from homofact.web.assembly import part

SCRIPTS = ("formats.js", "axes.js", "plot.js", "table.js", "lists.js", "index.js")


def index_html(
    sweep: ReadSweep, shown: Mapping[str, FitFiles], comparison: SweepComparison | None, files: Sequence[str]
) -> str:
    """Return the page; `files` are the tables beside it."""
    materials = len(sweep.names())
    made = ", ".join(sweep.versions)
    counts = [_count(len(sweep.fits), "fit"), f"of {_count(materials, 'material')}", f"homofact {made}"]
    return page_html(
        part(PACKAGE, "index.html"),
        sweep.name,
        ", ".join((" ".join(counts[:2]), *counts[2:])),
        [part("homofact.web", "elements.js"), *(part(PACKAGE, name) for name in SCRIPTS)],
        index_data(sweep, shown, comparison, files),
    )


def index_data(
    sweep: ReadSweep, shown: Mapping[str, FitFiles], comparison: SweepComparison | None, files: Sequence[str]
) -> dict[str, Any]:
    """Return the data that the page draws; `index.js` defines the order of the entries in a fit's list."""
    rows = [fit.row for fit in sweep.fits]
    metrics = with_values(rows)
    labels = list(by_label(rows))
    materials = [{"page": page, "name": name} for page, name in sweep.names().items()]
    places = {material["page"]: k for k, material in enumerate(materials)}
    numbers = {fit.row.key: k for k, fit in enumerate(sweep.fits)}
    return {
        "metrics": [
            {
                "name": metric.name,
                "words": metric.words,
                "title": TITLES[metric.name],
                "good": metric.good,
                "log": metric.domain == "log",
                "limit": isinstance(metric, Limit),
            }
            for metric in metrics
        ],
        "notes": notes(rows),
        "median_notes": median_notes(rows),
        "labels": labels,
        "materials": materials,
        "fits": [_fit(fit, metrics, places[fit.material], labels, shown[fit.row.key]) for fit in sweep.fits],
        "methods": _methods(sweep, metrics),
        "worst": {metric.name: _worst(sweep, metric, labels, numbers) for metric in metrics},
        "aside": [
            [entry.task.name, entry.task.label, entry.task.settings["seed"], entry.reason, entry.deaths]
            for entry in sweep.aside
        ],
        "left": sweep.left,
        "comparison": None if comparison is None else _comparison(comparison, metrics, numbers),
        "files": list(files),
    }


def _fit(
    fit: ReportedFit, metrics: Sequence[Metric | Limit], material: int, labels: Sequence[str], shown: FitFiles
) -> list[Any]:
    row = fit.row
    figures = [_short(value_of(row, metric.name)) for metric in metrics]
    known = [
        material,
        labels.index(row.label),
        row.seed,
        row.bytes,
        _short(row.seconds),
        row.fetches,
        row.textures,
        row.epsilon,
    ]
    return [*known, int(row.trusted), row.key, shown.viewer or "", *figures]


def _methods(sweep: ReadSweep, metrics: Sequence[Metric | Limit]) -> list[list[Any]]:
    """A row for each label: fits, trusted, median bytes and seconds, then the medians of the metrics."""
    grouped = by_label(fit.row for fit in sweep.fits)
    return [
        [
            label,
            len(rows),
            sum(row.trusted for row in rows),
            median(row.bytes for row in rows),
            _short(median(row.seconds for row in rows)),
            *(_short(middle(rows, metric.name)) for metric in metrics),
        ]
        for label, rows in grouped.items()
    ]


def _worst(sweep: ReadSweep, metric: Any, labels: Sequence[str], numbers: Mapping[str, int]) -> list[list[int]]:
    """The numbers of the worst ten fits: of all, then of each label."""
    groups = [list(sweep.fits), *([fit for fit in sweep.fits if fit.row.label == label] for label in labels)]
    return [[numbers[fit.row.key] for fit in worst(group, metric)] for group in groups]


def _comparison(
    comparison: SweepComparison, metrics: Sequence[Metric | Limit], numbers: Mapping[str, int]
) -> dict[str, Any]:
    changes: dict[str, list[list[Any]]] = {}
    for metric in metrics:
        steps = [(step, pair) for pair in comparison.pairs if (step := pair.change(metric)) is not None]
        steps.sort(key=lambda entry: (-abs(entry[0]), numbers[entry[1].now.row.key]))
        changes[metric.name] = [
            [
                numbers[pair.now.row.key],
                _short(value_of(pair.before.row, metric.name)),
                _short(value_of(pair.now.row, metric.name)),
                word(metric, step),
            ]
            for step, pair in steps
        ]
    return {"name": comparison.before.name} | comparison.record() | {"changes": changes}


def _short(value: float | None) -> float | str | None:
    """Six digits; "unknown" for an infinite limit, which JSON cannot write as a number."""
    if value is None:
        return None
    return float(f"{value:.6g}") if math.isfinite(value) else "unknown"


def _count(number: int, what: str) -> str:
    return f"{number:,} {what}{'' if number == 1 else 's'}"
