"""The kinds of TOML files, so that an error can name the kind of a file that is given to the wrong command."""

from collections.abc import Mapping
from typing import Any

from homofact.errors import BadInput

CONFIGURATION, SWEEP = "a configuration", "a sweep"
PLANNING, RELIGHTING, EDITING = "a scene for planning", "a scene for relighting", "a scene for editing"
TAKEN_BY = {CONFIGURATION: "fit", SWEEP: "sweep", PLANNING: "plan", RELIGHTING: "relight", EDITING: "edit"}
_CONFIGURATION = {"fit", "evaluate", "compare", "output", "render"}
_RELIGHTING, _EDITING = {"terms", "error", "share", "lobe"}, {"curves", "bands", "pattern"}


def kinds_of(table: Mapping[str, Any]) -> set[str]:
    """Return the possible kinds of a table, from the sections that only they have; empty if none is recognized."""
    if "sources" in table or isinstance(table.get("method"), list):
        return {SWEEP}
    if isinstance(table.get("material"), list):
        return {PLANNING}
    if isinstance(table.get("object"), list):
        parts = [*table["object"], table.get("ground")]
        keys = {key for part in parts if isinstance(part, Mapping) for key in part}
        relit = bool({"transport", "tolerance"} & set(table) or _RELIGHTING & keys)
        edited = bool("edit" in table or _EDITING & keys)
        return {RELIGHTING, EDITING} if relit == edited else {RELIGHTING} if relit else {EDITING}
    return {CONFIGURATION} if _CONFIGURATION & set(table) else set()


def check_kind(table: Mapping[str, Any], expected: str, where: object) -> None:
    """Raise BadInput for a table of another kind, naming its command, and for a table that mixes two kinds."""
    if all(isinstance(table.get(name), list) for name in ("material", "object")):
        raise BadInput(
            where=where,
            found="[[material]] and [[object]]",
            expected="one of them: textures of materials and the light on meshes are planned from two files",
        )
    kinds = kinds_of(table)
    if kinds and expected not in kinds:
        found = " or ".join(sorted(kinds, reverse=True))
        taken = " or ".join(f"`homofact.{TAKEN_BY[kind]}`" for kind in sorted(kinds, reverse=True))
        verb = "takes" if len(kinds) == 1 else "take"
        raise BadInput(where=where, found=found, expected=expected, hint=f"{taken} {verb} it")
