"""Bytes in and out, with the errors that a user can mend."""

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

from homofact.errors import BadInput


def read_bytes(path: str | os.PathLike[str]) -> bytes:
    """All bytes of a file. Raises BadInput where it is missing, a folder, unreadable or empty."""
    target = Path(path)
    with _refusing(target):
        data = target.read_bytes()
    if not data:
        raise BadInput(f"{target}: the file is empty, expected a BRDF file")
    return data


def check_readable(path: str | os.PathLike[str]) -> None:
    """Raise BadInput as `read_bytes` does for a file that is missing, a folder or unreadable."""
    target = Path(path)
    with _refusing(target), open(target, "rb"):
        pass


@contextlib.contextmanager
def _refusing(target: Path) -> Iterator[None]:
    """What goes wrong in reading a file, as BadInput."""
    try:
        yield
    except FileNotFoundError as error:
        raise BadInput(f"{target}: no such file, expected a BRDF file or material:NAME") from error
    except IsADirectoryError as error:
        raise BadInput(f"{target}: a folder, expected a BRDF file") from error
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise BadInput(f"{target}: cannot be read ({reason}), expected a readable BRDF file") from error


def split_member(path: str | os.PathLike[str]) -> tuple[str, str | None]:
    """(file, member) of "FILE#MEMBER"; no member where there is no "#", or where a file has that very name."""
    text = os.fspath(path)
    file, mark, member = text.rpartition("#")
    if not mark or not file or os.path.exists(text):
        return text, None
    return file, member


def write_bytes(path: str | os.PathLike[str], data: bytes) -> None:
    """Write a file beside its place, then rename it: a failure, BadInput, leaves no half file."""
    target = Path(path)
    beside = target.with_name(f".{target.name}.partial")
    try:
        beside.write_bytes(data)
        os.replace(beside, target)
    except OSError as error:
        with contextlib.suppress(OSError):
            beside.unlink(missing_ok=True)
        raise BadInput(f"{target}: cannot be written ({error.strerror}), expected a writable place") from error
