"""`homofact edit`: a scene whose materials are edited under its light, and an edit taken back into textures."""

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table

from homofact.cli import options as o
from homofact.cli.layout import add_figures, add_names, plain_table
from homofact.cli.places import check_folder, check_place
from homofact.cli.screen import Screen, plain, say_ending
from homofact.errors import BadInput
from homofact.evaluate.wording import counted, figure
from homofact.files.reading import check_readable

# Relative RMS above which a better way is named.
MUCH = 0.01

if TYPE_CHECKING:
    from homofact.scene.editing.errors import PartError
    from homofact.scene.editing.precompute import Prepared
    from homofact.scene.editing.scene_file import AskedEdit
    from homofact.scene.editing.take_back import TakenBack


def edit(
    scene: Annotated[
        Path, typer.Argument(metavar="SCENE", help="A scene in TOML; with --apply also a prepared scene's folder.")
    ],
    out: Annotated[Path, typer.Option(metavar="FOLDER", help="Where the prepared scene goes, or the edited fit.")],
    apply: Annotated[
        Path | None,
        typer.Option(metavar="CURVES.json", help="Edited curves, as the page exports them: make textures of them."),
    ] = None,
    material: Annotated[
        str | None, typer.Option(metavar="NAME", help="With --apply: which material, where several are edited.")
    ] = None,
    way: Annotated[
        str | None,
        typer.Option(
            metavar="WAY",
            help="With --apply, of a fit: texels, solve or texture (docs/editing.md); what suits its textures unless"
            " given.",
        ),
    ] = None,
    refine: Annotated[
        int, typer.Option(metavar="N", help="With --apply and texels: steps that one between two texels becomes.")
    ] = 1,
    force: Annotated[bool, typer.Option("--force", help="Replace what is in the folder.")] = False,
    as_json: o.AsJson = False,
    quiet: o.Quiet = False,
) -> None:
    """Precompute a scene whose materials are edited under its light.

    Ben-Artzi, Overbeck and Ramamoorthi 2006: what fixed views see as a
    linear function of curves over angles of the materials, with shadows.
    `homofact view` of the folder is a page with curves to drag.

    With --apply, curves of a material become textures with their shader:
    taken into those of a fit, or fitted anew where it is none.
    """
    screen = Screen(as_json, quiet)
    if apply is not None:
        _apply(scene, apply, out, material, way, refine, force, screen)
        return
    for option, given in (("material", material), ("way", way), ("refine", None if refine == 1 else refine)):
        if given is not None:
            raise BadInput(f"{option}: found {given} without --apply, expected it with --apply CURVES.json")
    _prepare(scene, out, force, screen)


def _prepare(scene: Path, out: Path, force: bool, screen: Screen) -> None:
    """Precompute a scene into a folder."""
    from homofact.files.folder import check_new_folder
    from homofact.files.kinds import PREPARED
    from homofact.files.lock import claimed
    from homofact.scene.editing.build import edit_scene
    from homofact.scene.editing.errors import light_error, rank_errors
    from homofact.scene.editing.precompute import prepare
    from homofact.scene.editing.result import is_edit, write_edit
    from homofact.scene.editing.scene_file import read_edit_scene

    check_new_folder(out, PREPARED, force)
    check_place(out)
    if is_edit(scene):
        raise BadInput(f"{scene}: is a prepared scene already, expected a scene in TOML, or --apply CURVES.json")
    asked = read_edit_scene(scene)
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
    if not screen.quiet:
        screen.show(part_table(parts), light_line(record))
    screen.note(
        f"The prepared scene: {out} ({figure(prepared.nbytes / 1e6)} MB, {counted(len(prepared.pixels), 'picture')})"
    )
    screen.answer({"folder": str(out), **record})


def _apply(
    place: Path,
    file: Path,
    out: Path,
    name: str | None,
    way: str | None,
    refine: int,
    force: bool,
    screen: Screen,
) -> None:
    """Make a result's folder of an edited material."""
    check_readable(file, "edited curves in JSON")
    check_folder(out, force)

    from homofact.brdf.channels import display_of
    from homofact.export.result import write_result
    from homofact.figures.compare_picture import compare_picture
    from homofact.files.lock import claimed
    from homofact.scene.editing.build import subjects_of
    from homofact.scene.editing.curves_file import read_curves
    from homofact.scene.editing.result import read_report
    from homofact.scene.editing.scene_file import read_edit_scene
    from homofact.scene.editing.take_back import edited_material, take_back

    with claimed(out), screen.bar() as bar:
        asked = read_report(place)[0] if place.is_dir() else read_edit_scene(place)
        subjects = subjects_of(asked, bar.stage)
        curves = read_curves(file, [each.material for each in subjects])
        try:
            subject, changed = edited_material(subjects, curves, name)
        except BadInput as error:
            raise BadInput(f"{file}: {error}") from error
        bar.stage(f"textures of {subject.material.name}")
        made = take_back(subject, changed, way, refine, bar)
        record = _applied_record(subject.material.name, subject.words, made)
        bar.stage("drawing and writing")
        panels = [("textures of the edit", made.fit, [f"relative RMS {made.rms:.2%}"])]

        def draw(folder: Path) -> None:
            source = (f"{subject.material.name} as edited", made.edited)
            compare_picture(folder / "compare.png", source, panels, to_rgb=display_of(made.fit.channels))

        write_result(out, factorization=made.fit, report=plain(record), pictures=draw, force=force)
    if made.row is not None:
        say_ending(screen, made.row.report)
    elif made.rms > MUCH and "solve" in record["way"]:
        screen.note("homofact: --way texture leaves less, with one more texture and fetch")
    if not screen.quiet:
        screen.show(
            f"{subject.material.name}: {made.words()}",
            *(f"  {each.words()}" for each in made.applied),
            f"{out}: factorization.npz, manifest.json, report.json, every texture as .exr and .png",
            f"The picture: {out / 'compare.png'}",
        )
    screen.answer({"folder": str(out), **record})


def _applied_record(name: str, words: str, made: "TakenBack") -> dict[str, Any]:
    """What report.json and --json say of textures of an edit."""
    error: dict[str, Any] = {"edited": made.rms}
    error["edits"] = [
        {
            "way": each.way,
            "rms": each.rms,
            "log_rms": each.log_rms,
            "by_epsilon": each.by_epsilon,
            "clamped": each.clamped,
        }
        for each in made.applied
    ]
    found = {} if made.row is None else made.row.record()
    return {
        **found,
        "material": name,
        "made_of": words,
        "way": "fitted anew" if made.row is not None else [each.way for each in made.applied],
        "bytes": made.fit.nbytes,
        "fetches": made.fit.fetches,
        "error": {**found.get("error", {}), **error},
    }


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
    table = plain_table()
    add_names(table)
    add_figures(table, "pixels", "bands", "rank", "low rank against all bands")
    for each in parts:
        bands = " x ".join(map(str, each.bands))
        row = (f"{each.pixels}", bands, f"{each.rank}", f"{each.error:.2%}")
        table.add_row(f"{each.view}: {each.material}: {each.term}", *row)
    return table


def light_line(record: dict[str, Any]) -> str:
    """How far off the triangles and the bands are, in each view."""
    errors = ", ".join(f"{view} {error:.2%}" for view, error in record["error"]["lights_and_bands"].items())
    return f"{record['triangles']} triangles of light and the bands, against a finer division: {errors} (relative RMS)"
