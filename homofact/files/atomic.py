"""Writing a file whole or not at all: made in a private folder beside its place, then renamed over it.

Everything that homofact writes goes through here (`folder.write_folder` uses the same private folder), so that

* whatever goes wrong, an interrupt included, leaves an older file as it was and nothing beside it (what a kill leaves,
  the next write in the same folder cleans);
* two writers of one place never share a half-written file, the last to end wins;
* a symbolic link stays one: the file that it points to is replaced;
* an existing file keeps its permissions, a new one gets those of the umask;
* the bytes are on the disk before the name points to them, so that a power cut leaves the old file or the new one.
"""

import errno
import os
import stat
from collections.abc import Callable
from pathlib import Path

from homofact.files.places import real_place, unwritable_refused
from homofact.files.private import private_folder


def replace_file(path: str | os.PathLike[str], write: Callable[[Path], object], *, new: bool = False) -> None:
    """Let `write` make a file of this name in a private folder beside `path`, and rename it to `path`.

    `new` says that nothing may be replaced, what came while it was written included. Raises BadInput where the place
    cannot be written, or holds what is no file (a folder, a device, a pipe), or with `new` anything; whatever else
    `write` raises passes through with the place as it was before.
    """
    with unwritable_refused(path):
        target = real_place(path)
        mode = _mode(target)
        with private_folder(target) as folder:
            made = folder / target.name
            write(made)
            flush(made)
            if mode is not None:
                made.chmod(mode)
            if new:
                _add(made, target)
            else:
                os.replace(made, target)
        flush(target.parent)


def write_bytes(path: str | os.PathLike[str], data: bytes, *, new: bool = False) -> None:
    """Make or replace a file, whole or not at all. `new` and BadInput as with `replace_file`."""
    replace_file(path, lambda made: made.write_bytes(data), new=new)


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Make or replace a UTF-8 file, whole or not at all, line ends as they are. Raises BadInput as `replace_file`.

    A lone surrogate, which no UTF-8 holds, is written as \\udcff: in JSON that is the surrogate again.
    """
    write_bytes(path, text.encode(errors="backslashreplace"))


def flush(place: Path) -> None:
    """Have the system write a file, or the names in a folder, to the disk.

    Raises OSError for a file that cannot be kept (a full or failing disk).
    """
    try:
        handle = os.open(place, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
    except OSError as error:
        # Not every system can do it, and some do it for files alone: what is written is then as safe as it can be.
        if not place.is_dir() and error.errno not in (errno.EINVAL, errno.ENOTSUP):
            raise


def _mode(target: Path) -> int | None:
    """The permissions of the file that is there, None where there is none. Raises OSError for what is no file."""
    try:
        found = target.stat().st_mode
    except FileNotFoundError:
        return None
    if not stat.S_ISREG(found):
        raise OSError(errno.EEXIST, "a folder is there" if stat.S_ISDIR(found) else "what is there is no file")
    return stat.S_IMODE(found)


def _add(made: Path, target: Path) -> None:
    """Give a file its name where nothing has it. Raises FileExistsError where something has."""
    try:
        os.link(made, target)
    except FileExistsError:
        raise
    except OSError:
        # No second names on this file system: looked at first, as well as can be.
        if os.path.lexists(target):
            raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST)) from None
        os.rename(made, target)
