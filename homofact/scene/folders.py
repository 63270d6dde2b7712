"""The folders that `relight` and `edit` write: an archive, a JSON report, a picture per camera, fits of measurements.

Each folder is written whole or not at all, and its archive identifies it (`files.kinds`). The report has the name of
the archive, with the ending .json.
"""

import re
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from homofact.containers.png import write_png
from homofact.exporting.manifest import write_json
from homofact.files.archive import member_names, read_arrays, read_header
from homofact.files.folder import check_new_folder, write_folder
from homofact.files.kinds import FolderKind
from homofact.files.reading import read_bytes
from homofact.scene.cameras import Camera
from homofact.scene.file_fits import FileFit


def report_name(kind: FolderKind) -> str:
    """Return the name of the report in a folder of this kind."""
    return Path(kind.mark).with_suffix(".json").name


def write_scene_folder(
    folder: Path,
    kind: FolderKind,
    save: Callable[[Path], None],
    report: dict[str, Any],
    pictures: Sequence[np.ndarray],
    cameras: Sequence[Camera],
    force: bool = False,
    fits: Iterable[FileFit] = (),
) -> None:
    """Write a folder: `save` writes the archive to the file that it is called with; `pictures` are 8-bit (H, W, 3).

    There is a picture per camera, called as `picture_names` says. `fits` are saved by their names.
    Raises BadInput as `files.folder.write_folder`.
    """
    check_new_folder(folder, kind, force)

    def fill(place: Path) -> None:
        save(place / kind.mark)
        write_json(place / report_name(kind), report)
        for name, pixels in zip(picture_names(cameras), pictures, strict=False):
            write_png(place / name, pixels)
        for each in fits:
            each.fit.save(place / each.name)

    write_folder(folder, kind, fill, force)


def picture_names(cameras: Sequence[Camera]) -> list[str]:
    """Return the file name of each camera's picture, with the camera's name or else its number.

    Examples
    --------
    >>> picture_names([Camera((0, 0, 3), name="From the left"), Camera((3, 0, 0))])
    ['picture_from-the-left.png', 'picture_2.png']
    """
    words = [re.sub("[^a-z0-9]+", "-", (each.name or "").lower()).strip("-") for each in cameras]
    once = [word if word and words.count(word) == 1 else str(number) for number, word in enumerate(words, 1)]
    alike = len(set(once)) < len(once)
    return [f"picture_{number if alike else word}.png" for number, word in enumerate(once, 1)]


def read_scene_archive(file: Path, what: str) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Return (arrays, header) of an archive, named `what` in messages. Raises BadInput if it is damaged."""
    raw = read_bytes(file, what)
    arrays = read_arrays(file, raw, member_names(file, raw, what), what)
    return arrays, read_header(file, arrays, what)
