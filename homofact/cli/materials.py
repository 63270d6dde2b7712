"""The list of the named materials, which `homofact info` prints without a source, and a picture of them all."""

from pathlib import Path

from rich.text import Text

from homofact.api.places import check_file
from homofact.cli.layout import add_names, plain_table
from homofact.cli.screen import Screen


def list_materials(drawing: Path | None, screen: Screen) -> None:
    """Print the named materials, and draw a sphere of each under a sky.

    Raises BadInput if the picture's file name does not end in .png.
    """
    if drawing is not None:
        check_file(drawing, ".png")

    from homofact.brdf.materials import MATERIALS

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
