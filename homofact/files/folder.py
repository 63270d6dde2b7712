"""A folder written whole or not at all: built as a hidden sibling and renamed into place when everything is there.

An older one is moved aside only then, put back if the renaming fails, and deleted last: at no moment is its place
held by half of anything.
"""

import os
import shutil
import stat
from collections.abc import Callable
from pathlib import Path

from homofact.errors import BadInput
from homofact.files.atomic import flush, private_folder, real_place, unwritable_refused


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

    A symbolic link is followed, and the permissions of an older folder are kept. Raises BadInput for a place that turns
    out not to be writable; whatever else goes wrong passes through with the place as it was before.
    """
    with unwritable_refused(folder):
        target = real_place(folder)
        made = [parent for parent in target.parents if not parent.exists()]
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            with private_folder(target) as beside:
                new = beside / "new"
                new.mkdir()
                fill(new)
                for place in (*new.rglob("*"), new):
                    flush(place)
                # Outside of `beside`, so that it outlives a failure to put it back.
                _swap(new, target, beside.with_name(beside.name.replace("partial", "previous")))
        except BaseException:
            for parent in made:
                if parent.is_dir() and not any(parent.iterdir()):
                    parent.rmdir()
            raise
        flush(target.parent)


def _swap(new: Path, target: Path, previous: Path) -> None:
    """Rename `new` to `target`; what was there goes to `previous`, is put back if that fails, else deleted."""
    if not target.exists():
        os.rename(new, target)
        return
    new.chmod(stat.S_IMODE(target.stat().st_mode))
    os.rename(target, previous)
    try:
        os.rename(new, target)
    except BaseException:
        os.rename(previous, target)
        raise
    # The new one stands; an old one that cannot be deleted is left over rather than reported as a failure.
    shutil.rmtree(previous, ignore_errors=True)
