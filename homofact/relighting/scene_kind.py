"""Recognise relighting scenes from the file alone, before the relighting code is loaded."""

from pathlib import Path

from homofact.files.reading import read_toml


def is_relight_scene(path: Path) -> bool:
    """Return whether a scene's file has objects rather than materials.

    Raises
    ------
    BadInput
        If the file is not TOML.
    """
    return "object" in read_toml(path, "a scene in TOML")
