"""A sweep's results as rows of figures, and their medians."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

from homofact.evaluation.metric_table import METRICS, REPORTED
from homofact.sweeps.ledger import Result, SweepLedger


@dataclass(frozen=True)
class FitRow:
    """The figures of one result; a metric that it does not have is None. `trusted` is the verdict's.

    Log errors depend on `epsilon`, the ε of the fit. Compare log errors only at the same ε.
    """

    key: str
    source: str
    name: str
    label: str
    seed: int
    bytes: int
    fetches: int
    textures: int
    epsilon: float
    seconds: float
    status: str
    trusted: bool
    metrics: dict[str, float | None]

    def cells(self) -> dict[str, Any]:
        """Return all figures by column, for a CSV file."""
        plain = {name: value for name, value in vars(self).items() if name != "metrics"}
        return plain | self.metrics


def rows_of(folder: Path) -> list[FitRow]:
    """Return the rows of a sweep's folder in the requested order. Raises BadInput if a result was changed."""
    return [row_of(result) for result in SweepLedger(folder).results()]


def row_of(result: Result) -> FitRow:
    """Return the figures of one result."""
    task, report = result.task, result.report
    seen = report.get("appearance") or {}
    metrics = {metric.name: report["error"]["held_out"].get(metric.name, seen.get(metric.name)) for metric in REPORTED}
    return FitRow(
        task.key,
        task.source,
        task.name,
        task.label,
        int(task.settings["seed"]),
        report["bytes"],
        report["fetches"],
        report["textures"],
        report["epsilon"],
        report["seconds"]["fit"],
        report["status"],
        bool(report["verdict"]["trusted"]),
        metrics,
    )


def by_label(rows: Iterable[FitRow]) -> dict[str, list[FitRow]]:
    """Return the rows of each label, in the order in which the labels first appear."""
    grouped: dict[str, list[FitRow]] = {}
    for row in rows:
        grouped.setdefault(row.label, []).append(row)
    return grouped


def mixes_epsilons(rows: Iterable[FitRow]) -> bool:
    """Return whether the rows have more than one ε: then their log errors, and medians of these, are not comparable."""
    return len({row.epsilon for row in rows}) > 1


def without_light(rows: Iterable[FitRow]) -> tuple[str, ...]:
    """Return the materials whose fits have no figures of reflected light; empty if no material has such figures.

    These materials are lists of samples. Medians of the figures of light cover only the other materials.
    """
    rows = list(rows)
    lacking = dict.fromkeys(row.name for row in rows if row.metrics["albedo_worst"] is None)
    return () if all(row.name in lacking for row in rows) else tuple(lacking)


def middle(rows: Sequence[FitRow], name: str) -> float | None:
    """Return the median of a metric over those rows that have it.

    For a ratio that should be 1, it is the median of its distance from 1, as a factor of 1 or more: fits that are too
    dark and too bright do not cancel.
    """
    metric = METRICS[name]
    values = [value for row in rows if (value := row.metrics[name]) is not None]
    return median(map(metric.badness, values) if metric.good == "one" else values) if values else None


def summary_records(rows: Sequence[FitRow]) -> dict[str, dict[str, float | None]]:
    """Return the median of every metric for each label, as `middle` computes it."""
    names = [metric.name for metric in REPORTED]
    return {label: {name: middle(some, name) for name in names} for label, some in by_label(rows).items()}
