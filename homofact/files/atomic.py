"""Writing a file whole or not at all: made in a private folder beside its place, then renamed over it.

Everything that homofact writes goes through here (`folder.write_folder` uses the same private folder), so that

* whatever goes wrong, an interrupt included, leaves an older file as it was and nothing beside it;
* two writers of one place never share a half-written file, the last to end wins;
* a symbolic link stays one: the file that it points to is replaced;
* an existing file keeps its permissions, a new one gets those of the umask;
* the bytes are on the disk before the name points to them, so that a power cut leaves the old file or the new one.
"""

import contextlib
import errno
import os
import shutil
import stat
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

from homofact.errors import BadInput


def replace_file(path: str | os.PathLike[str], write: Callable[[Path], object]) -> None:
    """Let `write` make a file of this name in a private folder beside `path`, and rename it to `path`.

    Raises BadInput where the place cannot be written, or holds what is no file (a folder, a device, a pipe); whatever
    else `write` raises passes through with the place as it was before.
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
            os.replace(made, target)
        flush(target.parent)


def write_bytes(path: str | os.PathLike[str], data: bytes) -> None:
    """Make or replace a file, whole or not at all. Raises BadInput as `replace_file`."""
    replace_file(path, lambda made: made.write_bytes(data))


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Make or replace a UTF-8 file, whole or not at all, line ends as they are. Raises BadInput as `replace_file`.

    A lone surrogate, which no UTF-8 holds, is written as \\udcff: in JSON that is the surrogate again.
    """
    write_bytes(path, text.encode(errors="backslashreplace"))


@contextlib.contextmanager
def unwritable_refused(path: str | os.PathLike[str]) -> Iterator[None]:
    """Turn what the system says against writing `path` into BadInput."""
    try:
        yield
    except OSError as error:
        reason = error.strerror or error
        raise BadInput(f"{path}: cannot be written ({reason}), expected a writable place") from error


def real_place(path: str | os.PathLike[str]) -> Path:
    """Where `path` leads through symbolic links, whether or not something is there.

    Raises OSError for links that lead in a circle, and for a name that no file can have.
    """
    if "\0" in os.fspath(path):
        raise OSError(errno.EINVAL, "a zero byte in the name")
    target = Path(os.path.realpath(path))
    if target.is_symlink():
        raise OSError(errno.ELOOP, "a symbolic link that leads back to itself")
    return target


@contextlib.contextmanager
def private_folder(target: Path) -> Iterator[Path]:
    """A new hidden folder on the file system of `target`, gone with all that is left in it at the end."""
    folder = Path(tempfile.mkdtemp(prefix=".partial-", dir=target.parent))
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


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
