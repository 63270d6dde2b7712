"""A prepared scene on disk: edit.npz with what editing reads, edit.json with scene and report, a picture a view.

`edit.json` holds the scene's table with paths relative to the folder, so that a folder can be moved together with what
it is made of; edit.npz tells by its digest whether meshes, materials and light are still those that it was made with.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from homofact.containers.png import write_png
from homofact.errors import BadInput
from homofact.export.manifest import write_json
from homofact.files.fields import Fields
from homofact.files.folder import check_new_folder, write_folder
from homofact.files.kinds import PREPARED
from homofact.render.sphere import SphereImage
from homofact.render.tonemap import choose_exposure, tonemap
from homofact.scene.editing.build import Built, Stage, edit_scene
from homofact.scene.editing.picture import image, radiance, starting_curves
from homofact.scene.editing.precompute import Prepared
from homofact.scene.editing.scene_file import AskedEdit, asked_of_record
from homofact.scene.editing.store import read_prepared, write_prepared

REPORT = "edit.json"
FORMAT, FORMAT_VERSION = "homofact editing scene", 1
_EXPECTED = "a scene that homofact edit prepared"


@dataclass(frozen=True)
class SavedEdit:
    """What `homofact edit` wrote: the scene as asked for and as built, what was precomputed, the report."""

    asked: AskedEdit
    built: Built
    prepared: Prepared
    report: dict[str, Any]


def write_edit(folder: Path, asked: AskedEdit, prepared: Prepared, report: dict[str, Any], force: bool = False) -> None:
    """Write the folder, whole or not at all. Raises BadInput as `files.folder.write_folder`."""
    check_new_folder(folder, PREPARED, force)
    record = {"format": FORMAT, "format_version": FORMAT_VERSION, "name": asked.name, "scene": asked.record(folder)}

    def fill(place: Path) -> None:
        write_prepared(place / PREPARED.mark, prepared, asked.settings.triangles)
        write_json(place / REPORT, record | {"report": report})
        for number, pixels in enumerate(pictures(prepared)):
            write_png(place / f"picture_{number + 1}.png", pixels)

    write_folder(folder, PREPARED, fill, force)


def pictures(prepared: Prepared) -> list[np.ndarray]:
    """8-bit sRGB (H, W, 3) of every view as curves start, all at the exposure that suits the first; empty is black."""
    curves = starting_curves(prepared)
    found = [image(prepared, view, radiance(prepared, view, curves)) for view in range(len(prepared.pixels))]
    exposure = choose_exposure(SphereImage(_as_rgb(found[0][0]), found[0][1]))
    return [tonemap(SphereImage(_as_rgb(each), cover), exposure).pixels.numpy() for each, cover in found]


def _as_rgb(values: torch.Tensor) -> torch.Tensor:
    """One channel shows as grey; of others the first three."""
    return values.expand(*values.shape[:2], 3) if values.shape[2] == 1 else values[..., :3]


def open_edit(folder: Path, stage: Stage | None = None) -> SavedEdit:
    """The scene in a folder that `write_edit` wrote: materials, meshes and light are read from where they are.

    Raises BadInput where the folder is none, where they are gone, and where they are not those that it was made with.
    """
    asked, report = read_report(folder)
    built = edit_scene(asked, stage)
    return SavedEdit(asked, built, read_prepared(folder / PREPARED.mark, built.scene), report)


def read_report(folder: Path) -> tuple[AskedEdit, dict[str, Any]]:
    """(the scene, the report) of a folder, without what was precomputed. Raises BadInput as `open_edit`."""
    if not is_edit(folder):
        raise BadInput(f"{folder}: found no {PREPARED.mark} in it, expected {_EXPECTED}")
    file = folder / REPORT
    fields = Fields.read(file, _EXPECTED)
    fields.text("format", (FORMAT,))
    fields.version("format_version", FORMAT_VERSION)
    asked = asked_of_record(fields.inner("scene").found, fields.text("name"), folder, f"{file}: scene.")
    return asked, fields.inner("report").found


def is_edit(place: Path) -> bool:
    """Whether a folder is one of a prepared scene."""
    return place.is_dir() and (place / PREPARED.mark).is_file()
