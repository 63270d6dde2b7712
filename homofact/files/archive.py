"""The one file that a fit is saved in: an .npz of plain arrays, one of them a JSON header with format and version."""

import json
import os
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from homofact.errors import BadInput

NAME = "factorization.npz"


def saved_file(place: str | os.PathLike[str]) -> Path:
    """The saved fit in a result's folder, or the file itself. Raises BadInput for a folder without one."""
    target = Path(place)
    if not target.is_dir():
        return target
    if not (target / NAME).is_file():
        raise BadInput(f"{target}: found no {NAME} in the folder, expected a result of a fit")
    return target / NAME


def write_archive(path: str | os.PathLike[str], header: dict[str, Any], arrays: dict[str, Any]) -> None:
    """Write header and arrays beside `path` and rename them to it. Raises BadInput for an unwritable place."""
    target = Path(path)
    beside = target.with_name(f".{target.name}.partial")
    try:
        with open(beside, "wb") as file:
            np.savez(file, **(arrays | {"header": np.array(json.dumps(header))}))  # pyright: ignore[reportArgumentType]
        os.replace(beside, target)
    except OSError as error:
        beside.unlink(missing_ok=True)
        raise BadInput(f"{target}: cannot be written ({error.strerror}), expected a writable place") from error


def read_archive(path: str | os.PathLike[str]) -> tuple[dict[str, Any], dict[str, Any]]:
    """(arrays, header) of a saved fit of any kind. Raises BadInput for a file that is none."""
    target = Path(path)
    try:
        with open(target, "rb") as file, np.load(file, allow_pickle=False) as archive:
            data = {name: archive[name] for name in archive.files}
        header = json.loads(str(data["header"]))
    except FileNotFoundError as error:
        raise BadInput(f"{target}: no such file, expected a saved factorization") from error
    except (OSError, ValueError, KeyError, EOFError, AttributeError, TypeError, zipfile.BadZipFile) as error:
        raise BadInput(f"{target}: not a saved factorization ({error}), expected the .npz of a fit") from error
    if not isinstance(header, dict):
        raise BadInput(f"{target}: the header is no object, expected the .npz of a fit")
    return data, header


def check_version(path: str | os.PathLike[str], header: dict[str, Any], newest: int) -> None:
    """Raise BadInput where the header names no version, or one newer than this program reads."""
    version = header.get("format_version")
    if not isinstance(version, int) or version > newest:
        raise BadInput(f"{path}: format version {version!r}, expected at most {newest}: update homofact")
