"""The folder of a result: factorization.npz, manifest.json, the textures, pictures, report.json.

Reading a result back does not load torch.
"""

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from homofact.exporting.exported_reader import MANIFEST, is_export, open_exported
from homofact.factor.fitted import Fitted
from homofact.files.archive import read_added_record, saved_file
from homofact.files.folder import check_new_folder, kept, write_folder
from homofact.files.kinds import FACTORIZATION, RESULT
from homofact.methods.saved import open_saved

REPORT = "report.json"


def write_result(
    folder: str | os.PathLike[str],
    *,
    factorization: Fitted,
    report: dict[str, Any],
    pictures: Callable[[Path], None] | None = None,
    force: bool = False,
) -> None:
    """Write the whole result to `folder`, or nothing.

    `pictures` is called with the folder under construction and adds its files to it. Raises BadInput as
    `files.folder.check_new_folder` and `write_folder`. Other exceptions, including those of `pictures`, are passed on,
    and an existing folder stays unchanged. If an error other than an interrupt occurs after the fit is saved, the fit
    alone is kept beside `folder`, and the error gives its path.
    """
    from homofact.exporting.images import write_textures
    from homofact.exporting.manifest import manifest, write_json

    check_new_folder(folder, RESULT, force)

    def fill(place: Path) -> None:
        factorization.save(place / FACTORIZATION)
        # The search's work: it outlives a picture that cannot be drawn and a full disk.
        with kept(place / FACTORIZATION, folder, "the fit alone", ".npz"):
            write_json(place / MANIFEST, manifest(factorization, write_textures(place, factorization)))
            write_json(place / REPORT, report)
            if pictures is not None:
                pictures(place)

    write_folder(folder, RESULT, fill, force)


def open_result(place: str | os.PathLike[str]) -> Fitted:
    """Return the fit of a result folder, of a saved file, or of an export's textures.

    Raises BadInput if there is no fit.
    """
    found = saved_file(place, MANIFEST)
    if found.name == MANIFEST and is_export(found.parent):
        return open_exported(found.parent)
    return open_saved(place)


def read_record(place: str | os.PathLike[str]) -> dict[str, Any]:
    """Return the record of a fit, given by its folder or file; empty if no record can be read.

    The record of a folder is its report.json. For FOLDER/factorization.npz, report.json takes precedence over the
    record in the file. Any other file contains its own record.
    """
    path = Path(place)
    if path.name != FACTORIZATION and path.is_file():
        return read_added_record(path)
    folder = path.parent if path.name == FACTORIZATION else path
    try:
        found = json.loads((folder / REPORT).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return read_added_record(path) if path.is_file() else {}
    return found if isinstance(found, dict) else {}
