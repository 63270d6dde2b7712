"""A sweep's results as rows of figures, and their medians."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from typing import Any, ClassVar

from homofact.evaluation.bar.error_bar import BarKind, ErrorBars, percent
from homofact.evaluation.metric_table import METRICS, REPORTED, Metric
from homofact.sweeps.ledger import Result, SweepLedger


@dataclass(frozen=True)
class Limit:
    """The limit that a verdict estimates for one error of a fit to a list of samples.

    Its value is a relative error, 0.07 for 7%, and infinite if the verdict states no limit. `name` is its name in CSV
    and in `FitRow.limits`. `quantity` is that of the verdict's error bar.
    """

    name: str
    quantity: str
    label: str
    good: ClassVar = "low"
    domain: ClassVar = ""

    @property
    def words(self) -> str:
        """The label in words."""
        return f"limit of the verdict: {self.label}"

    def badness(self, value: float) -> float:
        """Return a number that is larger for worse values: the limit itself."""
        return value


LIMITS = (
    Limit("light_limit", "albedo", "total reflected light"),
    Limit("highlight_limit", "highlight", "highlight"),
    Limit("sky_limit", "sky", "picture under a sky"),
)
# What the tables of a sweep may show of a fit.
FIGURES: tuple[Metric | Limit, ...] = (*REPORTED, *LIMITS)
IN_ALL_DIRECTIONS = "These compare fit and source in all directions, where a list of samples cannot be evaluated."
_NAMED: Mapping[str, Metric | Limit] = {**METRICS, **{limit.name: limit for limit in LIMITS}}


@dataclass(frozen=True)
class FitRow:
    """The figures of one result; a metric that it does not have is None. `trusted` is the verdict's.

    `limits` has the limits of the verdict by the names of `LIMITS`. It is empty if the fit was compared with its source
    in all directions. Log errors depend on `epsilon`, the ε of the fit. Compare log errors only at the same ε.
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
    limits: dict[str, float] = field(default_factory=dict)

    def cells(self) -> dict[str, Any]:
        """Return all figures by column, for a CSV file; a limit that the verdict does not state is infinite."""
        plain = {name: value for name, value in vars(self).items() if name not in ("metrics", "limits")}
        return plain | self.metrics | {limit.name: self.limits.get(limit.name) for limit in LIMITS}


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
        _limits(report["verdict"]),
    )


def _limits(verdict: Mapping[str, Any]) -> dict[str, float]:
    """Return the limits of a verdict's record; empty if it has measured errors instead."""
    bars = ErrorBars.of_record(verdict.get("bars"))
    if bars is None or bars.kind is BarKind.MEASURED:
        return {}
    stated = {bar.quantity: math.inf if bar.error is None else bar.error for bar in bars.bars}
    return {limit.name: stated[limit.quantity] for limit in LIMITS if limit.quantity in stated}


def value_of(row: FitRow, name: str) -> float | None:
    """Return the value of a metric or a limit; None if the fit does not have it."""
    return row.limits.get(name) if isinstance(_NAMED[name], Limit) else row.metrics[name]


def with_values(rows: Iterable[FitRow]) -> tuple[Metric | Limit, ...]:
    """Return those of `FIGURES` that at least one row has."""
    rows = list(rows)
    return tuple(each for each in FIGURES if any(value_of(row, each.name) is not None for row in rows))


def limit_figure(value: float | None) -> str:
    """Return a limit for a table, rounded up: "7%", "×5.5" for a factor of 5.5, or "unknown" if it is infinite."""
    if value is None:
        return "–"
    return percent(value, "×") if math.isfinite(value) else "unknown"


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
    """Return the median of a metric or a limit over those rows that have it; it is infinite for an unknown limit.

    For a ratio that should be 1, it is the median of its distance from 1, as a factor of 1 or more: fits that are too
    dark and too bright do not cancel.
    """
    metric = _NAMED[name]
    values = [value for row in rows if (value := value_of(row, name)) is not None]
    return median(map(metric.badness, values) if metric.good == "one" else values) if values else None


def summary_records(rows: Sequence[FitRow]) -> dict[str, dict[str, float | None]]:
    """Return the median of every metric for each label, as `middle` computes it."""
    names = [metric.name for metric in REPORTED]
    return {label: {name: middle(some, name) for name in names} for label, some in by_label(rows).items()}
