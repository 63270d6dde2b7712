"""The example data and settings that come with homofact: `data_synthetic/` and `configs/`.

If a path in these folders does not exist in the working folder, homofact uses the file of that name in the package. So
the commands and code of the README work in any folder. In a checkout, the two folders are beside the package. In an
installation, they are inside the package.
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
    """Return the package's file for a path that does not exist itself; None if there is no such file."""
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
    """Return the embedded file for a path that does not exist, otherwise the path itself."""
    return embedded(path) or Path(path)
