"""Write a file whole or not at all: write it in a private folder beside its path, then rename it.

Everything that homofact writes goes through here (`folder.write_folder` uses the same private folder), so that

* after an error or interrupt, an older file is unchanged and nothing else remains (after a kill, the next write in the
  same folder removes what remains);
* two processes that write the same path never mix their data; the last one to finish wins;
* a symbolic link stays a link; the file that it points to is replaced;
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

    With `new`, an existing file is never replaced, even if it appears during the write. Raises BadInput if `path`
    cannot be written or is not a regular file (a folder, a device, a pipe), or, with `new`, if anything exists at
    `path`. Other exceptions of `write` are passed on, and `path` stays unchanged.
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
    """Make or replace a UTF-8 file, whole or not at all; line ends are kept. Raises BadInput as `replace_file`.

    A lone surrogate, which UTF-8 cannot encode, is written as \\udcff: JSON reads this as the surrogate again.
    """
    write_bytes(path, text.encode(errors="backslashreplace"))


def flush(place: Path) -> None:
    """Flush a file, or the names in a folder, to the disk.

    Raises OSError if the file cannot be stored (a full or failing disk).
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
