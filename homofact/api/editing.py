"""Editing: precompute a scene whose materials you edit with curves, and apply an edit to textures."""

import os
import time
from collections.abc import Mapping
from contextlib import nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from homofact.api.places import check_folder, check_place
from homofact.api.progress import Progress, ProgressSteps
from homofact.api.viewing import NAME, view_edit
from homofact.errors import BadInput
from homofact.evaluation.wording import counted
from homofact.files.folder import check_new_folder
from homofact.files.kinds import PREPARED
from homofact.files.lock import claimed
from homofact.files.plain import plain
from homofact.files.reading import check_readable

if TYPE_CHECKING:
    from homofact.editing.curves import Bands
    from homofact.editing.edited_fit import EditedFit
    from homofact.editing.errors import PartError
    from homofact.editing.picture import Address
    from homofact.editing.result import EditResult
    from homofact.editing.scene import PreparedScene
    from homofact.editing.scene_file import EditSceneFile
    from homofact.factor.fitted import Fitted

Place = str | os.PathLike[str]


def edit(
    scene: Place,
    *,
    to: Place | None = None,
    page: bool = False,
    force: bool = False,
    progress: Progress | None = None,
) -> "EditResult":
    """Precompute a scene under its light, so that you can edit its materials with curves.

    Parameters
    ----------
    scene : path
        A scene file in TOML, or the folder of a prepared scene, which is then opened.
    to : path, optional
        The folder of the prepared scene, which `homofact view` shows. Nothing is written unless it is given.
    page : bool, optional
        Also write the folder's page, view.html, on which you drag the curves in a browser.
    force : bool, optional
        Replace a prepared scene that is in the folder.
    progress : callable, optional
        Called with a `ProgressStep` on the way.

    Returns
    -------
    EditResult
        The precomputed scene. Its `session` sets curves and renders pictures; its `report` contains the errors.

    Raises
    ------
    BadInput
        For files that cannot be read, materials without curves, and a folder that already contains files.
    MissingDependency
        Without Embree (the extra `relight`).

    Examples
    --------
    >>> from pathlib import Path
    >>> _ = Path("ball.toml").write_text('''
    ... edit = {triangles = 40}
    ... lighting = {named = "studio"}
    ... [[object]]
    ... mesh = "shape:sphere"
    ... material = "material:cook-torrance-plastic"
    ... bands = [32, 32]
    ... [[camera]]
    ... eye = [0, 0.5, 4]
    ... pixels = [16, 12]
    ... ''')
    >>> session = homofact.edit("ball.toml").session()
    >>> session.slide(("cook-torrance-plastic", "specular", "distribution"), sigma=0.05)
    >>> session.picture(0).shape[1]
    3
    """
    place = Path(scene)
    folder = None if to is None else Path(to)
    if page and folder is None:
        raise BadInput("given without a folder", where="page", expected="`to`, the folder that it is part of")
    if folder is not None:
        check_new_folder(folder, PREPARED, force)
        check_place(folder)

    from homofact.editing.result import open_edit
    from homofact.editing.scene_file import read_edit_scene

    steps = ProgressSteps(progress)
    if PREPARED.is_at(place):
        if folder is not None:
            raise BadInput("is a prepared scene already", where=scene, expected="a scene in TOML, or curves to apply")
        return open_edit(place, steps.stage)
    file = read_edit_scene(place)
    with nullcontext() if folder is None else claimed(folder):
        result = _prepared(file, steps)
        if folder is not None:
            steps.stage("writing")
            result.save(folder, force)
            if page:
                view_edit(folder, folder / NAME, True, steps)
    return result


# Of the tolerance: an error up to this is the tolerance, rounded.
_ROUNDED = 1.01


@dataclass(frozen=True)
class EditedTextures:
    """Textures of an edited material.

    Attributes
    ----------
    material : str
        The material's name in the scene.
    result : EditedFit
        The fit with the edit applied, and its error against the edited material.
    report : dict
        The JSON form, as in the folder's report.json.
    folder : Path or None
        The result's folder, where one was written.
    warning : str
        The angle at which the edited material reflects more light than it receives; "" if there is none.
    """

    material: str
    result: "EditedFit"
    report: dict[str, Any] = field(repr=False)
    folder: Path | None = None
    warning: str = ""

    @property
    def fit(self) -> "Fitted":
        """The fit with the edit in its textures."""
        return self.result.fit


