"""Write a folder whole or not at all: build it in a private folder beside its path, then move it into place.

If the system can exchange two names in one step, an older folder is exchanged with the new one. Otherwise the older
folder is moved aside first, and moved back if the replacement fails. At last, other files than homofact's move from the
older folder to the new one, and homofact's own files are deleted.
"""

import contextlib
import errno
import os
import stat
from collections.abc import Callable, Iterator
from pathlib import Path

from homofact.errors import Advice, BadInput
from homofact.files.atomic import flush
from homofact.files.exchange import exchange
from homofact.files.kinds import FolderKind
from homofact.files.lock import claimed
from homofact.files.places import real_place, unwritable_refused
from homofact.files.private import NEW, PREVIOUS, clean, give_back, private_folder

_OCCUPIED = {errno.ENOTEMPTY, errno.EEXIST, errno.EACCES}


def check_new_folder(folder: str | os.PathLike[str], kind: FolderKind, force: bool) -> None:
    """Raise BadInput if `write_folder` cannot write a folder of this kind; call this before long work.

    An empty folder is accepted. A folder that contains the mark file of this kind is accepted only with `force`. Any
    other folder is rejected, even with `force`.
    """
    target = Path(folder).resolve()
    clean(target.parent)
    if target.is_dir():
        found = sorted(entry.name for entry in target.iterdir())
        if found and kind.mark not in found:
            raise BadInput(where=folder, found=f"{found[0]} in it and no {kind.what}", expected="a new or empty folder")
        if found and not force:
            wanted = f"a new folder or {Advice('force', True)}"
            raise BadInput(where=folder, found=f"an existing {kind.what}", expected=wanted)
        if _is_mount_point(target):
            raise BadInput("is a mount point, which cannot be replaced", where=folder, expected="a folder in it")
    elif target.exists():
        raise BadInput(where=folder, found="a file", expected=f"a folder for the {kind.what}")
    place = next(parent for parent in target.parents if parent.exists())
    if not place.is_dir():
        raise BadInput(f"cannot be written ({place} is not a folder)", where=folder, expected="a writable place")
    if not os.access(place, os.W_OK | os.X_OK):
        raise BadInput(f"cannot be written ({place} is not writable)", where=folder, expected="a writable place")


def write_folder(
    folder: str | os.PathLike[str], kind: FolderKind, fill: Callable[[Path], None], force: bool = False
) -> None:
    """Let `fill` put files into a new folder, and give it the name `folder`.

    When the new folder is complete, an existing folder is checked by `check_new_folder`. If it is rejected, it stays,
    and the new folder is kept beside it as FOLDER-new, which the BadInput names. Symbolic links are followed, and the
    permissions of an older folder are kept. Raises BadInput if the folder cannot be written, or while another process
    writes it. Other exceptions are passed on, and an existing folder stays unchanged.
    """
    with claimed(folder), unwritable_refused(folder):
        target = real_place(folder)
        with private_folder(target) as beside:
            new = beside / NEW / target.name
            new.mkdir(parents=True)
            fill(new)
            for place in (*new.rglob("*"), new):
                flush(place)
            with kept(new, folder, "what was made", "-new"):
                _put(new, target, lambda: check_new_folder(folder, kind, force))
        flush(target.parent)


def _put(new: Path, target: Path, check: Callable[[], None]) -> None:
    """Give `new` its name; `check` raises where what is there may not be replaced."""
    if target.is_dir():
        new.chmod(stat.S_IMODE(target.stat().st_mode))
    try:
        # Where nothing is there, or an empty folder.
        os.rename(new, target)
        return
    except OSError as error:
        if error.errno not in _OCCUPIED or not target.is_dir():
            raise
    check()
    previous = new.parents[1] / PREVIOUS / target.name
    previous.parent.mkdir()
    # Under that name, so that a run that dies after the exchange leaves the older folder where it is looked for.
    os.rename(new, previous)
    try:
        exchanged = exchange(previous, target)
    except BaseException:
        os.rename(previous, new)
        raise
    if not exchanged:
        os.rename(previous, new)
        os.rename(target, previous)
        try:
            os.rename(new, target)
        except BaseException:
            os.rename(previous, target)
            raise
    give_back(previous, target)


@contextlib.contextmanager
def kept(made: Path, folder: str | os.PathLike[str], what: str, ending: str) -> Iterator[None]:
    """If the block fails, move `made` beside `folder` under a similar free name, which the error names.

    An OSError is raised as BadInput. After an interrupt nothing is kept.
    """
    try:
        with unwritable_refused(folder):
            yield
    except Exception as error:
        place = Path(folder)
        free = place.with_name(f"{place.name}{ending}")
        number = 0
        while os.path.lexists(free):
            number += 1
            free = place.with_name(f"{place.name}-{number}{ending}")
        try:
            os.rename(made, free)
        except OSError:
            raise error from None
        flush(free)
        if isinstance(error, BadInput):
            raise error.with_hint(f"{what} is kept in {free}") from error
        error.add_note(f"{what} is kept in {free}")
        raise


def _is_mount_point(target: Path) -> bool:
    if os.path.ismount(target):
        return True
    try:
        # A folder bound from the same file system is known to the system alone.
        mounts = Path("/proc/self/mountinfo").read_text(encoding="utf-8", errors="surrogateescape")
    except OSError:
        return False
    escaped = str(target).replace("\\", "\\134").replace(" ", "\\040").replace("\t", "\\011").replace("\n", "\\012")
    return any(line.split(" ")[4] == escaped for line in mounts.splitlines())
