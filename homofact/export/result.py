"""The folder of a result: factorization.npz, manifest.json, the textures, pictures, report.json.

It is built as a hidden sibling and renamed into place when everything is there. An older result is moved
aside only then, put back if the renaming fails, and deleted last: at no moment is its place held by half
a result.
"""

import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

from homofact.baselines.separable import FORMAT as SEPARABLE
from homofact.baselines.separable import Separable, read_archive
from homofact.errors import BadInput
from homofact.export.images import write_textures
from homofact.export.manifest import manifest, write_json
from homofact.export.separable_files import separable_manifest, write_separable_textures
from homofact.factor.factorization import Factorization
from homofact.factor.fitted import Fitted

FACTORIZATION = "factorization.npz"
MANIFEST = "manifest.json"
REPORT = "report.json"


def check_result_folder(folder: str | os.PathLike[str], force: bool) -> None:
    """Raise BadInput where `write_result` could not put a result: ask before a long fit, not after it.

    An empty folder may be used. A folder that holds anything else than a result is refused even by
    force, which would delete it.
    """
    target = Path(folder).resolve()
    if target.is_dir():
        found = sorted(entry.name for entry in target.iterdir())
        if found and FACTORIZATION not in found:
            raise BadInput(f"{folder}: found {found[0]} in it and no result, expected a new or empty folder")
        if found and not force:
            raise BadInput(f"{folder}: found an existing result, expected a new folder or --force")
    elif target.exists():
        raise BadInput(f"{folder}: found a file, expected a folder for the result")
    place = next(parent for parent in target.parents if parent.exists())
    if not place.is_dir():
        raise BadInput(f"{folder}: cannot be written ({place} is not a folder), expected a writable place")
    if not os.access(place, os.W_OK | os.X_OK):
        raise BadInput(f"{folder}: cannot be written ({place} is not writable), expected a writable place")


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
    target = Path(folder).resolve()
    partial = target.with_name(f".{target.name}.partial-{os.getpid()}")
    made = [parent for parent in target.parents if not parent.exists()]
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        partial.mkdir()
        factorization.save(partial / FACTORIZATION)
        write_json(partial / MANIFEST, _with_textures(partial, factorization))
        write_json(partial / REPORT, report)
        if pictures is not None:
            pictures(partial)
        _swap(partial, target)
    except BaseException as error:
        shutil.rmtree(partial, ignore_errors=True)
        for parent in made:
            if parent.is_dir() and not any(parent.iterdir()):
                parent.rmdir()
        if isinstance(error, OSError):
            reason = error.strerror or str(error)
            raise BadInput(f"{folder}: cannot be written ({reason}), expected a writable place") from error
        raise


def open_result(place: str | os.PathLike[str]) -> Fitted:
    """The fit of a result folder or of a saved file. Raises BadInput where there is none."""
    target = Path(place)
    if target.is_dir():
        if not (target / FACTORIZATION).is_file():
            raise BadInput(f"{target}: found no {FACTORIZATION} in the folder, expected a result of a fit")
        target = target / FACTORIZATION
    if read_archive(target)[1].get("format") == SEPARABLE:
        return Separable.load(target)
    return Factorization.load(target)


def _with_textures(folder: Path, fitted: Fitted) -> dict[str, Any]:
    """Write the textures to `folder`; the manifest that goes with them."""
    if isinstance(fitted, Separable):
        return separable_manifest(fitted, write_separable_textures(folder, fitted))
    if isinstance(fitted, Factorization):
        return manifest(fitted, write_textures(folder, fitted))
    raise BadInput(f"result: found a {type(fitted).__name__}, expected a factorization or a separable one")


def _swap(partial: Path, target: Path) -> None:
    """Rename `partial` to `target`; what was there is put back if that fails, else deleted."""
    if not target.exists():
        os.rename(partial, target)
        return
    previous = target.with_name(f".{target.name}.previous-{os.getpid()}")
    os.rename(target, previous)
    try:
        os.rename(partial, target)
    except BaseException:
        os.rename(previous, target)
        raise
    # The new result stands; an old one that cannot be deleted is left over rather than reported as a failure.
    shutil.rmtree(previous, ignore_errors=True)