def apply_curves(
    scene: Place,
    curves: "Place | Mapping[Address, Bands]",
    *,
    to: Place | None = None,
    material: str | None = None,
    way: str | None = None,
    refine: int = 1,
    force: bool = False,
    progress: Progress | None = None,
) -> EditedTextures:
    """Make textures of an edited material: apply the edit to the textures of a fit, or fit the material again.

    Parameters
    ----------
    scene : path
        A scene's file in TOML, or a prepared scene's folder.
    curves : path or mapping
        Edited curves in JSON, as the page exports them, or a session's `changed` curves.
    to : path, optional
        The folder of the result, which `load` opens. Nothing is written unless it is given.
    material : str, optional
        The name of the material, if several are edited.
    way : {"texels", "solve", "texture"}, optional
        How to apply the edit to a fit's textures. Default: "texels" if a texture depends on the edited angle, otherwise
        "solve".
    refine : int, optional
        For "texels": the number of steps into which each step between two texels is divided.
    force : bool, optional
        Replace a result that is in the folder.
    progress : callable, optional
        Called with a `ProgressStep` on the way.

    Returns
    -------
    EditedTextures
        The fit and its errors against the edited material.

    Raises
    ------
    BadInput
        For files that cannot be read, curves that change no material or several, and a folder that already contains
        files.
    """
    folder = None if to is None else Path(to)
    if isinstance(curves, str | os.PathLike):
        check_readable(curves, "edited curves in JSON")
    if folder is not None:
        check_folder(folder, force)

    from homofact.editing.build import open_edit_materials
    from homofact.editing.curves_file import read_curves
    from homofact.editing.edited_fit import chosen_material, fit_edit
    from homofact.editing.furnace import albedo_of
    from homofact.editing.result import read_report
    from homofact.editing.scene_file import read_edit_scene
    from homofact.scene.file_fits import FileFits

    place, steps = Path(scene), ProgressSteps(progress)
    with nullcontext() if folder is None else claimed(folder):
        file = read_report(place)[0] if place.is_dir() else read_edit_scene(place)
        fits = FileFits(place if place.is_dir() else None, progress=steps)
        materials = open_edit_materials(file, steps.stage, fits)
        if isinstance(curves, str | os.PathLike):
            given = read_curves(curves, [own.material for own in materials])
            try:
                chosen, changed = chosen_material(materials, given, material)
            except BadInput as error:
                raise error.at(curves) from error
        else:
            chosen, changed = chosen_material(materials, curves, material)
        name = chosen.material.name
        steps.stage(f"textures of {name}")
        made = fit_edit(chosen, changed, way, refine, steps)
        warning = albedo_of(made.fit).warning() or ""
        report = plain(_textures_report(name, chosen.opened.words, made) | {"warning": warning})
        if folder is not None:
            steps.stage("drawing and writing")
            _write_textures(folder, name, made, report, force)
    return EditedTextures(name, made, report, folder, warning)


def _prepared(file: "EditSceneFile", steps: ProgressSteps) -> "EditResult":
    """Open and precompute a scene, and measure its errors."""
    from homofact.editing.build import open_edit_scene
    from homofact.editing.errors import light_error, rank_errors
    from homofact.editing.precompute import prepare
    from homofact.editing.result import EditResult
    from homofact.scene.file_fits import FileFits

    begun = time.perf_counter()
    fits = FileFits(progress=steps)
    scene = open_edit_scene(file, steps.stage, fits)
    for line in scene.notes:
        steps.note(line)
    opened = time.perf_counter()
    prepared = prepare(
        scene,
        file.settings.triangles,
        tolerance=file.settings.tolerance,
        progress=lambda share: steps.run("precomputing", min(round(100 * share), 99), 100),
    )
    done = time.perf_counter()
    steps.stage("measuring the error")
    parts, lights = rank_errors(prepared), light_error(prepared)
    above = _above_tolerance(parts, file.settings.tolerance)
    for line in above:
        steps.note(line)
    report = _report(file, prepared, parts, lights)
    report["seconds"] = {
        "materials": opened - begun, "precompute": done - opened, "errors": time.perf_counter() - done,
    }  # fmt: skip
    report["notes"] = [*scene.notes, *above]
    report["fits"] = {words: fit.record() for words, fit in fits.made.items()}
    return EditResult(file, prepared, report, parts, tuple(fits.made.values()))


