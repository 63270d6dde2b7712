"""What a TOML file is: a configuration, a sweep or a scene, and the commands that read it."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from homofact.errors import BadInput
from homofact.evaluation.wording import counted
from homofact.files.reading import read_toml
from homofact.settings.kinds import CONFIGURATION, EDITING, PLANNING, RELIGHTING, SWEEP, kinds_of

SUFFIX = ".toml"
# Shell commands by kind; {file} is the place of the file.
COMMANDS: Mapping[str, str] = {
    CONFIGURATION: "homofact factorize --config {file}",
    SWEEP: "homofact sweep {file} --out FOLDER",
    PLANNING: "homofact plan {file}",
    RELIGHTING: "homofact relight {file} --out FOLDER",
    EDITING: "homofact edit {file} --out FOLDER",
}


def toml_facts(place: Path) -> tuple[str, dict[str, Any], dict[str, Any]] | None:
    """Return (title, rows for people, the answer) of a TOML file; None of anything else.

    Raises BadInput where the file cannot be read, and where its tables are those of no kind.
    """
    if place.suffix.lower() != SUFFIX or not place.is_file():
        return None
    table = read_toml(place, "a configuration, a sweep or a scene")
    kinds = sorted(kinds_of(table), reverse=True)
    if not kinds:
        found = ", ".join(map(repr, list(table)[:5])) or "no keys"
        raise BadInput(where=place, found=found, expected=f"the keys of {', '.join(COMMANDS)}")
    commands = [_command(kind, table).format(file=place) for kind in kinds]
    if RELIGHTING in kinds and "tolerance" in table:
        commands.insert(0, COMMANDS[PLANNING].format(file=place))
    kind, parts = " or ".join(kinds), {name: _words(value) for name, value in table.items()}
    facts = {"kind": kind, "read_by": commands}
    return place.name, facts | parts, {"file": str(place), **facts}


def _command(kind: str, table: Mapping[str, Any]) -> str:
    """The shell command for a kind; a configuration with sources to compare is read by `compare`."""
    return "homofact compare --config {file}" if kind == CONFIGURATION and "compare" in table else COMMANDS[kind]


def _words(value: Any) -> Any:
    """A key's value for a line: how many tables it has, or the keys of its table."""
    if isinstance(value, list) and value and all(isinstance(each, Mapping) for each in value):
        return counted(len(value), "table")
    return ", ".join(value) or "empty" if isinstance(value, Mapping) else value
