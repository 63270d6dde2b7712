"""`homofact plan` of a relighting: how each object's transport is held, by the tolerance of the scene."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.table import Table
from rich.text import Text

from homofact.cli.layout import add_figures, add_names, plain_table
from homofact.cli.screen import Screen
from homofact.errors import BadInput

if TYPE_CHECKING:
    from homofact.scene.transport.plan import ObjectPlan

_SHOWN = 8


def plan_relight(scene: Path, given: Mapping[str, object], strict: bool, screen: Screen) -> None:
    """Show and answer the plan of a relighting's scene.

    Raises BadInput for options that are about fits, a scene without a tolerance and, if `strict`, a tolerance that
    cannot be met.
    """
    for name, value in given.items():
        if value:
            raise BadInput(f"--{name}: {scene} is a scene of relighting, which fits nothing; expected none")

    from homofact.scene.transport.build import stand
    from homofact.scene.transport.scene import read_relight_scene

    asked = read_relight_scene(scene)
    if asked.reflected is None:
        raise BadInput(f"{scene}: tolerance: found none, expected reflected = a relative RMS error of the light")
    with screen.bar() as bar:
        ready = stand(asked, bar.stage)
    plans = [each.plan for each in ready.objects if each.plan is not None]
    warnings = [each.warning for each in plans if each.warning]
    if strict and warnings:
        raise BadInput(warnings[0])
    for line in ready.notes:
        screen.note(f"homofact: {line}")
    screen.show(choice_table(plans, asked.reflected), *(Text(f"Warning: {line}.", "bold red") for line in warnings))
    screen.note(f"Of all objects: {sum(each.chosen.bytes for each in plans) / 1000:.0f} kB")
    screen.answer(plan_answer(plans) | {"scene": asked.name, "light": asked.light.describe()})


def plan_answer(plans: "Sequence[ObjectPlan]") -> dict[str, Any]:
    """The JSON form."""
    return {
        "reflected": plans[0].reflected,
        "objects": [each.record() for each in plans],
        "bytes": sum(each.chosen.bytes for each in plans),
        "warnings": [each.warning for each in plans if each.warning],
    }


def choice_table(plans: "Sequence[ObjectPlan]", reflected: float) -> Table:
    """Of each object the cheapest choices, the one that was made in bold.

    Form, terms K, size of the maps, numbers N a vector, bytes and the error that is expected.
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
            first = f"{plan.name}, {Path(plan.material).name}" if number == 0 else ""
            table.add_row(first, *(Text(cell, style) for cell in cells))
    return table
