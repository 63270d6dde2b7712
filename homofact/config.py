"""The configuration of a run: TOML, checked strictly, and command-line options, read into frozen dataclasses.

For each key, the command line takes precedence over the file, and the file over the default. An explicit 0, 0.0 or
false counts like any other value. The sections:

    seed = 0             # of sampling, split and fit
    [source]             # what is read or sampled: `SourceSettings`
    [fit]                # the method's name and its settings, all but its seed: `FitSection`
    [evaluate]           # `EvaluateSettings`
    [compare]            # `CompareSettings`
    [output]             # `OutputSettings`
    [render]             # `RenderSettings`

Paths in a file are relative to the working folder, as they are on the command line. An unknown key or a value of the
wrong type raises `BadInput`, which names the file, the key, and the nearest known key or the expected type. Every key
is a field of a section's dataclass, which `settings.tables` reads. The keys of [fit] are the settings of the methods.
"""

import typing
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from homofact.errors import BadInput
from homofact.files.reading import read_toml
from homofact.methods import shared
from homofact.methods.table import ALL_METHODS
from homofact.sections import (
    CompareSettings,
    EvaluateSettings,
    FitSection,
    OutputSettings,
    RenderSettings,
    SourceSettings,
)
from homofact.settings.kinds import CONFIGURATION, check_kind
from homofact.settings.options import Declared, options_of
from homofact.settings.tables import keys_of, read_table, unknown_key


@dataclass(frozen=True)
class ConfigTable:
    """The keys of a configuration."""

    seed: int = shared.seed()
    source: SourceSettings = field(default_factory=SourceSettings)
    fit: FitSection = field(default_factory=FitSection)
    evaluate: EvaluateSettings = field(default_factory=EvaluateSettings)
    compare: CompareSettings = field(default_factory=CompareSettings)
    output: OutputSettings = field(default_factory=OutputSettings)
    render: RenderSettings = field(default_factory=RenderSettings)


@dataclass(frozen=True)
class Config(ConfigTable):
    """A whole run's settings; every command uses its part.

    `given` are the keys that the file or the command line sets.
    """

    given: frozenset[str] = frozenset()


SEED = options_of(ConfigTable)["seed"]


def fit_options() -> dict[str, dict[str, Declared]]:
    """Return the settings of all methods except the seed: by setting and method, the declaration of the setting."""
    settings: dict[str, dict[str, Declared]] = {}
    for name, method in ALL_METHODS.items():
        for setting, declared in options_of(method).items():
            if setting != "seed":
                settings.setdefault(setting, {})[name] = declared
    return settings


def section_options() -> dict[str, Declared]:
    """Return the options of all sections by their dotted keys, without the settings of the methods."""
    return {
        f"{section.name}.{name}": declared
        for section in fields(ConfigTable)
        if section.name != "seed"
        for name, declared in options_of(typing.get_type_hints(ConfigTable)[section.name]).items()
    }


def load_config(path: str | Path | None = None, given: Mapping[str, Any] | None = None) -> Config:
    """Return the settings of a run from an optional TOML file and from the command line.

    `given` maps dotted keys ("fit.size", "seed") to values, None where the option was not used. Raises
    BadInput for a file that cannot be read or is of another kind, an unknown key, a wrong type or a value out of range.
    """
    table = {} if path is None else read_toml(Path(path), "a TOML configuration")
    if path is not None:
        check_kind(table, CONFIGURATION, path)
    mine = {key: value for key, value in (given or {}).items() if value is not None}
    in_file = {key for key in _dotted(table) if key not in mine}
    whole = _merged(table, mine)

    def place(key: str) -> str:
        """The file's place of a key that it has, else the setting's own name."""
        return f"{path}: {key}" if key in in_file else key.rpartition(".")[2]

    settings = fit_options()
    found = read_table(ConfigTable, whole, place, (f"fit.{name}" for name in settings))
    own = {name: _read_setting(name, value, settings, place) for name, value in found.fit.settings.items()}
    places = {key.removeprefix("fit."): place(key) for key in in_file if key.startswith("fit.")}
    fit = FitSection(found.fit.method, own | {"seed": found.seed}, places)
    values: dict[str, Any] = {each.name: getattr(found, each.name) for each in fields(ConfigTable)}
    values["fit"] = fit
    return Config(**values, given=frozenset(key for key in _dotted(whole) if "." in key or key == "seed"))


def _read_setting(
    name: str, value: Any, settings: Mapping[str, Mapping[str, Declared]], place: Callable[[str], str]
) -> Any:
    """A setting of [fit] as one of the methods that have it takes it. Raises BadInput where none does."""
    where = place(f"fit.{name}")
    if name not in settings:
        raise unknown_key(f"fit.{name}", ["method", *settings], keys_of(ConfigTable), where)
    refusal: BadInput | None = None
    for declared in settings[name].values():
        try:
            return declared.read(value, where)
        except BadInput as error:
            refusal = refusal or error
    assert refusal is not None, f"{name} is of no method"
    raise refusal


def _dotted(table: Mapping[str, Any]) -> list[str]:
    """The keys of a table, and those of its sections behind theirs."""
    return [
        key
        for name, entry in table.items()
        for key in (name, *(f"{name}.{inner}" for inner in (entry if isinstance(entry, Mapping) else ())))
    ]


def _merged(table: Mapping[str, Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """Return a file's table, in which the values of dotted keys replace or extend its own."""
    whole = {name: dict(entry) if isinstance(entry, dict) else entry for name, entry in table.items()}
    for key, value in given.items():
        section, _, name = key.rpartition(".")
        if not section:
            whole[name] = value
        elif isinstance(whole.setdefault(section, {}), dict):
            whole[section][name] = value
    return whole
