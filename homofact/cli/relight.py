"""`homofact relight`: objects under an environment map with their shadows, precomputed, rendered, and judged."""

import shutil
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table

from homofact.cli import options as o
from homofact.cli.layout import add_figures, add_names, plain_table
from homofact.cli.places import check_place
from homofact.cli.plan_relight import choice_table, plan_answer
from homofact.cli.screen import Screen
from homofact.errors import BadInput
from homofact.evaluate.wording import counted, figure

if TYPE_CHECKING:
    from homofact.scene.transport.build import RelitObject, Stand
    from homofact.scene.transport.ledger import Ledger
    from homofact.scene.transport.scene import RelightScene


def relight(
    scene: Annotated[Path, typer.Argument(metavar="SCENE.toml", help="Objects, light, cameras, what is kept.")],
    out: Annotated[Path, typer.Option(metavar="FOLDER", help="Where the relit scene goes.")],
    vertices: Annotated[
        int, typer.Option(metavar="N", help="How many vertices of an object the error is measured at; 0 is none.")
    ] = 64,
    whole: Annotated[
        bool, typer.Option("--ledger", help="Every stage of the error by itself, the cube map's too: takes minutes.")
    ] = False,
    reference: Annotated[
        bool,
        typer.Option("--reference", help="Sum every seen vertex in full, for the page to compare with."),
    ] = False,
    force: Annotated[bool, typer.Option("--force", help="Replace a relit scene that is in the folder.")] = False,
    as_json: o.AsJson = False,
    quiet: o.Quiet = False,
) -> None:
    """Precompute an object's light transport, and render it under its sky.

    Wang, Tran and Luebke 2004: in-out factors of each material, shadows
    of every vertex, Haar wavelets. A run that was stopped goes on where
    it was. `homofact view` of the folder is a page that relights it.
    """
    if vertices < 0:
        raise BadInput(f"vertices: found {vertices}, expected 0 or more")

    from homofact.files.folder import check_new_folder
    from homofact.files.kinds import RELIT
    from homofact.files.lock import claimed
    from homofact.scene.transport.build import relit, stand
    from homofact.scene.transport.ledger import dense_colours
    from homofact.scene.transport.page.skies import page_sky
    from homofact.scene.transport.picture import picture
    from homofact.scene.transport.relight import shaded
    from homofact.scene.transport.result import write_relit
    from homofact.scene.transport.scene import read_relight_scene

    check_new_folder(out, RELIT, force)
    check_place(out)
    asked = read_relight_scene(scene)
    screen = Screen(as_json, quiet)
    blocks = out.with_name(f"{out.name}.blocks")
    begun = time.perf_counter()
    with claimed(out), screen.bar() as bar:
        ready = stand(asked, bar.stage)
        for line in ready.notes:
            screen.note(f"homofact: {line}")
        plans = [each.plan for each in ready.objects if each.plan is not None]
        for line in (each.warning for each in plans if each.warning):
            screen.note(f"homofact: {line}")
        screen.note(f"homofact: {ready.cost.describe()}")
        prepared = time.perf_counter()
        objects = relit(ready, blocks, lambda name, done, count: bar.run(f"transport of {name}", done, count))
        traced = time.perf_counter()
        bar.stage("rendering")
        light = page_sky(asked.light.name, asked.light, asked.settings.cube).cube.astype(float)
        tuples = [each.tuples(light) for each in objects]
        pictures = []
        for camera in asked.cameras:
            colours = [shaded(each.transport, own, camera.eye) for each, own in zip(objects, tuples, strict=True)]
            pictures.append(picture([each.mesh for each in objects], colours, ready.occluder, camera, asked.light))
        ledgers = []
        if vertices:
            bar.stage("measuring the error")
            ledgers = _ledgers(ready, objects, vertices, whole)
        whole_sums = None
        if reference:
            bar.stage("summing every vertex in full")
            whole_sums = dense_colours(ready, light)
        record = _record(asked, objects, ledgers)
        record["seconds"] = {
            "materials": prepared - begun, "transport": traced - prepared,
            "pictures and errors": time.perf_counter() - traced,
        }  # fmt: skip
        record["notes"] = list(ready.notes)
        record["plan"] = plan_answer(plans) if plans else None
        bar.stage("writing")
        write_relit(out, asked, objects, record, pictures, force, whole_sums)
        shutil.rmtree(blocks, ignore_errors=True)
    if not quiet:
        if plans:
            screen.show(choice_table(plans, plans[0].reflected))
        screen.show(object_table(objects), *([error_table(objects, ledgers)] if ledgers else []))
    screen.note(
        f"The relit scene: {out} ({counted(len(pictures), 'picture')}); homofact view {out} relights it in a browser"
    )
    screen.answer({"folder": str(out), **record})


