"""The folder of a result: factorization.npz, manifest.json, the textures, pictures, report.json."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from homofact.export.exported_reader import is_export, open_exported
from homofact.export.images import write_textures
from homofact.export.manifest import manifest, write_json
from homofact.factor.fitted import Fitted
from homofact.files.archive import NAME as FACTORIZATION
from homofact.files.folder import check_new_folder, write_folder
from homofact.methods.saved import open_saved

MANIFEST = "manifest.json"
REPORT = "report.json"


def check_result_folder(folder: str | os.PathLike[str], force: bool) -> None:
    """Raise BadInput where `write_result` could not put a result: ask before a long fit, not after it.

    Refused as `files.folder.check_new_folder` says.
    """
    check_new_folder(folder, "result", FACTORIZATION, force)


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
    `check_result_folder` and for a place that turns out not to be writable; whatever else goes wrong,
    `pictures` included, passes through with the place as it was before.
    """
    check_result_folder(folder, force)

    def fill(place: Path) -> None:
        factorization.save(place / FACTORIZATION)
        write_json(place / MANIFEST, manifest(factorization, write_textures(place, factorization)))
        write_json(place / REPORT, report)
        if pictures is not None:
            pictures(place)

    write_folder(folder, fill)


def open_result(place: str | os.PathLike[str]) -> Fitted:
    """The fit of a result folder, of a saved file, or of an export's textures. Raises BadInput where there is none."""
    target = Path(place)
    if target.is_dir() and not (target / FACTORIZATION).exists() and is_export(target):
        return open_exported(target)
    return open_saved(target)
