"""A TOML table into a frozen dataclass, strictly, by the dataclass's own type hints.

A field of another dataclass is a section, one of a tuple of them an array of sections ([[name]]); numbers, texts,
true or false, tuples of these and alternatives (`int | None`) are values. Whole numbers pass for floats and arrays
become tuples, nothing else bends. What is wrong is said with its place, what was found and what is expected:

    scene.toml: budget.bytes: found 1, expected a whole number of at least 4
    scene.toml: unknown key lighting.name, the nearest known one is lighting.named

What a number may be stands in the field's metadata (`limits`). What a dataclass refuses itself, in its `__post_init__`,
gets the place before it: a message that begins with a field's name ("size: found …") that field's, another one the
section's.
"""

import dataclasses
import difflib
import math
import re
import types
import typing
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NoReturn, TypeVar

from homofact.errors import BadInput

T = TypeVar("T")
_LIMITS = "limits"
_WORDS = {int: "a whole number", float: "a number", str: "a string", bool: "true or false"}


@dataclass(frozen=True)
class _Limits:
    """What a field's number may be."""

    least: float = -math.inf
    most: float = math.inf
    above: float = -math.inf

    def allow(self, value: float) -> bool:
        return math.isfinite(value) and self.above < value and self.least <= value <= self.most

    def words(self) -> str:
        bounds = ((self.above, "above"), (self.least, "of at least"), (self.most, "at most"))
        return " and ".join(f"{word} {bound:g}" for bound, word in bounds if math.isfinite(bound)) or "that is finite"


def limits(least: float = -math.inf, most: float = math.inf, above: float = -math.inf) -> dict[str, Any]:
    """Metadata of a field whose numbers are finite, at least `least`, at most `most`, and above `above`."""
    return {_LIMITS: _Limits(least, most, above)}


def read_table(cls: type[T], table: Mapping[str, Any], place: str = "") -> T:
    """The dataclass that a whole table says; `place` ("scene.toml: ") goes before every message.

    Raises BadInput for an unknown key (naming the nearest), a missing one without a default, a value of the wrong type
    or outside its limits, and what `cls` and its parts refuse themselves.
    """
    return _Reader(place, keys_of(cls)).build(cls, table, "")


def values_of(cls: type[Any], table: Any, place: str, name: str, known: Sequence[str]) -> dict[str, Any]:
    """The checked values that section `name` has for fields of `cls`, which is not made; errors as `read_table`.

    For a table that says only a part of what `cls` is made from. `known` are all keys that a misspelt one may mean.
    """
    return _Reader(place, known).values(cls, table, name)


def keys_of(cls: type[Any], name: str = "") -> list[str]:
    """The dotted keys of a dataclass under `name`, its sections and their keys among them."""
    keys = []
    for field, hint in typing.get_type_hints(cls).items():
        key = _joined(name, field)
        section = _section_in(hint)
        keys += [key] if section is None else [key, *keys_of(section, key)]
    return keys


def nearest_key(key: str, known: Sequence[str]) -> str:
    """The known key most like `key`: the same name under another heading, else by likeness, its own heading first."""
    section, _, name = re.sub(r"\[\d+\]", "", key).rpartition(".")

    def likeness(candidate: str) -> tuple[bool, float, bool]:
        theirs, _, last = candidate.rpartition(".")
        return last == name, difflib.SequenceMatcher(None, name, last).ratio(), theirs == section

    return max(known, key=likeness)


