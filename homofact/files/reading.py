"""Read a whole file, with errors that help the user: they name the file, what was found and what is expected."""

import errno
import json
import os
import stat
import tomllib
from pathlib import Path
from typing import Any, BinaryIO

from homofact.errors import BadInput
from homofact.files.embedded import located

_DEEPEST, _MOST_DIGITS, _LARGEST_TOML = 100, 20, 1_000_000


def read_bytes(path: str | os.PathLike[str], expected: str, *, may_be_empty: bool = False) -> bytes:
    """Return all bytes of a file that should be `expected` ("a PNG file").

    Raises BadInput if the file is missing, unreadable, a folder, a pipe or a device, or empty without `may_be_empty`.
    """
    target = Path(path)
    try:
        with _opened(target) as file:
            data = file.read()
    except (OSError, ValueError) as error:
        raise _refusal(target, error, expected) from error
    if not data and not may_be_empty:
        raise BadInput("the file is empty", where=target, expected=expected)
    return data


def check_readable(path: str | os.PathLike[str], expected: str) -> None:
    """Raise BadInput, as `read_bytes` does, if a file is missing, unreadable, or not a regular file."""
    target = Path(path)
    try:
        with _opened(target):
            pass
    except (OSError, ValueError) as error:
        raise _refusal(target, error, expected) from error


def _opened(target: Path) -> BinaryIO:
    """The file, open. Raises OSError, for what is no file too: a pipe would wait for ever, a device never end."""
    # Without waiting for a pipe's other end.
    handle = os.open(located(target), os.O_RDONLY | getattr(os, "O_BINARY", 0) | getattr(os, "O_NONBLOCK", 0))
    if stat.S_ISREG(os.fstat(handle).st_mode):
        return os.fdopen(handle, "rb")
    folder = stat.S_ISDIR(os.fstat(handle).st_mode)
    os.close(handle)
    raise IsADirectoryError if folder else OSError(errno.EINVAL, "a pipe or a device")


def _refusal(target: Path, error: OSError | ValueError, expected: str) -> BadInput:
    if isinstance(error, FileNotFoundError):
        return BadInput("no such file", where=target, expected=expected)
    if isinstance(error, IsADirectoryError):
        return BadInput("a folder", where=target, expected=expected)
    reason = getattr(error, "strerror", None) or error
    return BadInput(f"cannot be read ({reason})", where=target, expected=expected)


def read_toml(path: str | os.PathLike[str], expected: str) -> dict[str, Any]:
    """Return the table in a TOML file. Raises BadInput if the file cannot be read or is not TOML."""
    # An empty file is TOML that says nothing.
    data = read_bytes(path, expected, may_be_empty=True)
    if len(data) > _LARGEST_TOML:
        raise BadInput(where=path, found=f"{len(data)} bytes", expected=f"{expected} of at most {_LARGEST_TOML}")
    for number, line in enumerate(data.split(b"\n"), 1):
        # What a dotted key costs to read grows by the square of its parts.
        if any(piece.count(b".") > _DEEPEST for piece in line.split(b",")):
            found = f"more than {_DEEPEST} dots between commas"
            raise BadInput(where=f"{path}: line {number}", found=found, expected=expected)
    try:
        return tomllib.loads(data.decode("utf-8"))
    except (ValueError, RecursionError) as error:
        raise BadInput(f"not TOML: {error}", where=path, expected=expected) from error


def read_json(path: str | os.PathLike[str], expected: str) -> dict[str, Any]:
    """Return the object in a JSON file. Raises BadInput if the file cannot be read or has no JSON object."""
    data = read_bytes(path, expected)
    try:
        found = parsed_json(data.decode("utf-8"))
    except ValueError as error:
        raise BadInput(f"not JSON ({error})", where=path, expected=expected) from error
    if not isinstance(found, dict):
        raise BadInput(where=path, found=short_json(found), expected=expected)
    return found


def parsed_json(text: str) -> Any:
    """Return the value of a JSON text.

    Raises ValueError for invalid JSON, and for excessive nesting or numbers of digits.
    """
    try:
        found = json.loads(text, parse_int=_whole)
        if _depth(found, _DEEPEST) > _DEEPEST:
            raise RecursionError
    except RecursionError as error:
        raise ValueError(f"nested deeper than {_DEEPEST}") from error
    return found


def _whole(digits: str) -> int:
    if len(digits) > _MOST_DIGITS:
        raise ValueError(f"a number of {len(digits)} digits")
    return int(digits)


def _depth(value: Any, most: int) -> int:
    """How deep lists and objects are nested, counted up to `most` + 1."""
    level, depth = [value], 0
    while depth <= most:
        level = [
            inner
            for each in level
            if isinstance(each, list | dict)
            for inner in (each.values() if isinstance(each, dict) else each)
        ]
        if not level:
            return depth
        depth += 1
    return depth


def short_json(value: Any) -> str:
    """Return a value as JSON has it, cut where it is long."""
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 60 else f"{text[:57]}..."


def split_member(path: str | os.PathLike[str]) -> tuple[str, str | None]:
    """Return (file, member) of "FILE#MEMBER"; no member where there is no "#", or where a file has that very name."""
    text = os.fspath(path)
    file, mark, member = text.rpartition("#")
    if not mark or not file or os.path.exists(text):
        return text, None
    return file, member
