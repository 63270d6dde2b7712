"""`homofact view`: one self-contained HTML file of a result, to be opened in a browser."""

from pathlib import Path
from typing import Annotated

import typer

from homofact.cli import options as o
from homofact.cli.places import check_file, check_measurement, check_result
from homofact.cli.screen import Screen, say_ending
from homofact.errors import BadInput

NAME = "view.html"


def view(
    result: o.Result,
    source: o.MadeFrom = None,
    mesh: Annotated[
        Path | None, typer.Option(metavar="FILE.obj", help="A mesh (OBJ, PLY, glTF) to show the material on.")
    ] = None,
    sky: Annotated[
        list[Path] | None, typer.Option(metavar="FILE.hdr", help="Of a relit scene: another sky. Repeatable.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE.html", help="The page. view.html in the result's folder, unless given."),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace a page that is there.")] = False,
    as_json: o.AsJson = False,
    quiet: o.Quiet = False,
) -> None:
    """Write a page that shows a result: draggable light and camera.

    One HTML file without network, drawn by WebGL 2: the fit, McCool's
    projections of the same size, and the source side by side on a sphere
    or a mesh, their differences, the textures, and the held-out errors.

    Of a relit scene (homofact relight): the objects with their shadows,
    turned and relit by built-in skies, --sky, or a dropped .hdr file.

    Of a prepared scene (homofact edit): its pictures with curves to drag.
    """
    from homofact.scene.editing.result import is_edit
    from homofact.scene.transport.result import is_relit

    target = place_of(result) if out is None else out
    check_page(target, force)
    if is_relit(result):
        _view_relit(result, target, sky or [], force, Screen(as_json, quiet), given={"source": source, "mesh": mesh})
        return
    if is_edit(result):
        given = {"source": source, "mesh": mesh, "sky": sky or None}
        _view_edit(result, target, force, Screen(as_json, quiet), given)
        return
    if sky:
        raise BadInput(f"sky: {result} is no relit scene, expected one that homofact relight wrote")
    check_result(result)
    if source is not None:
        check_measurement(source)

    from homofact.export.result import open_result
    from homofact.meshes.mesh import read_mesh
    from homofact.viewer.layers import check_shown
    from homofact.viewer.page import read_report, write_view

    screen = Screen(as_json, quiet)
    with screen.bar() as bar:
        bar.stage("reading")
        fitted = open_result(result)
        check_shown(fitted.channels)
        shape = None if mesh is None else read_mesh(mesh)
        folder = result if result.is_dir() else result.parent
        report = read_report(folder) if result.is_dir() or result.name == "factorization.npz" else {}
        page = write_view(
            fitted, target, source, near=(folder,), report=report, mesh=shape, stage=bar.stage, new=not force
        )
    for label, ending in page.reports.items():
        say_ending(screen, ending, label)
    if page.caution:
        remedy = "; --source names it" if page.record["source"] is None else ": see the page's notes"
        screen.note(f"homofact: {page.caution}{remedy}")
    if not quiet:
        pictures = " | ".join(page.titles)
        screen.show(f"The page: {page.file} ({page.size / 1000:.0f} kB): {pictures}")
    screen.answer({"result": str(result), **page.record})


def _view_relit(
    result: Path, target: Path, skies: list[Path], force: bool, screen: Screen, given: dict[str, object]
) -> None:
    """The page of a relit scene."""
    for name, value in given.items():
        if value is not None:
            raise BadInput(f"{name}: {result} is a relit scene, which has its own; expected none")

    from homofact.render.environment import read_environment
    from homofact.scene.transport.page.relit_page import write_relit_page
    from homofact.scene.transport.result import open_relit

    with screen.bar() as bar:
        bar.stage("reading")
        saved = open_relit(result)
        others = [read_environment(each) for each in skies]
        bar.stage("writing the page")
        size = write_relit_page(target, saved, others, new=not force)
    if not screen.quiet:
        screen.show(f"The page: {target} ({size / 1e6:.1f} MB): {len(saved.objects)} objects")
    screen.answer({"result": str(result), "file": str(target), "bytes": size})


def _view_edit(result: Path, target: Path, force: bool, screen: Screen, given: dict[str, object]) -> None:
    """The page of a scene whose materials are edited."""
    for name, value in given.items():
        if value is not None:
            raise BadInput(f"{name}: {result} is a prepared scene, which has its own; expected none")

    from homofact.scene.editing.page.edit_page import write_saved_page
    from homofact.scene.editing.result import open_edit

    with screen.bar() as bar:
        bar.stage("reading")
        saved = open_edit(result, bar.stage)
        size = write_saved_page(target, saved, stage=bar.stage, new=not force)
    things, views = len(saved.prepared.scene.things), len(saved.prepared.pixels)
    words = f"{things} material{'s' * (things > 1)}, {views} view{'s' * (views > 1)}"
    screen.show(f"The page: {target} ({size / 1e6:.1f} MB): {words}")
    screen.answer({"result": str(result), "file": str(target), "bytes": size})


def place_of(result: Path) -> Path:
    """Where the page of a result goes unless it is said: view.html in its folder, or beside an .npz under its name."""
    return result / NAME if result.is_dir() else result.with_suffix(".html")


def check_page(target: Path, force: bool) -> None:
    """Refuse a page's place before anything is computed. Raises BadInput."""
    check_file(target, ".html", ".htm")
    if target.exists() and not force:
        raise BadInput(f"{target}: found an existing file, expected a new name or --force")
