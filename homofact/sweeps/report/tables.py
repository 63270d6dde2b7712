"""The figures of a report's pages, as CSV and, if pyarrow is installed, as Parquet."""

import json
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

from homofact.files import extras
from homofact.files.atomic import write_text
from homofact.files.tables import csv_text
from homofact.sweeps.ledger import Aside
from homofact.sweeps.report.reading import ReportedFit

NO_PARQUET = extras.told("pyarrow", "no Parquet")


def parquet_there() -> bool:
    """Return whether tables can be written as Parquet too."""
    return extras.installed("pyarrow")


def fit_rows(fits: Sequence[ReportedFit]) -> list[dict[str, Any]]:
    """Return one row per fit: its figures as `summary.FitRow.cells`, then its source and settings."""
    return [
        fit.row.cells()
        | {
            "verdict": fit.summary,
            "findings": ", ".join(finding.name for finding in fit.findings),
            "digest": fit.task.digest,
            "version": fit.task.version,
            "method": fit.task.method,
            "held_out": fit.task.held_out,
            "settings": json.dumps(fit.task.record()["settings"]),
            "opening": json.dumps(fit.task.record()["opening"]),
        }
        for fit in fits
    ]


def aside_rows(aside: Sequence[Aside]) -> list[dict[str, Any]]:
    """Return a row for each fit that was set aside."""
    return [
        {
            "key": entry.task.key,
            "source": entry.task.source,
            "name": entry.task.name,
            "label": entry.task.label,
            "seed": entry.task.settings["seed"],
            "workers_died": entry.deaths,
            "reason": entry.reason,
        }
        for entry in aside
    ]


def write_table(folder: Path, name: str, rows: Sequence[dict[str, Any]]) -> list[str]:
    """Write one or more rows to NAME.csv and, if possible, NAME.parquet; return the files' names.

    Numbers have all digits, and missing values are empty cells. The encoding is UTF-8.
    """
    columns = list(rows[0])
    write_text(folder / f"{name}.csv", csv_text([columns, *([row[key] for key in columns] for row in rows)]))
    if not parquet_there():
        return [f"{name}.csv"]
    arrow, parquet = import_module("pyarrow"), import_module("pyarrow.parquet")
    cells = {key: [_storable(row[key]) for row in rows] for key in columns}
    # A column of nothing but gaps is one of numbers.
    kinds = {key: None if any(cell is not None for cell in own) else "float64" for key, own in cells.items()}
    table = arrow.table({key: arrow.array(own, kinds[key]) for key, own in cells.items()})
    parquet.write_table(table, folder / f"{name}.parquet")
    return [f"{name}.csv", f"{name}.parquet"]


def _storable(value: Any) -> Any:
    """UTF-8 holds no lone surrogate: it is written as \\udcff, as in the CSV."""
    return value.encode(errors="backslashreplace").decode() if isinstance(value, str) else value
