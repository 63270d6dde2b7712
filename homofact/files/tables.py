"""A TOML table into a frozen dataclass, strictly, by the dataclass's own type hints.

A field of another dataclass is a section, one of a tuple of them an array of sections ([[name]]), one of both whichever
stands there; numbers, texts, true or false, tuples of these and alternatives (`int | None`) are values. Whole numbers
pass for floats and arrays become tuples, nothing else bends. What is wrong is said with its place, what was found and
what is expected:

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
class Limits:
    """What a field's number may be."""

    least: float = -math.inf
    most: float = math.inf
    above: float = -math.inf

    def allow(self, value: float) -> bool:
        """Whether a number is within them, and finite."""
        # Compared, since a whole number may be beyond every float.
        return -math.inf < value < math.inf and self.above < value and self.least <= value <= self.most

    def words(self) -> str:
        """For an error, after the kind of number."""
        bounds = ((self.above, "above"), (self.least, "of at least"), (self.most, "at most"))
        return " and ".join(f"{word} {bound:g}" for bound, word in bounds if math.isfinite(bound)) or "that is finite"


def limits(least: float = -math.inf, most: float = math.inf, above: float = -math.inf) -> dict[str, Any]:
    """Metadata of a field whose numbers are finite, at least `least`, at most `most`, and above `above`."""
    return {_LIMITS: Limits(least, most, above)}


def read_table(cls: type[T], table: Mapping[str, Any], place: str = "") -> T:
    """The dataclass that a whole table says; `place` ("scene.toml: ") goes before every message.

    Raises BadInput for an unknown key (naming the nearest), a missing one without a default, a value of the wrong type
    or outside its limits, and what `cls` and its parts refuse themselves.
    """
    return _Reader(place, keys_of(cls)).build(cls, table, "")


def plain_value(value: Any, kinds: Sequence[Any], where: str, allowed: Limits | None = None) -> Any:
    """`value` as the first of `kinds` that it is one of: int, float, str, bool, or tuples of these.

    Raises BadInput, beginning with `where`, for a value of no such kind, and a number that is not `allowed`.
    """
    for kind in kinds:
        if typing.get_origin(kind) is tuple and isinstance(value, list):
            items = typing.get_args(kind)
            hints = [items[0]] * len(value) if items[-1] is Ellipsis else items
            if len(hints) == len(value):
                pairs = enumerate(zip(value, hints, strict=True))
                return tuple(plain_value(each, (hint,), f"{where}[{k}]", allowed) for k, (each, hint) in pairs)
        found: Any = float(value) if kind is float and type(value) is int and abs(value) < 2**1023 else value
        if type(found) is kind and (allowed is None or allowed.allow(found)):
            return found
    expected = " or ".join(_words(kind, allowed) for kind in kinds)
    raise BadInput(f"{where}: found {described(value)}, expected {expected}")


def keys_of(cls: type[Any], name: str = "") -> list[str]:
    """The dotted keys of a dataclass under `name`, its sections and their keys among them."""
    keys = []
    for field, hint in typing.get_type_hints(cls).items():
        key = _joined(name, field)
        section = _section_in(hint)
        keys += [key] if section is None else [key, *keys_of(section, key)]
    return keys


def kinds_of(hint: Any) -> tuple[Any, ...]:
    """The alternatives of a type hint but None, which no table can hold."""
    either = typing.get_args(hint) if isinstance(hint, types.UnionType) else (hint,)
    return tuple(option for option in either if option is not type(None))


def nearest_key(key: str, known: Sequence[str]) -> str:
    """The known key whose last name is most like that of `key`, under any heading; of equals that under its own."""
    section, _, name = re.sub(r"\[\d+\]", "", key).rpartition(".")

    def likeness(candidate: str) -> tuple[float, bool]:
        theirs, _, last = candidate.rpartition(".")
        return difflib.SequenceMatcher(None, name, last).ratio(), theirs == section

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
        """The `cls` of section `name`."""
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
        """What section `name` says, by the fields of `cls`."""
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
        """One entry as its field's type hint wants it."""
        section = _section_in(hint)
        if section is None:
            return plain_value(value, kinds_of(hint), f"{self.place}{name}", field.metadata.get(_LIMITS))
        if section in kinds_of(hint) and not (isinstance(value, list) and len(kinds_of(hint)) > 1):
            return self.build(section, value, name)
        if not isinstance(value, list):
            self.refuse(name, described(value), _expected(hint, field))
        return tuple(self.build(section, each, f"{name}[{k}]") for k, each in enumerate(value))

    def refuse(self, name: str, found: str, expected: str) -> NoReturn:
        """Raise BadInput for what stands at `name`."""
        raise BadInput(f"{self.place}{name}: found {found}, expected {expected}")

    def refuse_unknown(self, key: str, value: Any, sections: list[str]) -> NoReturn:
        """Raise BadInput for a key that means nothing; `sections` are those that a table in its place may be."""
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


def _section_in(hint: Any) -> type[Any] | None:
    """The dataclass that a hint asks for, alone or in a tuple; None where it asks for plain values."""
    for option in kinds_of(hint):
        inner = typing.get_args(option)[0] if typing.get_origin(option) is tuple else option
        if isinstance(inner, type) and dataclasses.is_dataclass(inner):
            return inner
    return None


def _expected(hint: Any, field: "dataclasses.Field[Any]") -> str:
    """What a field's value should have been, in words."""
    section = _section_in(hint)
    if section is not None:
        return f"a section [{field.name}]" if section in kinds_of(hint) else f"sections [[{field.name}]]"
    return " or ".join(_words(kind, field.metadata.get(_LIMITS)) for kind in kinds_of(hint))


def _words(kind: Any, allowed: Limits | None) -> str:
    if typing.get_origin(kind) is tuple:
        items = typing.get_args(kind)
        return f"an array{'' if items[-1] is Ellipsis else f' of {len(items)}'}, each {_words(items[0], allowed)}"
    return _WORDS[kind] if allowed is None else f"{_WORDS[kind]} {allowed.words()}"
