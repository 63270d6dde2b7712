"""A sweep's results as rows of figures, and their medians."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

from homofact.sweep.ledger import Ledger, Result


@dataclass(frozen=True)
class Metric:
    """One figure of a result: its name, its words with the unit, and what is good: "low", "high" or 1, "one"."""

    name: str
    words: str
    good: str

    def badness(self, value: float) -> float:
        """Greater where it is worse; of a ratio the distance from 1 either way."""
        if self.good == "one":
            return max(value, 1 / value) if value > 0 else float("inf")
        return value if self.good == "low" else -value


METRICS = (
    Metric("log_mse", "log MSE, held out", "low"),
    Metric("mae", "MAE, held out, sr⁻¹", "low"),
    Metric("albedo_worst", "albedo, worst, fit over source", "one"),
    Metric("energy_overall", "energy, fit over source", "one"),
    Metric("highlight", "highlight, fit over source", "one"),
    Metric("rms", "relative RMS", "low"),
    Metric("psnr_light", "PSNR under a lamp, dB", "high"),
    Metric("psnr_sky", "PSNR under a sky, dB", "high"),
)


@dataclass(frozen=True)
class FitRow:
    """The figures of one result; a metric that it does not have is None. `trusted` is the verdict's."""

    key: str
    source: str
    name: str
    label: str
    seed: int
    bytes: int
    fetches: int
    textures: int
    seconds: float
    status: str
    trusted: bool
    metrics: dict[str, float | None]

    def cells(self) -> dict[str, Any]:
        """Flat, by column, for a CSV."""
        plain = {name: value for name, value in vars(self).items() if name != "metrics"}
        return plain | self.metrics


def rows_of(folder: Path) -> list[FitRow]:
    """The rows of a sweep's folder, in the order that was asked for. Raises BadInput where a result was changed."""
    return [row_of(each) for each in Ledger(folder).results()]


def row_of(result: Result) -> FitRow:
    """The figures of one result."""
    task, report = result.task, result.report
    seen = report.get("appearance") or {}
    metrics = {each.name: report["error"]["held_out"].get(each.name, seen.get(each.name)) for each in METRICS}
    return FitRow(
        task.key,
        task.source,
        task.name,
        task.label,
        int(task.settings["seed"]),
        report["bytes"],
        report["fetches"],
        report["textures"],
        report["seconds"]["fit"],
        report["status"],
        bool(report["verdict"]["trusted"]),
        metrics,
    )


def by_label(rows: Iterable[FitRow]) -> dict[str, list[FitRow]]:
    """The rows of each method, in the order of their first."""
    found: dict[str, list[FitRow]] = {}
    for row in rows:
        found.setdefault(row.label, []).append(row)
    return found


def middle(rows: Sequence[FitRow], name: str) -> float | None:
    """The median of a metric over those rows that have it."""
    found = [value for row in rows if (value := row.metrics[name]) is not None]
    return median(found) if found else None


def summary_records(rows: Sequence[FitRow]) -> dict[str, dict[str, float | None]]:
    """By method the median of every metric."""
    return {label: {each.name: middle(some, each.name) for each in METRICS} for label, some in by_label(rows).items()}
