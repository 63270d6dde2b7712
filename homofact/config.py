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

import difflib
import tomllib
import typing
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from homofact.errors import BadInput
from homofact.methods import shared
from homofact.methods.search import Search
from homofact.methods.table import METHODS
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
    for name, method in METHODS.items():
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
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise BadInput(f"{path}: no such file, expected a TOML configuration") from error
    except OSError as error:
        raise BadInput(f"{path}: cannot be read ({error.strerror}), expected a TOML configuration") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise BadInput(f"{path}: not TOML: {error}") from error
    values: dict[str, Any] = {}
    for name, entry in table.items():
        if name in _SECTIONS:
            if not isinstance(entry, dict):
                raise BadInput(f"{path}: {name}: found {_described(entry)}, expected a section [{name}]")
            values |= {f"{name}.{key}": value for key, value in entry.items()}
        elif isinstance(entry, dict):
            nearest = _nearest(name, list(_SECTIONS))
            raise BadInput(f"{path}: unknown section [{name}], the nearest known one is [{nearest}]")
        else:
            values[name] = entry
    known = _known()
    for key, value in values.items():
        if key not in known:
            raise BadInput(f"{path}: unknown key {key}, the nearest known one is {_nearest_key(key, known)}")
        values[key] = _checked(value, known[key], f"{path}: {key}")
    return values


def _nearest(name: str, known: list[str]) -> str:
    return difflib.get_close_matches(name, known, n=1, cutoff=0.0)[0]


def _nearest_key(key: str, every: Iterable[str]) -> str:
    """The known key most like `key`: the same name under another heading, else by likeness, its own first."""
    section, _, name = key.rpartition(".")

    def likeness(known: str) -> tuple[bool, float, bool]:
        theirs, _, last = known.rpartition(".")
        return last == name, difflib.SequenceMatcher(None, name, last).ratio(), theirs == section

    return max(every, key=likeness)


def _checked(value: Any, options: tuple[Declared, ...], where: str) -> Any:
    """`value` as an option wants it: whole numbers pass for floats, arrays become tuples, nothing else bends."""
    kinds = tuple(dict.fromkeys(kind for each in options for kind in each.kinds))
    for kind in kinds:
        if typing.get_origin(kind) is tuple:
            items = typing.get_args(kind)
            if isinstance(value, str) and "+" in options[0].option.separators:
                return options[0].from_text(value)
            if not isinstance(value, list):
                continue
            if items[-1] is Ellipsis:
                return tuple(_item(item, items[0], f"{where}[{i}]") for i, item in enumerate(value))
            if len(value) == len(items):
                return tuple(_item(item, items[i], f"{where}[{i}]") for i, item in enumerate(value))
        elif _is(value, kind):
            return float(typing.cast("float", value)) if kind is float else value
    raise BadInput(f"{where}: found {_described(value)}, expected {_expected(kinds)}")


def _is(value: Any, kind: Any) -> bool:
    return type(value) is kind or (kind is float and type(value) is int)


def _item(value: Any, kind: Any, where: str) -> Any:
    if not _is(value, kind):
        raise BadInput(f"{where}: found {_described(value)}, expected {_expected((kind,))}")
    return float(value) if kind is float else value


_WORDS = {int: "a whole number", float: "a number", str: "a string", bool: "true or false"}


def _expected(kinds: tuple[Any, ...]) -> str:
    kind = kinds[0]
    if typing.get_origin(kind) is not tuple:
        return " or ".join(_WORDS[each] for each in kinds)
    items = typing.get_args(kind)
    if items[-1] is Ellipsis:
        return f"an array, each {_WORDS[items[0]]}"
    return f"an array of {len(items)}, each {_WORDS[items[0]]}"


def _described(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f"the string {value!r}"
    if isinstance(value, list):
        return f"an array of {len(value)}"
    return "a section" if isinstance(value, dict) else f"{value!r}"
