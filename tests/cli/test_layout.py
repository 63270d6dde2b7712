"""Tables in narrow terminals: names stay whole while something else can give way, figures always."""

import io

import pytest
from rich.console import Console

from homofact.cli.layout import LEAST_NAME, add_figures, add_names, hanging, plain_table
from homofact.cli.screen import Screen
from homofact.cli.tables import error_table
from homofact.evaluation.metric_table import SIX

FIGURES = ["30%", "66%", "123456", "1", "2"]


def lines(name: str, width: int) -> list[str]:
    table = plain_table("Choices")
    add_names(table, longest=len(name))
    table.add_column("chosen")
    add_figures(table, "share", "of tolerance", "bytes", "fetches", "fits")
    table.add_row(name, "search 1 × 4², 8 bits", *FIGURES)
    out = io.StringIO()
    Console(file=out, width=width).print(table)
    return [line.rstrip() for line in out.getvalue().splitlines()]


@pytest.mark.parametrize("name", ["cook-torrance-plastic", "x" * LEAST_NAME])
def test_a_name_is_whole_where_another_column_can_be_broken(name: str) -> None:
    found = lines(name, 80)
    assert max(map(len, found)) <= 80
    assert found[0] == "Choices"
    row = found[4].split()
    assert (row[0], row[-5:]) == (name, FIGURES)


def test_a_very_long_name_is_broken_and_no_figure_is() -> None:
    found = lines("z" * 70, 80)
    assert max(map(len, found)) <= 80
    assert sum(line.count("z") for line in found) == 70
    assert any("z" in line and line.split()[-5:] == FIGURES for line in found)


def test_advice_under_a_bullet_is_an_option_and_wraps_under_its_text() -> None:
    out = io.StringIO()
    Console(file=out, width=30).print(hanging("  - larger textures or more (`size=32`)", 4))
    assert [line.rstrip() for line in out.getvalue().splitlines()] == ["  - larger textures or more", "    (--size 32)"]


def test_a_title_wraps_at_the_terminal_and_not_at_its_table(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "40")
    table = plain_table("Errors of the fits, and what they cost on this machine")
    add_figures(table, "n")
    table.add_row("1")
    Screen(as_json=False, quiet=False).show(table)
    said = [line.rstrip() for line in capsys.readouterr().out.splitlines()]
    assert said[:2] == ["Errors of the fits, and what they cost", "on this machine"]
    assert table.title is not None


def test_figures_of_several_seeds_are_whole_in_80_columns() -> None:
    means, deviations = (
        [1.23e-5, 0.000567, 2170.0, 0.00995, 98765.0, 12.3],
        [9.14e-5, 0.000394, 199.2, 1.2e-6, 98765.0, 0],
    )
    error = dict(zip(SIX, means, strict=True))
    spread = {name: {"standard_deviation": each} for name, each in zip(SIX, deviations, strict=True)}
    record = {
        "seeds": [0, 1], "splits": [0], "epsilon": 0.01, "error": {"held_out": error, "train": error},
        "spread": {"error": {"held_out": spread, "train": spread}},
    }  # fmt: skip
    out = io.StringIO()
    Console(file=out, width=80).print(error_table({"gaussians": record}))
    shown = out.getvalue()
    assert "…" not in shown
    assert max(map(len, shown.splitlines())) <= 80
    assert shown.split().count("gaussians") == 1
    for words in (
        "held out",
        "training",
        "1.2e-05",
        "98765",
        "±9.1e-05",
        "±0.00039",
        "±199",
        "±1.2e-06",
        "±98765",
        "±0",
    ):
        assert words in shown, words
