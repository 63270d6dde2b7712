"""Check input and output paths before a long fit, so that it does not fail at the end."""

import os
from difflib import get_close_matches
from pathlib import Path

from homofact.brdf.source_names import MATERIAL_NAMES, MATERIAL_PREFIX
from homofact.errors import BadInput
from homofact.files.kinds import EXPORT, PLAN, RESULT, check_no_fit
from homofact.files.private import private_folder
from homofact.files.reading import check_readable, split_member

_ROOM = 1 << 18  # bytes: less than any result takes


def check_measurement(source: str) -> None:
    """Raise BadInput if a source's file is missing or unreadable, before the code that reads it is imported."""
    if source.startswith(MATERIAL_PREFIX):
        return
    file, member = split_member(source)
    near = get_close_matches(source, MATERIAL_NAMES, n=1, cutoff=0.7)
    if near and not Path(file).exists():
        raise BadInput(
            "no such file",
            where=source,
            expected="a BRDF file or material:NAME",
            hint=f"nearest: {MATERIAL_PREFIX}{near[0]}",
        )
    check_no_fit(Path(file), source, "a BRDF file or material:NAME")
    # Of a missing "a#b" the name as it was given is what helps.
    check_readable(file if member is None or Path(file).exists() else source, "a BRDF file or material:NAME")


def check_result(place: Path) -> None:
    """Raise BadInput if a saved fit does not exist, before the code that opens it is imported."""
    from homofact.files.archive import saved_file

    if str(place).startswith(MATERIAL_PREFIX):
        hint = f"fit it first: `homofact.fit({str(place)!r})`"
        raise BadInput("is a material", where=place, expected="a saved fit", hint=hint)
    if place.is_dir() and PLAN.is_at(place):
        choices = sorted(str(each) for each in place.iterdir() if RESULT.is_at(each) or EXPORT.is_at(each))
        raise BadInput(where=place, found="a plan", expected=f"the folder of one of its choices: {', '.join(choices)}")
    if not saved_file(place, "manifest.json").exists():
        raise BadInput("no such file", where=place, expected="a saved factorization")


def check_folder(folder: Path, force: bool) -> None:
    """Refuse a result folder that cannot be created or written, or that contains files (unless `force`).

    Raises BadInput. The check leaves no files behind.
    """
    from homofact.files.folder import check_new_folder

    check_new_folder(folder, RESULT, force)
    _try_writing(folder, folder.resolve())


def check_place(folder: Path) -> None:
    """Refuse an output folder that is a file, or that cannot be created or written. Raises BadInput."""
    if folder.exists() and not folder.is_dir():
        raise BadInput("is a file", where=folder, expected="a folder")
    _try_writing(folder, folder.resolve() / "x")


def check_file(path: Path, *endings: str) -> None:
    """Refuse an output file that is a folder, has none of the `endings`, or cannot be written. Raises BadInput."""
    if path.is_dir():
        raise BadInput("is a folder", where=path, expected="a file's name")
    if path.suffix.lower() not in endings:
        found = repr(path.suffix) if path.suffix else "nothing"
        raise BadInput(f"ends in {found}", where=path, expected=" or ".join(endings))
    _try_writing(path, path.resolve())


def _try_writing(asked: Path, target: Path) -> None:
    """Create and delete a trial file with the target's relative path, in a hidden folder beside the target.

    Error messages name the `asked` path, not the trial file. A trial is necessary because permission bits do not reveal
    all obstacles, such as a name that is too long or a full file system.
    """
    place = next(each for each in target.parents if each.exists())
    if not place.is_dir():
        raise BadInput(f"{place} is a file", where=asked, expected="a folder")
    try:
        with private_folder(place / target.name) as folder:
            trial = folder / target.relative_to(place)
            trial.parent.mkdir(parents=True, exist_ok=True)
            with open(trial, "wb") as file:
                file.write(bytes(_ROOM))
                file.flush()
                os.fsync(file.fileno())
    except OSError as error:
        reason = error.strerror or str(error)
        raise BadInput(f"cannot be written ({reason})", where=asked, expected="a writable place") from error