def described(value: Any) -> str:
    """What was found, in words."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f"the string {value!r}"
    if isinstance(value, list):
        return f"an array of {len(value)}"
    return "a section" if isinstance(value, Mapping) else f"{value!r}"


@dataclass(frozen=True)
class _Reader:
    """`place` goes before every message; `known` are all dotted keys, one of which a misspelt one means."""

    place: str
    known: Sequence[str]

    def build(self, cls: type[T], table: Any, name: str) -> T:
        values = self.values(cls, table, name)
        for field, hint in _fields(cls):
            if field.name not in values and field.default is field.default_factory is dataclasses.MISSING:
                self.refuse(_joined(name, field.name), "nothing", _expected(hint, field))
        try:
            return cls(**values)
        except BadInput as error:
            is_field = str(error).partition(":")[0] in (field.name for field, _ in _fields(cls))
            where = "" if not name else f"{name}." if is_field else f"{name}: "
            raise BadInput(f"{self.place}{where}{error}") from error

    def values(self, cls: type[Any], table: Any, name: str) -> dict[str, Any]:
        fields = {field.name: (field, hint) for field, hint in _fields(cls)}
        if not isinstance(table, Mapping):
            expected = f"a table of {', '.join(fields)}" if name.endswith("]") else f"a section [{name}]"
            self.refuse(name, described(table), expected)
        for key, value in table.items():
            if key not in fields:
                self.refuse_unknown(
                    _joined(name, key), value, [k for k, (_, hint) in fields.items() if _section_in(hint)]
                )
        return {key: self.value(value, *fields[key], _joined(name, key)) for key, value in table.items()}

    def value(self, value: Any, field: "dataclasses.Field[Any]", hint: Any, name: str) -> Any:
        for option in _options(hint):
            if isinstance(option, type) and dataclasses.is_dataclass(option):
                return self.build(option, value, name)
            if typing.get_origin(option) is tuple and isinstance(value, list):
                hints = _hints_of_items(option, len(value))
                if len(hints) == len(value):
                    return tuple(
                        self.value(v, field, h, f"{name}[{k}]")
                        for k, (v, h) in enumerate(zip(value, hints, strict=True))
                    )
            found = float(value) if option is float and type(value) is int else value
            allowed = field.metadata.get(_LIMITS)
            if type(found) is option and (allowed is None or allowed.allow(found)):
                return found
        self.refuse(name, described(value), _expected(hint, field))

    def refuse(self, name: str, found: str, expected: str) -> NoReturn:
        raise BadInput(f"{self.place}{name}: found {found}, expected {expected}")

    def refuse_unknown(self, key: str, value: Any, sections: list[str]) -> NoReturn:
        if isinstance(value, Mapping) and sections:
            nearest = nearest_key(key, sections)
            raise BadInput(f"{self.place}unknown section [{key}], the nearest known one is [{nearest}]")
        raise BadInput(f"{self.place}unknown key {key}, the nearest known one is {nearest_key(key, self.known)}")


def _joined(name: str, key: str) -> str:
    return f"{name}.{key}" if name else key


def _fields(cls: type[Any]) -> "list[tuple[dataclasses.Field[Any], Any]]":
    """The fields of a dataclass with their resolved type hints."""
    hints = typing.get_type_hints(cls)
    return [(field, hints[field.name]) for field in dataclasses.fields(cls)]


def _options(hint: Any) -> tuple[Any, ...]:
    """The alternatives of a hint; None is no value that a table could hold."""
    either = typing.get_args(hint) if isinstance(hint, types.UnionType) else (hint,)
    return tuple(option for option in either if option is not type(None))


def _hints_of_items(option: Any, count: int) -> list[Any]:
    """The hints of an array's items, as many as the tuple wants: `count` where it takes any number."""
    items = typing.get_args(option)
    return [items[0]] * count if items[-1] is Ellipsis else list(items)


def _section_in(hint: Any) -> type[Any] | None:
    """The dataclass that a hint asks for, alone or in a tuple; None where it asks for plain values."""
    for option in _options(hint):
        inner = typing.get_args(option)[0] if typing.get_origin(option) is tuple else option
        if isinstance(inner, type) and dataclasses.is_dataclass(inner):
            return inner
    return None


def _expected(hint: Any, field: "dataclasses.Field[Any]") -> str:
    """What a field's value should have been, in words."""
    allowed = field.metadata.get(_LIMITS)

    def words(option: Any) -> str:
        if typing.get_origin(option) is tuple:
            items = typing.get_args(option)
            if _section_in(option) is not None:
                return f"sections [[{field.name}]]"
            return f"an array{'' if items[-1] is Ellipsis else f' of {len(items)}'}, each {words(items[0])}"
        if option not in _WORDS:
            return f"a section [{field.name}]"
        return _WORDS[option] if allowed is None else f"{_WORDS[option]} {allowed.words()}"

    return " or ".join(words(option) for option in _options(hint))
