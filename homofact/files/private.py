"""The private folder in which something is made before it gets its name, and what a killed run left of one.

    .partial-XXXXXXXX/new/NAME         a folder that is being made (a file lies beside `new`)
    .partial-XXXXXXXX/previous/NAME    what was there before

A private folder is locked by who works in it. One whose lock is free is a dead run's: what was there before goes back
where its place is empty, what in it is not homofact's goes back in any case, and the rest is deleted.
"""

import contextlib
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

from homofact.files.kinds import is_ours
from homofact.files.lock import lock

_PREFIX = ".partial-"
NEW, PREVIOUS = "new", "previous"
_FLAGS = os.O_RDONLY | getattr(os, "O_DIRECTORY", 0)


@contextlib.contextmanager
def private_folder(target: Path) -> Iterator[Path]:
    """Return a new hidden folder on the file system of `target`, gone at the end with all that is homofact's in it.

    What dead runs left beside it is cleaned first. Raises OSError where none can be made.
    """
    clean(target.parent)
    folder, handle = _new(target.parent)
    try:
        yield folder
    finally:
        _empty(folder)
        if handle is not None:
            os.close(handle)


def clean(parent: Path) -> None:
    """Put back or delete what runs that were killed have left in `parent`; whatever cannot be is left."""
    with contextlib.suppress(OSError):
        for folder in [each for each in parent.iterdir() if each.name.startswith(_PREFIX)]:
            if hasattr(os, "geteuid") and folder.lstat().st_uid != os.geteuid():
                continue
            try:
                handle = lock(folder, _FLAGS)
            except (NotImplementedError, OSError):
                continue
            if handle is not None:
                _empty(folder)
                os.close(handle)


def give_back(old: Path, target: Path) -> None:
    """Move what is not homofact's from a folder that was replaced to the new one; what is in the way stays in `old`."""
    for entry in list(old.iterdir()):
        place = target / entry.name
        if is_ours(entry):
            continue
        if not os.path.lexists(place):
            with contextlib.suppress(OSError):
                os.rename(entry, place)
        elif entry.is_dir() and place.is_dir() and not entry.is_symlink():
            give_back(entry, place)


def _new(parent: Path) -> tuple[Path, int | None]:
    """A folder and the handle that locks it, None where there are no locks."""
    while True:
        folder = Path(tempfile.mkdtemp(prefix=_PREFIX, dir=parent))
        try:
            handle = lock(folder, _FLAGS)
        except NotImplementedError:
            return folder, None
        # None: it was cleaned away before it was locked.
        if handle is not None:
            return folder, handle


def _empty(folder: Path) -> None:
    """Put back what was there before, and delete the rest with the folder; what is not ours and has no place stays."""
    with contextlib.suppress(OSError):
        previous = folder / PREVIOUS
        for old in list(previous.iterdir()) if previous.is_dir() else ():
            target = folder.parent / old.name
            if not os.path.lexists(target):
                os.rename(old, target)
                continue
            if target.is_dir():
                give_back(old, target)
            if not all(map(is_ours, old.iterdir())):
                return
        shutil.rmtree(folder, ignore_errors=True)
