"""The contents of the scene folders that `relight` and `edit` write."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from homofact.errors import BadInput
from homofact.evaluation.wording import counted
from homofact.files.kinds import PREPARED, RELIT


def scene_facts(place: Path) -> tuple[str, dict[str, Any], dict[str, Any]] | None:
    """Return (title, readable rows, JSON form) of a scene's folder; None for anything else.

    Raises BadInput where the folder's report is missing or damaged.
    """
    # Before what reads them is loaded.
    if not any((place / kind.mark).exists() for kind in (PREPARED, RELIT)):
        return None

    from homofact.editing import result as editing
    from homofact.files.fields import Fields
    from homofact.relighting import result as transport

    if PREPARED.is_at(place):
        kind, file, rows = "prepared scene", place / editing.REPORT, _edit_rows
        fields = Fields.read(file, "the report of a prepared scene")
        fields.text("format", (editing.FORMAT,))
        found = fields.inner("report").found
    elif RELIT.is_at(place):
        kind, file, rows = "relit scene", place / transport.REPORT, _relit_rows
        found = Fields.read(file, "the report of a relit scene").found
    else:
        return None
    try:
        return str(found["scene"]), {"kind": kind, **rows(found)}, {"folder": str(place), "kind": kind, **found}
    except (KeyError, TypeError, ValueError, AttributeError, IndexError) as error:
        raise BadInput(f"damaged ({error!r})", where=file, expected=f"the report of a {kind}") from error


def _edit_rows(found: Mapping[str, Any]) -> dict[str, Any]:
    materials = {}
    for name, curves in found["materials"].items():
        own = [f"{each['term']} {each['curve']} ({each['angle']}, {each['bands']} bands)" for each in curves]
        materials[f"material {name}"] = ", ".join(own)
    errors = [f"{view} {error:.2%}" for view, error in found["error"]["lights_and_bands"].items()]
    return {
        "light": f"{found['light']}, {counted(found['triangles'], 'triangle')}",
        "views": [f"{each['name']}, {counted(each['pixels'], 'covered pixel')}" for each in found["views"]],
        **materials,
        "stored": _megabytes(found["bytes"]),
        "error of the low rank": f"at most {found['error']['low_rank']:.2%} (relative RMS)",
        "error of lights and bands": ", ".join(errors),
    }


def _relit_rows(found: Mapping[str, Any]) -> dict[str, Any]:
    objects = {}
    for each in found["objects"]:
        error = "not measured" if each["error"] is None else f"{_whole(each['error']):.2%} (relative RMS)"
        objects[f"object {each['mesh']}"] = (
            f"{each['material']}; {each['vertices']} vertices,"
            f" {counted(each['terms'], 'term')}, {each['form']}, {each['coefficients_per_vector']:.0f} numbers per"
            f" vector; error {error}"
        )
    return {"light": found["light"], "cube": f"{found['cube']}²", **objects, "transport": _megabytes(found["bytes"])}


def _whole(errors: Mapping[str, float]) -> float:
    """Return the error in the picture, or that of the vertices if the object is not in the picture."""
    return errors.get("picture", errors["together"])


def _megabytes(count: int) -> str:
    return f"{count / 1e6:.3g} MB"
