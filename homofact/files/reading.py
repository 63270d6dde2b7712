"""Reading a file whole, with errors that a user can mend: which file, what was found, what is expected."""

import json
import os
import tomllib
from pathlib import Path
from typing import Any

from homofact.errors import BadInput


def read_bytes(path: str | os.PathLike[str], expected: str, *, may_be_empty: bool = False) -> bytes:
    """All bytes of a file that should be `expected` ("a PNG file").

    Raises BadInput where it is missing, a folder, unreadable, or empty where it may not be.
    """
    target = Path(path)
    try:
        data = target.read_bytes()
    except (OSError, ValueError) as error:
        raise _refusal(target, error, expected) from error
    if not data and not may_be_empty:
        raise BadInput(f"{target}: the file is empty, expected {expected}")
    return data


def check_readable(path: str | os.PathLike[str], expected: str) -> None:
    """Raise BadInput as `read_bytes` does for a file that is missing, a folder or unreadable."""
    target = Path(path)
    try:
        with open(target, "rb"):
            pass
    except OSError as error:
        raise _refusal(target, error, expected) from error


def _refusal(target: Path, error: OSError | ValueError, expected: str) -> BadInput:
    if isinstance(error, FileNotFoundError):
        return BadInput(f"{target}: no such file, expected {expected}")
    if isinstance(error, IsADirectoryError):
        return BadInput(f"{target}: a folder, expected {expected}")
    reason = getattr(error, "strerror", None) or error
    return BadInput(f"{target}: cannot be read ({reason}), expected {expected}")


def read_toml(path: str | os.PathLike[str], expected: str) -> dict[str, Any]:
    """The table that is a TOML file. Raises BadInput where it cannot be read or is no TOML."""
    # An empty file is TOML that says nothing.
    data = read_bytes(path, expected, may_be_empty=True)
    try:
        return tomllib.loads(data.decode("utf-8"))
    except (ValueError, RecursionError) as error:
        raise BadInput(f"{path}: not TOML: {error}") from error


def read_json(path: str | os.PathLike[str], expected: str) -> dict[str, Any]:
    """The object that is a JSON file. Raises BadInput where it cannot be read, is no JSON, or no object."""
    try:
        found = json.loads(read_bytes(path, expected).decode("utf-8"))
    except (ValueError, RecursionError) as error:
        raise BadInput(f"{path}: not JSON ({error}), expected {expected}") from error
    if not isinstance(found, dict):
        raise BadInput(f"{path}: found {short_json(found)}, expected {expected}")
    return found


def short_json(value: Any) -> str:
    """A value as JSON has it, cut where it is long."""
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 60 else f"{text[:57]}..."


def split_member(path: str | os.PathLike[str]) -> tuple[str, str | None]:
    """(file, member) of "FILE#MEMBER"; no member where there is no "#", or where a file has that very name."""
    text = os.fspath(path)
    file, mark, member = text.rpartition("#")
    if not mark or not file or os.path.exists(text):
        return text, None
    return file, member
