"""The example data and settings that come with homofact: `data_synthetic/` and `configs/`.

A path in them that is not in the working folder is the file of that name in the package, so that the commands and lines
of the README work in any folder. In a checkout they lie beside the package, in an installed one inside it.
"""

import os
from pathlib import Path

FOLDERS = ("data_synthetic", "configs")
_PACKAGE = Path(__file__).resolve().parents[1]


def root() -> Path:
    """Return the folder that holds `FOLDERS`."""
    inside = _PACKAGE / "embedded"
    return inside if inside.is_dir() else _PACKAGE.parent


def embedded(path: str | os.PathLike[str]) -> Path | None:
    """Return the file of the package that a path means which does not exist itself; None for any other."""
    if os.path.lexists(path):
        return None
    try:
        # "configs/scenes/../../data_synthetic/knot.ply", where there is no configs to go up from.
        inside = Path(os.path.relpath(path))
    except (OSError, ValueError):
        return None
    found = root() / inside
    return found if inside.parts[:1] and inside.parts[0] in FOLDERS and found.is_file() else None


def located(path: str | os.PathLike[str]) -> Path:
    """Return the path itself, or the embedded file that it means."""
    return embedded(path) or Path(path)
