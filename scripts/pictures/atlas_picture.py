"""Draw the picture of the atlas again from its table, without fitting.

    python scripts/pictures/atlas_picture.py [docs/pictures/stability/atlas.csv]

`homofact research stability` fits, and writes the table and the same picture beside it. Use this after a change of the
picture alone.
"""

import argparse
import csv
import sys
from dataclasses import fields
from pathlib import Path
from typing import Any

from homofact.stability.atlas import Atlas, Plan
from homofact.stability.cells import Cell, CellOutcome
from homofact.stability.picture import draw_atlas

TABLE = Path(__file__).resolve().parents[2] / "docs" / "pictures" / "stability" / "atlas.csv"
_TEXT = ("method", "stressor", "label", "message")


def cells_of(path: Path) -> list[Cell]:
    """Return the cells of a table that `research stability` wrote."""
    with open(path, newline="", encoding="utf-8") as file:
        return [
            Cell(**{each.name: _value(each.name, row[each.name]) for each in fields(Cell)})
            for row in csv.DictReader(file)
        ]


def _value(name: str, text: str) -> Any:
    if name in _TEXT:
        return text
    if name == "outcome":
        return CellOutcome(text)
    if name == "said":
        return tuple(filter(None, text.split("; ")))
    if name == "bad":
        return text == "True"
    if name == "new":
        return int(text)
    return float(text) if text else None


def main(arguments: list[str] | None = None) -> int:
    """Draw atlas.png beside the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table", type=Path, nargs="?", default=TABLE, help="atlas.csv (%(default)s)")
    table = parser.parse_args(arguments).table
    cells = cells_of(table)
    methods, stressors = ([*dict.fromkeys(names)] for names in ([c.method for c in cells], [c.stressor for c in cells]))
    plan = Plan(tuple(methods), tuple(stressors))
    draw_atlas(table.with_suffix(".png"), Atlas(plan, tuple(cells), {}, ()), plan.settings)
    return 0


if __name__ == "__main__":
    sys.exit(main())
