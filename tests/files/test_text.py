"""Tables of numbers in text files: what their errors advise."""

import pytest

from homofact.errors import BadInput
from homofact.files.text import number_table


@pytest.mark.parametrize(
    ("line", "separator", "advised"), [("1,5;2", ",", True), ("1,2,3", ",", False), ("1;2;3", None, False)]
)
def test_semicolons_in_a_table_of_commas_get_advice(line: str, separator: str | None, advised: bool) -> None:
    with pytest.raises(BadInput) as error:
        number_table("a.csv", [(2, line), (3, "1")], 4, "as the header names", separator)
    assert ("commas" in error.value.hint) is advised
    assert str(error.value.where) == "a.csv: line 2"
