"""The private folder in which files are built before they are renamed, and its cleanup after a killed run.

    .partial-XXXXXXXX/new/NAME         a folder that is being made (a file lies beside `new`)
    .partial-XXXXXXXX/previous/NAME    what was there before

A run locks its private folder. A private folder without a lock belongs to a dead run and is cleaned up. If the place of
previous/NAME is empty, previous/NAME is moved back. Otherwise only files that are not homofact's are moved back from
it. The rest is deleted.
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
    """Create a hidden folder beside `target`; delete it at the end, with homofact's files in it.

    Private folders of dead runs are cleaned up first. Raises OSError if the folder cannot be created.
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
    """Restore or delete the files that killed runs left in `parent`; skip files for which this fails."""
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
    """Move files that are not homofact's from `old` to `target`; a file whose name is taken stays in `old`."""
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