def _above_tolerance(parts: "tuple[PartError, ...]", tolerance: float) -> list[str]:
    """Return a warning about parts whose low-rank error exceeds the tolerance, in a list; empty without such parts.

    Light from other surfaces may have larger errors and is ignored. So are errors that exceed the tolerance only by
    rounding.
    """
    over = [part for part in parts if not part.bounced and part.error > _ROUNDED * tolerance]
    if not over:
        return []
    worst = max(over, key=lambda part: part.error)
    more = f"; the tolerance is exceeded in {counted(len(over), 'part')}" if len(over) > 1 else ""
    return [
        f"pictures of edits may be off by {worst.error:.2%} ({worst.material}, {worst.words}; relative RMS of the worst"
        f" of several trial edits), more than the tolerance of {tolerance:.2%}: the low-rank approximation"
        f" stores {worst.rank} numbers per pixel there{more}"
    ]


def _report(
    file: "EditSceneFile", prepared: "PreparedScene", parts: "tuple[PartError, ...]", lights: dict[str, float]
) -> dict[str, Any]:
    """Return the report of a scene, as in edit.json."""
    scene = prepared.scene
    entries = [
        {
            "view": part.view, "material": part.material, "term": part.term, "pixels": part.pixels,
            "bands": list(part.bands), "rank": part.rank, "error": part.error,
            **({"bounces": 1} if part.bounced else {}),
        }
        for part in parts
    ]  # fmt: skip
    return {
        "scene": file.name,
        "light": scene.lighting.words or scene.lighting.name,
        "triangles": prepared.lights.count,
        "tolerance": file.settings.tolerance,
        "bounces": file.settings.bounces,
        "views": [
            {"name": view, "pixels": len(seen)} for view, seen in zip(scene.view_names, prepared.pixels, strict=True)
        ],
        "materials": {
            material.name: [
                {"term": term.name, "curve": slot.name, "angle": slot.angle, "bands": slot.bands,
                 "sliders": list(slot.sliders.start) if slot.sliders else []}
                for term in material.terms for slot in term.slots
            ]
            for material in scene.materials
        },
        "parts": entries,
        "bytes": prepared.nbytes,
        "error": {
            "low_rank": max((part.error for part in parts), default=0.0),
            "lights_and_bands": lights,
        },
    }  # fmt: skip


def _textures_report(name: str, words: str, made: "EditedFit") -> dict[str, Any]:
    """Return the report of the textures of an edit, as in report.json."""
    edits = [
        {
            "way": applied.way,
            "rms": applied.rms,
            "log_rms": applied.log_rms,
            "by_epsilon": applied.by_epsilon,
            "clamped": applied.clamped,
        }
        for applied in made.applied
    ]
    row = {} if made.row is None else made.row.record()
    return {
        **row,
        "material": name,
        "made_of": words,
        "way": "fitted anew" if made.row is not None else [applied.way for applied in made.applied],
        "bytes": made.fit.nbytes,
        "fetches": made.fit.fetches,
        "error": {**row.get("error", {}), "edited": made.rms, "edits": edits},
    }


def _write_textures(folder: Path, name: str, made: "EditedFit", report: dict[str, Any], force: bool) -> None:
    """Write a result's folder, with a picture of the textures beside the edited material."""
    from homofact.brdf.channels import display_of
    from homofact.exporting.result import write_result
    from homofact.figures.compare_picture import FitPanel, compare_picture

    panels = [FitPanel("textures of the edit", made.fit, [f"relative RMS {made.rms:.2%}"])]

    def draw(place: Path) -> None:
        source = (f"{name} as edited", made.edited)
        compare_picture(place / "compare.png", source, panels, to_rgb=display_of(made.fit.channels))

    write_result(folder, factorization=made.fit, report=report, pictures=draw, force=force)
