"""CSV that no spreadsheet runs, and that comes back as it was."""

import csv
import io

import pytest
from hostile import NAMES
from hypothesis import given
from hypothesis import strategies as some

from homofact.files.tables import FORMULAS, csv_rows, csv_text


@pytest.mark.parametrize(
    "text", [*NAMES, '=HYPERLINK("https://evil.example","x")', "@SUM(1+1)", "+1+1", "-1+cmd|' /C calc'!A0", "\t=1", "'"]
)
def test_no_text_is_a_formula_and_all_come_back(text: str) -> None:
    written = csv_text([["name", text], [text, "x"]])
    for row in csv.reader(io.StringIO(written, newline="")):
        assert not any(cell[:1] in FORMULAS and cell for cell in row)
    if "\r" not in text and "\0" not in text:
        assert csv_rows(written) == [["name", text], [text, "x"]]


def test_numbers_stay_numbers() -> None:
    assert csv_text([["-1.5", -2.5e-7, 3, None, "+4", "-inf"]]) == "-1.5,-2.5e-07,3,,+4,-inf\n"


@given(some.lists(some.text(some.characters(exclude_characters="\r\n\0", exclude_categories=("Cs",))), min_size=2))
def test_any_row_comes_back(row: list[str]) -> None:
    assert csv_rows(csv_text([row])) == [row]
