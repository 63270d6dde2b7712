"""`homofact edit`: prepare a scene to edit its materials under its light, and turn an edit into textures."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table

from homofact.cli import options as o
from homofact.cli.layout import add_figures, add_names, hanging, plain_table
from homofact.cli.screen import Screen, say_ending
from homofact.errors import BadInput
from homofact.evaluation.wording import counted, figure

# Relative RMS above which a better way is named.
MUCH = 0.01

if TYPE_CHECKING:
    from homofact.api.editing import EditedTextures
    from homofact.editing.errors import PartError


def edit(
    scene: Annotated[
        Path, typer.Argument(metavar="SCENE", help="A scene in TOML; with --apply also a prepared scene's folder.")
    ],
    out: Annotated[Path, typer.Option(metavar="FOLDER", help="Folder for the prepared scene, or for the edited fit.")],
    apply: Annotated[
        Path | None,
        typer.Option(
            metavar="CURVES.json",
            help="File of edited curves that view.html exported. The command turns them into textures.",
        ),
    ] = None,
    material: Annotated[
        str | None, typer.Option(metavar="NAME", help="With --apply: the material, if several are edited.")
    ] = None,
    way: Annotated[
        str | None,
        typer.Option(
            metavar="WAY",
            help="With --apply, if the material is a fit: how to put the edit into its textures: texels, solve or"
            " texture (the documentation of editing explains them). Default: texels if a texture has the edited angle"
            " as an axis, else solve.",
        ),
    ] = None,
    refine: Annotated[
        int,
        typer.Option(
            metavar="N", help="With --apply and --way texels: divide each step between two texels into N steps."
        ),
    ] = 1,
    force: Annotated[bool, typer.Option("--force", help="Replace the contents of the folder.")] = False,
    as_json: o.AsJson = False,
    quiet: o.Quiet = False,
) -> None:
    """Precompute a scene under its light, so that you can edit its materials.

    The method is that of Ben-Artzi, Overbeck and Ramamoorthi 2006. Each material consists of curves over angles.
    For fixed cameras and light, the pictures, with shadows, are linear in these curves. Open FOLDER/view.html in a
    browser to drag the curves.
    With --apply, it turns the edited curves of a material into textures and a shader. If the material is a fit, it
    changes the fit's textures; otherwise it makes a new fit.
    """
    screen = Screen(as_json, quiet)
    if apply is None:
        for option, given in (("material", material), ("way", way), ("refine", None if refine == 1 else refine)):
            if given is not None:
                raise BadInput(where=option, found=f"{given} without --apply", expected="it with --apply CURVES.json")
        _prepare(scene, out, force, screen)
        return

    from homofact.api.editing import apply_curves

    with screen.progress() as progress:
        found = apply_curves(
            scene, apply, to=out, material=material, way=way, refine=refine, force=force, progress=progress
        )
    _show_textures(found, out, screen)


def _prepare(scene: Path, out: Path, force: bool, screen: Screen) -> None:
    from homofact.api.editing import edit as prepared
    from homofact.api.viewing import NAME

    with screen.progress() as progress:
        found = prepared(scene, to=out, page=True, force=force, progress=progress)
    if not screen.quiet:
        screen.show(part_table(found.parts), light_line(found.report))
    pictures = counted(len(found.pictures), "picture")
    size = sum(file.stat().st_size for file in out.iterdir() if file.is_file())
    stored = f"{figure(size / 1e6)} MB with its page, {pictures}"
    screen.note(f"The prepared scene: {out} ({stored}); open {out / NAME} in a browser to edit it")
    screen.answer({"folder": str(out), **found.report})


def _show_textures(found: "EditedTextures", out: Path, screen: Screen) -> None:
    made = found.result
    if found.warning:
        screen.note(f"homofact: the edited material has the {found.warning}")
    if made.row is not None:
        say_ending(screen, made.row.report)
    elif made.rms > MUCH and "solve" in found.report["way"]:
        screen.note("homofact: --way texture has a smaller error; it adds one texture and one fetch")
    if not screen.quiet:
        screen.show(
            hanging(f"{found.material}: {made.words()}", 2),
            *(hanging(f"  {applied.words()}", 4) for applied in made.applied),
            f"{out}: factorization.npz, manifest.json, report.json, every texture as .exr and .png",
            f"The picture: {out / 'compare.png'}",
        )
    screen.answer({"folder": str(out), **found.report})


def part_table(parts: "tuple[PartError, ...]") -> Table:
    """Return one line per part: its pixels, bands, rank, and the error of the low rank against all bands."""
    table = plain_table()
    add_names(table)
    add_figures(table, "pixels", "bands", "rank", "low rank against all bands")
    for part in parts:
        bands = " x ".join(map(str, part.bands))
        row = (f"{part.pixels}", bands, f"{part.rank}", f"{part.error:.2%}")
        table.add_row(f"{part.view}: {part.material}: {part.words}", *row)
    return table


def light_line(record: dict[str, Any]) -> str:
    """Return a line with the error of the triangles of light and the bands, in each view."""
    errors = ", ".join(f"{view} {error:.2%}" for view, error in record["error"]["lights_and_bands"].items())
    return (
        f"Error of dividing the light into {record['triangles']} triangles and the angles into bands: {errors}"
        " (relative RMS against a finer division)"
    )
