"""A folder written whole or not at all: built as a hidden sibling and renamed into place when everything is there.

An older one is moved aside only then, put back if the renaming fails, and deleted last: at no moment is its place
held by half of anything.
"""

import os
import shutil
from collections.abc import Callable
from pathlib import Path

from homofact.errors import BadInput


def check_new_folder(folder: str | os.PathLike[str], what: str, mark: str, force: bool) -> None:
    """Raise BadInput where `write_folder` could not put a `what` ("result"): ask before long work, not after it.

    An empty folder may be used. One that holds the file `mark` is such a folder, which only `force` replaces; one
    that holds anything else is refused even by force, which would delete it.
    """
    target = Path(folder).resolve()
    if target.is_dir():
        found = sorted(entry.name for entry in target.iterdir())
        if found and mark not in found:
            raise BadInput(f"{folder}: found {found[0]} in it and no {what}, expected a new or empty folder")
        if found and not force:
            raise BadInput(f"{folder}: found an existing {what}, expected a new folder or --force")
    elif target.exists():
        raise BadInput(f"{folder}: found a file, expected a folder for the {what}")
    place = next(parent for parent in target.parents if parent.exists())
    if not place.is_dir():
        raise BadInput(f"{folder}: cannot be written ({place} is not a folder), expected a writable place")
    if not os.access(place, os.W_OK | os.X_OK):
        raise BadInput(f"{folder}: cannot be written ({place} is not writable), expected a writable place")


def write_folder(folder: str | os.PathLike[str], fill: Callable[[Path], None]) -> None:
    """Let `fill` put files into a new folder beside `folder`, and rename it to that.

    Raises BadInput for a place that turns out not to be writable; whatever else goes wrong passes through with the
    place as it was before.
    """
    target = Path(folder).resolve()
    partial = target.with_name(f".{target.name}.partial-{os.getpid()}")
    made = [parent for parent in target.parents if not parent.exists()]
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        partial.mkdir()
        fill(partial)
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
    # The new one stands; an old one that cannot be deleted is left over rather than reported as a failure.
    shutil.rmtree(previous, ignore_errors=True)
