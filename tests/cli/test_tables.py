"""Tables in 80 columns: no name is squeezed out, no word is cut."""

from typing import Any

import pytest
from rich.console import Console

from homofact.cli.tables import chart_endings, chart_grades, chart_table, cost_table
from homofact.evaluation.chart_ledger import series_name


def record(shapes: list[tuple[int, int]], status: str) -> dict[str, Any]:
    return {
        "shapes": shapes, "bytes": 6120, "fetches": 4, "evaluations": 1230.0, "seconds": {"fit": 12.3, "total": 14.5},
        "status": status,
    }  # fmt: skip


@pytest.mark.parametrize("name", ["cole", "vch_golden_yellow_rgb, thorough"])
def test_costs_keep_names_and_words_beside_textures_of_many_sizes(name: str) -> None:
    records = {
        "mccool": record([(17, 15)] * 2, "converged"),
        name: record([(13, 13), (19, 9), (13, 13)], "converged, budget"),
    }
    console = Console(width=80)
    with console.capture() as capture:
        console.print(cost_table(records))
    lines = capture.get().splitlines()
    assert max(map(len, lines)) <= 80
    text = capture.get()
    assert "…" not in text
    for word in ("mccool", "2 × 17×15", "13×13", "19×9", "converged", "budget", *([name] if len(name) <= 10 else ())):
        assert word in text
    # A long name is broken, and all of it is there.
    starts = "".join(line[:12].strip() for line in lines).replace(" ", "")
    assert name.replace(" ", "") in starts or name in text


def point(label: str, search: str, textures: int, size: int, opinion: float | None = 4.2) -> dict[str, Any]:
    return {
        "label": label, "search": search, "textures": textures, "size": size,
        "appearance": None if opinion is None else {"opinion": opinion},
    }  # fmt: skip


@pytest.mark.parametrize(
    ("searches", "names"),
    [
        (("gradient", "gradient"), ["ggx", "cole, 2 × 16²", "cole, 3 × 16²"]),
        (("gradient", "nlopt"), ["ggx", "cole, 2 × 16²", "cole (nlopt), 3 × 16²"]),
    ],
)
def test_grades_name_textures_only_of_fits_that_have_them(searches: tuple[str, str], names: list[str]) -> None:
    fits = [point("cole", search, count, 16) for count, search in zip((2, 3), searches, strict=True)]
    (table,) = chart_grades([point("ggx", "", 0, 0), *fits])
    assert [str(cell) for cell in table.columns[0].cells] == names


def test_a_chart_names_a_search_alike_in_table_series_and_grades() -> None:
    searches = ("gradient", "powell")
    run: dict[str, Any] = {"error": {"held_out": {"log_mse": 0.1}}, "bytes": 3072, "fetches": 1}
    records = [point("search", each, 1, 16) | run | {"seconds": {"fit": 1}, "status": "converged"} for each in searches]
    shown = [str(cell) for cell in chart_table("", records, None, [None] * len(records)).columns[0].cells]
    assert shown == [series_name("search", each) for each in searches] == ["search", "search (powell)"]
    (grades,) = chart_grades(records)
    assert [str(cell) for cell in grades.columns[0].cells] == ["search, 1 × 16²", "search (powell), 1 × 16²"]


def test_fits_of_a_chart_that_did_not_converge_are_named_below_it() -> None:
    usual = [
        point("search", "gradient", 1, 16) | {"status": "converged"},
        point("ggx", "", 0, 0) | {"status": "direct"},
    ]
    assert chart_endings(usual) == []
    odd = [point("ggx", "", 0, 0) | {"status": "converged, budget"}, point("cole", "", 2, 16) | {"status": "budget"}]
    (line,) = chart_endings([*usual, *odd])
    assert line.endswith("ggx: converged, budget; cole 2 × 16²: budget.")


def test_points_without_a_grade_make_no_table() -> None:
    assert chart_grades([point("ggx", "", 0, 0, None)]) == []
