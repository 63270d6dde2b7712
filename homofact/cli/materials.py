"""`homofact materials`: the named materials, and a picture of them all."""

from pathlib import Path
from typing import Annotated

import typer
from rich.text import Text

from homofact.api.places import check_file
from homofact.cli import options as o
from homofact.cli.layout import add_names, plain_table
from homofact.cli.screen import Screen


def materials(
    drawing: Annotated[
        Path | None, typer.Option("--plot", metavar="FILE.png", help="Draw a sphere of each material under a sky.")
    ] = None,
    as_json: o.AsJson = False,
    quiet: o.Quiet = False,
) -> None:
    """List the named materials that you can use as SOURCE: material:NAME."""
    if drawing is not None:
        check_file(drawing, ".png")

    from homofact.brdf.materials import MATERIALS

    screen = Screen(as_json, quiet)
    if drawing is not None:
        from homofact.figures.material_sheet import material_sheet

        with screen.bar() as bar:
            bar.stage("drawing")
            drawing.parent.mkdir(parents=True, exist_ok=True)
            material_sheet(drawing, [(each.name, each.model) for each in MATERIALS.values()])
    table = plain_table()
    add_names(table, "material:", longest=max(map(len, MATERIALS)))
    for heading in ("model", "numbers from"):
        table.add_column(heading, overflow="fold")
    for each in MATERIALS.values():
        table.add_row(Text(each.name), Text(type(each.model).__name__), Text(each.source))
    screen.show(table)
    if drawing is not None:
        screen.show(f"The picture: {drawing}")
    screen.answer(
        {
            "materials": [
                {"name": each.name, "model": type(each.model).__name__, "source": each.source}
                for each in MATERIALS.values()
            ],
            "plot": None if drawing is None else str(drawing),
        }
    )
