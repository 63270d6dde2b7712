"""`homofact edit`: a scene whose materials are edited under its light, and an edit taken back into textures."""

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich import box
from rich.table import Table

from homofact.cli import options as o
from homofact.cli.places import check_place
from homofact.cli.screen import Screen
from homofact.evaluate.wording import figure

if TYPE_CHECKING:
    from homofact.scene.editing.errors import PartError
    from homofact.scene.editing.precompute import Prepared
    from homofact.scene.editing.scene_file import AskedEdit


def edit(
    scene: Annotated[Path, typer.Argument(metavar="SCENE.toml", help="Objects, light, cameras, what is edited.")],
    out: Annotated[Path, typer.Option(metavar="FOLDER", help="Where the prepared scene goes.")],
    force: Annotated[bool, typer.Option("--force", help="Replace what is in the folder.")] = False,
    as_json: o.AsJson = False,
    quiet: o.Quiet = False,
) -> None:
    """Precompute a scene whose materials are edited under its light.

    Ben-Artzi, Overbeck and Ramamoorthi 2006: light of fixed views as a
    linear function of curves over angles of the materials, with shadows.
    `homofact view` of the folder is a page with curves to drag.
    """
    from homofact.files.folder import check_new_folder
    from homofact.files.kinds import PREPARED
    from homofact.files.lock import claimed
    from homofact.scene.editing.build import edit_scene
    from homofact.scene.editing.errors import light_error, rank_errors
    from homofact.scene.editing.precompute import prepare
    from homofact.scene.editing.result import write_edit
    from homofact.scene.editing.scene_file import read_edit_scene

    check_new_folder(out, PREPARED, force)
    check_place(out)
    asked = read_edit_scene(scene)
    screen = Screen(as_json, quiet)
    begun = time.perf_counter()
    with claimed(out), screen.bar() as bar:
        built = edit_scene(asked, bar.stage)
        for line in built.notes:
            screen.note(f"homofact: {line}")
        opened = time.perf_counter()
        settings = asked.settings
        prepared = prepare(
            built.scene,
            settings.triangles,
            tolerance=settings.tolerance,
            progress=lambda share: bar.run("precomputing", round(100 * share), 100),
        )
        done = time.perf_counter()
        bar.stage("measuring the error")
        parts, lights = rank_errors(prepared), light_error(prepared)
        record = _record(asked, prepared, parts, lights)
        record["seconds"] = {
            "materials": opened - begun, "precompute": done - opened, "errors": time.perf_counter() - done,
        }  # fmt: skip
        record["notes"] = list(built.notes)
        bar.stage("writing")
        write_edit(out, asked, prepared, record, force)
    screen.show(part_table(parts), light_line(record))
    screen.note(f"The prepared scene: {out} ({figure(prepared.nbytes / 1e6)} MB, {len(prepared.pixels)} pictures)")
    screen.answer({"folder": str(out), **record})


def _record(
    asked: "AskedEdit", prepared: "Prepared", parts: "tuple[PartError, ...]", lights: dict[str, float]
) -> dict[str, Any]:
    """What edit.json and --json say."""
    scene = prepared.scene
    entries = [
        {
            "view": each.view, "material": each.material, "term": each.term, "pixels": each.pixels,
            "bands": list(each.bands), "rank": each.rank, "error": each.error,
        }
        for each in parts
    ]  # fmt: skip
    return {
        "scene": asked.name,
        "light": scene.lighting.words or scene.lighting.name,
        "triangles": prepared.lights.count,
        "tolerance": asked.settings.tolerance,
        "views": [
            {"name": view.name, "pixels": len(seen)} for view, seen in zip(scene.views, prepared.pixels, strict=True)
        ],
        "materials": {
            thing.material.name: [
                {"term": term.name, "curve": slot.name, "angle": slot.angle, "bands": slot.bands,
                 "sliders": list(slot.sliders.start) if slot.sliders else []}
                for term in thing.material.terms for slot in term.slots
            ]
            for thing in scene.things
        },
        "parts": entries,
        "bytes": prepared.nbytes,
        "error": {
            "low_rank": max((each.error for each in parts), default=0.0),
            "lights_and_bands": lights,
        },
    }  # fmt: skip


def part_table(parts: "tuple[PartError, ...]") -> Table:
    """A line a part: what is stored of it, and how far off all bands it is."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    table.add_column("", overflow="fold")
    for name in ("pixels", "bands", "rank", "low rank against all bands"):
        table.add_column(name, justify="right")
    for each in parts:
        bands = " x ".join(map(str, each.bands))
        row = (f"{each.pixels}", bands, f"{each.rank}", f"{each.error:.2%}")
        table.add_row(f"{each.view}: {each.material}: {each.term}", *row)
    return table


def light_line(record: dict[str, Any]) -> str:
    """How far off the triangles and the bands are, in each view."""
    errors = ", ".join(f"{view} {error:.2%}" for view, error in record["error"]["lights_and_bands"].items())
    return f"{record['triangles']} triangles of light and the bands, against a finer division: {errors} (relative RMS)"
