"""Output paths: resolve a path's symbolic links, and turn errors of writing into BadInput."""

import contextlib
import errno
import os
from collections.abc import Iterator
from pathlib import Path

from homofact.errors import BadInput


@contextlib.contextmanager
def unwritable_refused(path: str | os.PathLike[str]) -> Iterator[None]:
    """Turn every OSError of the block into BadInput, which reports that `path` cannot be written."""
    try:
        yield
    except OSError as error:
        reason = error.strerror or error
        raise BadInput(f"cannot be written ({reason})", where=path, expected="a writable place") from error


def real_place(path: str | os.PathLike[str]) -> Path:
    """Return where `path` leads through symbolic links, whether or not something is there.

    Raises OSError for circular links, and for an invalid file name.
    """
    if "\0" in os.fspath(path):
        raise OSError(errno.EINVAL, "a zero byte in the name")
    target = Path(os.path.realpath(path))
    if target.is_symlink():
        raise OSError(errno.ELOOP, "a symbolic link that leads back to itself")
    return target
