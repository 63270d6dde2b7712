"""What a TOML file is: a configuration, a sweep or a scene, and the commands that read it."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from homofact.errors import BadInput
from homofact.files.reading import read_toml
from homofact.settings.kinds import CONFIGURATION, EDITING, PLANNING, RELIGHTING, SWEEP, kinds_of

SUFFIX = ".toml"
# The command that reads each kind.
READERS: Mapping[str, str] = {
    CONFIGURATION: "factorize",
    SWEEP: "sweep",
    PLANNING: "plan",
    RELIGHTING: "relight",
    EDITING: "edit",
}


def toml_facts(place: Path) -> tuple[str, dict[str, Any], dict[str, Any]] | None:
    """Return (title, readable rows, JSON form) of a TOML file; None for anything else.

    Raises BadInput if the file cannot be read, or if its tables belong to no known kind.
    """
    if place.suffix.lower() != SUFFIX or not place.is_file():
        return None
    table = read_toml(place, "a configuration, a sweep or a scene")
    kinds = sorted(kinds_of(table), reverse=True)
    if not kinds:
        found = ", ".join(map(repr, list(table)[:5])) or "no keys"
        raise BadInput(where=place, found=found, expected=f"the keys of {', '.join(READERS)}")
    readers = [_reader(kind, table) for kind in kinds]
    if RELIGHTING in kinds and "tolerance" in table:
        readers.insert(0, READERS[PLANNING])
    facts = {"kind": " or ".join(kinds), "read_by": readers}
    return place.name, facts | _rows(table), {"file": str(place), **facts}


def _reader(kind: str, table: Mapping[str, Any]) -> str:
    """Return the command that reads a kind of file; `compare` reads a configuration with sources to compare."""
    return "compare" if kind == CONFIGURATION and "compare" in table else READERS[kind]


def _rows(table: Mapping[str, Any]) -> dict[str, Any]:
    """Return a table's keys and values for display; a list of tables becomes one row per table."""
    rows: dict[str, Any] = {}
    for name, value in table.items():
        if isinstance(value, list) and value and all(isinstance(each, Mapping) for each in value):
            rows |= {name if len(value) == 1 else f"{name} {k}": each for k, each in enumerate(value, 1)}
        else:
            rows[name] = "empty" if value == {} else value
    return rows
