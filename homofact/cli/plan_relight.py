"""The table of `homofact plan` and `homofact relight`: how each object's transport is stored, by the tolerance."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rich.table import Table
from rich.text import Text

from homofact.brdf.source_names import MATERIAL_PREFIX
from homofact.cli.layout import add_figures, add_names, plain_table

if TYPE_CHECKING:
    from homofact.relighting.plan import ObjectPlan

_SHOWN = 8


def choice_table(plans: "Sequence[ObjectPlan]", reflected: float) -> Table:
    """List the cheapest choices for each object, with the selected one in bold.

    The columns are form, terms K, size of the maps, coefficients N per vector, kB, and expected error.
    """
    table = plain_table(f"Relative RMS of the light at most {reflected:g}")
    add_names(table)
    table.add_column("form", no_wrap=True)
    add_figures(table, "K", "maps", "N", "kB", "error")
    for plan in plans:
        for number, each in enumerate(plan.choices[:_SHOWN]):
            style = ("bold" if plan.met else "bold red") if each is plan.chosen else ""
            cells = (
                each.form, str(each.terms), f"{each.map_size}²", f"{each.coefficients:.0f}", f"{each.bytes / 1000:.0f}",
                f"{each.error:.2%}",
            )  # fmt: skip
            first = name_with_material(plan.name, plan.material) if number == 0 else ""
            table.add_row(first, *(Text(cell, style) for cell in cells))
    return table


def name_with_material(name: str, material: str) -> str:
    """Return the names of an object and its material; only one if a glTF part and its material have the same."""
    if material.endswith(f"#{name}"):
        return name
    return f"{name}, {Path(material.removeprefix(MATERIAL_PREFIX)).name}"
