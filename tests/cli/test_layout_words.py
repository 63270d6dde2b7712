"""No name breaks inside a word in 80 columns while there is room, whatever the table; then it breaks at a joint."""

import io

import pytest
from rich.console import Console
from rich.table import Table
from rich.text import Text

from homofact.cli.layout import add_figures, add_names, plain_table
from homofact.cli.tables import appearance_tables, chart_table

NAME = "irid_flake_paint1_fine.bsdf"
LONG = "lafortune-blue-paint-of-a-thesis"
FIGURES = ("rms", "floor", "albedo", "energy", "highlight", "lamp dB", "sky dB")


def printed(table: Table, width: int = 80) -> list[str]:
    out = io.StringIO()
    Console(file=out, width=width).print(table)
    lines = [line.rstrip() for line in out.getvalue().splitlines()]
    assert max(map(len, lines)) <= width
    return lines


def test_a_name_keeps_its_words_beside_a_long_text() -> None:
    table = plain_table()
    add_names(table)
    table.add_column("form")
    add_figures(table, "K", "maps", "N", "kB", "error")
    form = "harmonics to order 3, separate lobe, clustered in components"
    table.add_row(f"Garnet paint, {NAME}", form, "12", "16²", "120", "3000", "1.38%")
    text = "\n".join(printed(table))
    assert NAME in text
    assert "1.38%" in text
    assert all(word in text for word in form.split())


def test_a_word_without_room_breaks_at_a_joint() -> None:
    table = plain_table()
    add_names(table)
    add_figures(table, *FIGURES)
    table.add_row(Text(LONG, "bold"), *["0.0123"] * 7)
    first, second = printed(table)[3:5]
    assert first.split() == ["lafortune-blue-", *["0.0123"] * 7]
    assert second.strip() == "paint-of-a-thesis"
    # The table is as before, and prints the same at another width.
    assert LONG in "\n".join(printed(table, 120))
    assert printed(table)[3:5] == [first, second]


def test_a_table_that_fits_is_as_rich_has_it() -> None:
    table = plain_table()
    add_names(table)
    add_figures(table, "a")
    table.add_row("short name", "1")
    assert printed(table)[-2:-1] == [" short name  1"]


@pytest.mark.parametrize("width", [12, 20, 30])
def test_too_narrow_a_terminal_loses_no_letter(width: int) -> None:
    table = plain_table()
    add_names(table)
    add_names(table, "more")
    table.add_row(LONG, NAME)
    letters = "".join("".join(printed(table, width)).split())
    assert sorted(letters) == sorted(f"more{'─' * letters.count('─')}{LONG}{NAME}")


def test_tables_of_comparisons_keep_names_whole() -> None:
    names = ("rms_cosine", "floor_cosine", "albedo_worst", "energy_overall", "highlight", "psnr_light", "psnr_sky")
    (table,) = appearance_tables({"search-two": {"appearance": dict.fromkeys(names, 0.01234)}})
    assert any("search-two" in line for line in printed(table))
    record = {
        "label": "mccool-theta", "search": "", "textures": 2, "size": 16, "bytes": 6144, "fetches": 3,
        "seconds": {"fit": 1.5}, "status": "converged", "error": {"held_out": {"log_mse": 0.0123}},
    }  # fmt: skip
    assert any("mccool-theta" in line for line in printed(chart_table("t", [record], 0.5, [None])))
