"""The configuration of a run: strict TOML and command line options into frozen dataclasses.

Precedence is command line over file over default, key by key; an explicit 0, 0.0 or false wins like any
other value, since only a missing key falls through. The sections:

    seed = 0             # of sampling, split and fit
    [source]             # what is read or sampled: `SourceSettings`
    [fit]                # the method's name and its settings, all but its seed: `FitSection`
    [evaluate]           # `EvaluateSettings`
    [compare]            # `CompareSettings`
    [chart]              # `ChartSettings`
    [output]             # `OutputSettings`
    [render]             # `RenderSettings`

Paths in a file are relative to the working folder, as they are on the command line. An unknown key or a
value of the wrong type is `BadInput` naming file, key and the nearest known key or the expected type.
"""

import typing
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from homofact.errors import BadInput
from homofact.files.reading import read_toml
from homofact.files.tables import described, nearest_key, plain_value
from homofact.methods import shared
from homofact.methods.search import Search
from homofact.methods.table import ALL_METHODS
from homofact.options import Declared, options_of
from homofact.sections import (
    ChartSettings,
    CompareSettings,
    EvaluateSettings,
    FitSection,
    OutputSettings,
    RenderSettings,
    SourceSettings,
)


@dataclass(frozen=True)
class Config:
    """A whole run's settings; every command uses its part.

    `given` are the keys that were not left to their defaults.
    """

    seed: int
    source: SourceSettings
    fit: FitSection
    evaluate: EvaluateSettings
    compare: CompareSettings
    chart: ChartSettings
    output: OutputSettings
    render: RenderSettings
    given: frozenset[str] = frozenset()


_SECTIONS: dict[str, Any] = {
    "source": SourceSettings,
    "fit": FitSection,
    "evaluate": EvaluateSettings,
    "compare": CompareSettings,
    "chart": ChartSettings,
    "output": OutputSettings,
    "render": RenderSettings,
}


@dataclass(frozen=True)
class _Seed:
    seed: int = shared.seed()


SEED = options_of(_Seed)["seed"]


def fit_options() -> dict[str, dict[str, Declared]]:
    """The settings of all methods but the seed, by name: each as the methods that have it declare it."""
    found: dict[str, dict[str, Declared]] = {}
    for name, method in ALL_METHODS.items():
        for setting, declared in options_of(method).items():
            if setting != "seed":
                found.setdefault(setting, {})[name] = declared
    return found


def section_options() -> dict[str, Declared]:
    """The options of all sections by their dotted keys, but for the methods' settings."""
    return {
        f"{section}.{name}": declared
        for section, settings in _SECTIONS.items()
        for name, declared in options_of(settings).items()
    }


def _known() -> dict[str, tuple[Declared, ...]]:
    """Every key of a configuration, with the options that may stand there."""
    known = {"seed": (SEED,)} | {f"fit.{name}": tuple(each.values()) for name, each in fit_options().items()}
    return known | {key: (declared,) for key, declared in section_options().items()}


def load_config(path: str | Path | None = None, given: Mapping[str, Any] | None = None) -> Config:
    """The settings of a run from a TOML file (or none) and the command line's own.

    `given` maps dotted keys ("fit.size", "seed") to values, None where the option was not used. Raises
    BadInput for a file that cannot be read, an unknown key, a wrong type or a value out of range.
    """
    file = {} if path is None else _read(Path(path))
    mine = {key: value for key, value in (given or {}).items() if value is not None}
    values = {**file, **mine}
    places = {key: f"{path}: {key}" for key in file if key not in mine}

    def placed(section: str, make: typing.Callable[[], Any]) -> Any:
        try:
            return make()
        except BadInput as error:
            name, colon, rest = str(error).partition(":")
            key = f"{section}.{name}" if section else name
            if key in places:
                raise BadInput(f"{places[key]}{colon}{rest}") from error
            raise

    seed = placed("", lambda: SEED.checked(values.get("seed", 0)))

    def build(section: str) -> Any:
        own = {key.partition(".")[2]: value for key, value in values.items() if key.startswith(f"{section}.")}
        if section != "fit":
            return placed(section, lambda: _SECTIONS[section](**own))
        method = own.pop("method", Search.name)
        for name, value in own.items():
            placed(section, lambda name=name, value=value: _check_for_some(name, value))
        spots = {key.partition(".")[2]: place for key, place in places.items() if key.startswith("fit.")}
        return FitSection(method, own | {"seed": seed}, spots)

    return Config(seed=seed, given=frozenset(values), **{section: build(section) for section in _SECTIONS})


def _check_for_some(name: str, value: Any) -> None:
    """Raise BadInput for a value that no method takes for this setting: known even where no method is made."""
    wrong: BadInput | None = None
    for declared in fit_options()[name].values():
        try:
            declared.checked(value)
        except BadInput as error:
            wrong = wrong or error
        else:
            return
    if wrong is not None:
        raise wrong


def _read(path: Path) -> dict[str, Any]:
    """Dotted keys and checked values of a TOML file."""
    values: dict[str, Any] = {}
    for name, entry in read_toml(path, "a TOML configuration").items():
        if name in _SECTIONS:
            if not isinstance(entry, dict):
                raise BadInput(f"{path}: {name}: found {described(entry)}, expected a section [{name}]")
            values |= {f"{name}.{key}": value for key, value in entry.items()}
        elif isinstance(entry, dict):
            nearest = nearest_key(name, list(_SECTIONS))
            raise BadInput(f"{path}: unknown section [{name}], the nearest known one is [{nearest}]")
        else:
            values[name] = entry
    known = _known()
    for key, value in values.items():
        if key not in known:
            raise BadInput(f"{path}: unknown key {key}, the nearest known one is {nearest_key(key, list(known))}")
        values[key] = _checked(value, known[key], f"{path}: {key}")
    return values


def _checked(value: Any, options: tuple[Declared, ...], where: str) -> Any:
    """`value` as one of the options wants it; a list of names may be a text that joins them."""
    kinds = tuple(dict.fromkeys(kind for each in options for kind in each.kinds))
    listed = any(typing.get_origin(kind) is tuple for kind in kinds)
    if listed and isinstance(value, str) and "+" in options[0].option.separators:
        return options[0].from_text(value)
    return plain_value(value, kinds, where)