def _ledgers(ready: "Stand", objects: "tuple[RelitObject, ...]", vertices: int, whole: bool) -> "list[Ledger | None]":
    """The error of each object from the first camera; None where it sees none of it."""
    from homofact.scene.transport.ledger import STAGES, ledger
    from homofact.scene.transport.seen import seen_vertices

    found: list[Ledger | None] = []
    stages = STAGES if whole else ("truncation", "quantisation", "harmonics", "clusters", "together")
    for placed, each in zip(ready.objects, objects, strict=True):
        eye = ready.scene.cameras[0].eye
        try:
            seen = seen_vertices(each.mesh, placed.reflectance, ready.occluder, eye, vertices, ready.scene.seed)
        except BadInput:
            found.append(None)
            continue
        found.append(ledger(seen, each.transport, ready.scene.light, each.compact, stages))
    return found


def _record(
    asked: "RelightScene", objects: "tuple[RelitObject, ...]", ledgers: "list[Ledger | None]"
) -> dict[str, Any]:
    """What relight.json and --json say."""
    settings = asked.settings
    entries = []
    for number, each in enumerate(objects):
        made, one = each.transport, ledgers[number] if ledgers else None
        entries.append(
            {
                "mesh": each.mesh.name,
                "material": each.material,
                "vertices": made.vertices,
                "terms": made.factors.terms,
                "form": each.form,
                "map_size": made.factors.view.shape[1],
                "share_of_energy": made.factors.share,
                "expected_error_of_terms": made.factors.expected_error,
                "coefficients_per_vector": made.mean_kept,
                "bytes": each.nbytes,
                "bytes_unclustered": made.nbytes + made.factors.view.nbytes,
                "error": None if one is None else one.record(),
            }
        )
    return {
        "scene": asked.name,
        "light": asked.light.describe(),
        "cube": settings.cube,
        "rays": settings.rays,
        "kept": settings.kept if settings.tolerance is None and asked.reflected is None else None,
        "reflected": asked.reflected,
        "tolerance": settings.tolerance,
        "seed": asked.seed,
        "objects": entries,
        "bytes": sum(each.nbytes for each in objects),
        "error": {entry["mesh"]: entry["error"] for entry in entries},
    }


def object_table(objects: "tuple[RelitObject, ...]") -> Table:
    """A line an object: its size, form, terms K, numbers N a vector, and what is stored of it."""
    from homofact.scene.transport.harmonic import Harmonic

    table = plain_table()
    add_names(table)
    add_figures(table, "vertices", "form", "K", "N", "kB")
    for each in objects:
        made = each.transport
        kept = each.compact.number.shape[2] if isinstance(each.compact, Harmonic) else None
        table.add_row(
            f"{each.mesh.name}, {Path(each.material).name}",
            str(made.vertices),
            each.form,
            str(made.factors.terms),
            f"{made.mean_kept if kept is None else kept:.0f}",
            f"{each.nbytes / 1000:.0f}",
        )
    return table


def error_table(objects: "tuple[RelitObject, ...]", ledgers: "list[Ledger | None]") -> Table:
    """A line an object: relative root mean square errors of its light by stage, as seen from the first camera."""
    names = list(dict.fromkeys(name for each in ledgers if each for name in each.errors))
    table = plain_table("Relative RMS error of the light towards the first camera")
    add_names(table)
    add_figures(table, *names, "below zero")
    for each, one in zip(objects, ledgers, strict=True):
        values = ["not seen"] if one is None else [f"{figure(one.errors[name])}" for name in names]
        table.add_row(each.mesh.name, *values, *([] if one is None else [f"{one.below_zero:.2%}"]))
    return table
