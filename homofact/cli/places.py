"""Where results go: checked before a long fit, so that an hour's work never meets a closed door."""

import tempfile
from pathlib import Path

from homofact.brdf.names import MATERIAL_PREFIX
from homofact.errors import BadInput
from homofact.files.reading import check_readable, split_member


def check_measurement(source: str) -> None:
    """Refuse a source's file that is missing or cannot be read, before what reads it is loaded. Raises BadInput."""
    if source.startswith(MATERIAL_PREFIX):
        return
    file, member = split_member(source)
    # Of a missing "a#b" the name as it was given is what helps.
    check_readable(file if member is None or Path(file).exists() else source, "a BRDF file or material:NAME")


def check_result(place: Path) -> None:
    """Refuse a result that is not there, before what opens it is loaded. Raises BadInput."""
    from homofact.files.archive import NAME, saved_file

    if not place.exists():
        raise BadInput(f"{place}: no such file, expected a saved factorization")
    if place.is_dir() and not (place / NAME).exists() and not (place / "manifest.json").exists():
        saved_file(place)


def check_folder(folder: Path, force: bool) -> None:
    """Refuse a result folder that cannot be made or written, or that holds something without `force`.

    Raises BadInput; leaves nothing behind.
    """
    from homofact.files.archive import NAME
    from homofact.files.folder import check_new_folder

    # As `export.result.check_result_folder`, which loads torch.
    check_new_folder(folder, "result", NAME, force)
    _try_writing(folder.resolve().parent)


def check_place(folder: Path) -> None:
    """Refuse a folder for several files that is a file itself or cannot be made or written. Raises BadInput."""
    if folder.exists() and not folder.is_dir():
        raise BadInput(f"{folder}: is a file, expected a folder")
    _try_writing(folder.resolve())


def check_file(path: Path, *endings: str) -> None:
    """Refuse a file that is a folder, has none of the `endings`, or is in a closed place. Raises BadInput."""
    if path.is_dir():
        raise BadInput(f"{path}: is a folder, expected a file's name")
    if path.suffix.lower() not in endings:
        found = repr(path.suffix) if path.suffix else "nothing"
        raise BadInput(f"{path}: ends in {found}, expected {' or '.join(endings)}")
    _try_writing(path.resolve().parent)


def _try_writing(folder: Path) -> None:
    """Make a folder in `folder`, or in the nearest that exists, and take it away.

    Permission bits do not tell of everything that can be in the way, a full or odd file system for one.
    """
    place = next(each for each in (folder, *folder.parents) if each.exists())
    if not place.is_dir():
        raise BadInput(f"{folder}: {place} is a file, expected a folder")
    try:
        with tempfile.TemporaryDirectory(prefix=".homofact-", dir=place):
            pass
    except OSError as error:
        reason = error.strerror or str(error)
        raise BadInput(f"{folder}: cannot be written ({reason}), expected a writable place") from error
