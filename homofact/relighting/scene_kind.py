"""Which scenes are ones of relighting: told from the file alone, before anything that relights is loaded."""

from pathlib import Path

from homofact.files.reading import read_toml


def is_relight_scene(path: Path) -> bool:
    """Return whether a scene's file has objects rather than materials.

    Raises
    ------
    BadInput
        For what is no TOML.
    """
    return "object" in read_toml(path, "a scene in TOML")
