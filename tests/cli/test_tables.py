"""Tables in 80 columns: no name is squeezed out, no word is cut."""

from typing import Any

import pytest
from rich.console import Console

from homofact.cli.tables import cost_table


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
