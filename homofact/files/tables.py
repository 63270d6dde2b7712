"""Write tables as CSV with harmless cells: a spreadsheet would run a text that begins like a formula.

An apostrophe is written before such a text, because spreadsheets mark text in this way. A text that begins with an
apostrophe gets another one, so that `csv_rows` returns the rows that `csv_text` received. Numbers are written
unchanged.
"""

import csv
import io
from collections.abc import Iterable, Sequence
from typing import Any

FORMULAS = frozenset("=+-@\t\r|%")
_MARK = "'"


def csv_text(rows: Iterable[Sequence[Any]]) -> str:
    """Return the CSV of rows of cells: texts harmless to a spreadsheet, numbers in full, None empty."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([_cell(cell) for cell in row] for row in rows)
    return text.getvalue()


def csv_rows(text: str) -> list[list[str]]:
    """Return the rows of a text that `csv_text` wrote. Raises csv.Error for invalid CSV."""
    return [[_plain(cell) for cell in row] for row in csv.reader(io.StringIO(text, newline=""))]


def _cell(value: Any) -> Any:
    marked = isinstance(value, str) and (value[:1] in FORMULAS or value[:1] == _MARK) and not _is_number(value)
    return f"{_MARK}{value}" if marked and value else value


def _plain(cell: str) -> str:
    return cell[1:] if cell[:1] == _MARK and (cell[1:2] in FORMULAS or cell[1:2] == _MARK) else cell


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
