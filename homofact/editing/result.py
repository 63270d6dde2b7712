"""A prepared scene on disk: edit.npz with what editing reads, edit.json with scene and report, a picture a view.

`edit.json` contains the scene's table with paths relative to the folder, so that the folder can be moved together with
its sources. A digest in edit.npz detects changes of meshes, materials and light.
"""

import os
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from homofact.editing.build import open_edit_scene
from homofact.editing.errors import PartError
from homofact.editing.scene import PreparedScene
from homofact.editing.scene_file import EditSceneFile, scene_of_record
from homofact.editing.session import Session
from homofact.editing.shown import shown_pictures
from homofact.editing.store import read_prepared, write_prepared
from homofact.errors import BadInput
from homofact.files.fields import Fields
from homofact.files.kinds import PREPARED
from homofact.scene.file_fits import FileFit, FileFits
from homofact.scene.folders import report_name, write_scene_folder
from homofact.scene.materials import Stage

REPORT = report_name(PREPARED)
FORMAT, FORMAT_VERSION = "homofact editing scene", 1
_EXPECTED = "a scene that homofact edit prepared"


@dataclass(frozen=True)
class EditResult:
    """A scene whose materials are edited: what was precomputed, and how far off it is.

    Attributes
    ----------
    file : EditSceneFile
        The scene as its file says.
    prepared : PreparedScene
        The scene as it was built, and its precomputed transport.
    report : dict
        The JSON form, as in the folder's edit.json.
    parts : tuple of PartError
        The low rank's error of every term in every view; none where the scene was read from its folder.
    fits : tuple of FileFit
        The fits that replace files of measurements.
    """

    file: EditSceneFile = field(repr=False)
    prepared: PreparedScene = field(repr=False)
    report: dict[str, Any] = field(repr=False)
    parts: tuple[PartError, ...] = field(default=(), repr=False)
    fits: tuple[FileFit, ...] = field(default=(), repr=False)

    def record(self) -> dict[str, Any]:
        """Return the JSON form, the report."""
        return self.report

    @property
    def notes(self) -> tuple[str, ...]:
        """Return remarks on the scene from its reading, one line each."""
        return self.prepared.scene.notes

    @property
    def nbytes(self) -> int:
        """Bytes of the transports."""
        return self.prepared.nbytes

    @cached_property
    def pictures(self) -> list[np.ndarray]:
        """8-bit sRGB (H, W, 3) of every view as the curves start."""
        return shown_pictures(self.prepared)

    def session(self) -> Session:
        """Begin an editing session: curves that are set, undone and kept, and the pictures that they make."""
        return Session(self.prepared)

    def save(self, folder: str | os.PathLike[str], force: bool = False) -> None:
        """Write the folder that `homofact view` shows, whole or not at all; `force` replaces one that is there.

        Raises BadInput as `files.folder.write_folder`.
        """
        target = Path(folder)

        def archive(file: Path) -> None:
            write_prepared(file, self.prepared, self.file.settings.triangles)

        record = {
            "format": FORMAT,
            "format_version": FORMAT_VERSION,
            "name": self.file.name,
            "scene": self.file.record(target),
            "report": self.report,
        }
        write_scene_folder(target, PREPARED, archive, record, self.pictures, self.file.cameras, force, self.fits)


def open_edit(place: Path, stage: Stage | None = None) -> EditResult:
    """Open the scene in a folder of `EditResult.save`; materials, meshes and light are read from their files.

    Raises BadInput if the folder is not such a folder, and if these files are missing or have changed.
    """
    file, report = read_report(place)
    fits = FileFits(_folder(place))
    scene = open_edit_scene(file, stage, fits)
    prepared = read_prepared(_folder(place) / PREPARED.mark, scene)
    return EditResult(file, prepared, report, fits=tuple(fits.made.values()))


def read_report(place: Path) -> tuple[EditSceneFile, dict[str, Any]]:
    """Return (scene, report) of a folder, without the precomputed transport. Raises BadInput as `open_edit`."""
    if not PREPARED.is_at(place):
        raise BadInput(where=place, found=f"no {PREPARED.mark} in it", expected=_EXPECTED)
    folder = _folder(place)
    file = folder / REPORT
    fields = Fields.read(file, _EXPECTED)
    fields.text("format", (FORMAT,))
    fields.version("format_version", FORMAT_VERSION)
    scene = scene_of_record(fields.inner("scene").found, fields.text("name"), folder, f"{file}: scene.")
    return scene, _report(fields.inner("report"))


def _report(fields: Fields) -> dict[str, Any]:
    """Return the report after checking the errors that the page shows. Raises BadInput."""
    if "error" in fields.found:
        errors = fields.inner("error")
        if "lights_and_bands" in errors.found:
            views = errors.inner("lights_and_bands")
            for name in views.found:
                views.number(name)
    return fields.found


def _folder(place: Path) -> Path:
    return place if place.is_dir() else place.parent
