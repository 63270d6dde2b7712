"""The page of a scene that `edit` prepared: its own name, materials and numbers."""

from collections.abc import Callable
from pathlib import Path

from homofact.editing.page.build import error_words, write_edit_page
from homofact.editing.result import EditResult


def write_saved_page(
    target: Path, saved: EditResult, stage: Callable[[str], object] | None = None, new: bool = False
) -> int:
    """Write the page, whole or not at all; its bytes. Raises BadInput as `page.build.write_edit_page`."""
    names = ", ".join(material.name for material in saved.prepared.scene.materials)
    numbers = {}
    lights = saved.report.get("error", {}).get("lights_and_bands", {})
    if lights:
        numbers["Lights and bands against a finer division"] = {
            view: f"error {error_words(error)}" for view, error in lights.items()
        }
    title = saved.file.name
    return write_edit_page(target, saved.prepared, title=title, subtitle=names, numbers=numbers, stage=stage, new=new)
