"""Where something is to be written: the place that a path leads to, and what the system says against it."""

import contextlib
import errno
import os
from collections.abc import Iterator
from pathlib import Path

from homofact.errors import BadInput


@contextlib.contextmanager
def unwritable_refused(path: str | os.PathLike[str]) -> Iterator[None]:
    """Turn what the system says against writing `path` into BadInput."""
    try:
        yield
    except OSError as error:
        reason = error.strerror or error
        raise BadInput(f"cannot be written ({reason})", where=path, expected="a writable place") from error


def real_place(path: str | os.PathLike[str]) -> Path:
    """Return where `path` leads through symbolic links, whether or not something is there.

    Raises OSError for links that lead in a circle, and for a name that no file can have.
    """
    if "\0" in os.fspath(path):
        raise OSError(errno.EINVAL, "a zero byte in the name")
    target = Path(os.path.realpath(path))
    if target.is_symlink():
        raise OSError(errno.ELOOP, "a symbolic link that leads back to itself")
    return target
