"""Read a TOML table strictly into a frozen dataclass, by the declarations of its fields (`settings.options`).

A field whose type is a dataclass is a section ([name]). A field whose type is a tuple of dataclasses is an array of
sections ([[name]]). If the type allows both, the file may contain either. Every other field is a value. A field
`Mapping[str, Any]` collects the keys that no other field has. An error names the place, what was found and what is
expected:

    scene.toml: budget.bytes: found 1, expected a whole number of at least 4
    scene.toml: lighting.name: unknown key (nearest: lighting.named)

`INSTEAD` of a dataclass contains hints, by name, for keys that users may expect but that do not exist.

If a dataclass's `__post_init__` raises BadInput for one of its fields, the reader puts the section's place in front of
the field.
"""

import dataclasses
import re
import typing
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from types import UnionType
from typing import Any, NoReturn, TypeVar

from homofact.errors import BadInput
from homofact.settings.options import declared, described

T = TypeVar("T")


def read_table(
    cls: type[T], table: Mapping[str, Any], place: str | Callable[[str], str] = "", also: Iterable[str] = ()
) -> T:
    """Return the dataclass for a whole table.

    `place` is the prefix of every message ("scene.toml: "), or a function that returns the place of a dotted key.
    `also` are further known dotted keys. Raises BadInput for an unknown key (naming the nearest), a missing key without
    a default, a value of the wrong type or out of its range, and for errors that `cls` or its sections raise.
    """
    where = place if callable(place) else lambda key: f"{place}{key}"
    return _Reader(where, [*also, *keys_of(cls)]).build(cls, table, "")


def keys_of(cls: type[Any], name: str = "") -> list[str]:
    """Return the dotted keys of a dataclass under `name`, including its sections and their keys."""
    keys = []
    for field, hint in typing.get_type_hints(cls).items():
        key = _joined(name, field)
        section = section_in(hint)
        if not is_rest(hint):
            keys += [key] if section is None else [key, *keys_of(section, key)]
    return keys


def unknown_key(key: str, own: Iterable[str], known: Iterable[str], where: str, what: str = "key") -> BadInput:
    """Return the error for an unknown key, which names the key that was probably meant.

    This is a similar name in the same section (`own` are its names), or the same name in another section (`known` are
    all dotted keys). If there is none, the error lists the section's keys.
    """
    section, _, name = re.sub(r"\[\d+\]", "", key).rpartition(".")
    own = list(own)
    near = [_joined(section, each) for each in get_close_matches(name, own, n=1, cutoff=0.6)]
    near += [each for each in known if each.rpartition(".")[2] == name]
    if near:
        return BadInput(f"unknown {what}", where=where, hint=f"nearest: {near[0]}")
    return BadInput(f"unknown {what}", where=where, expected=f"one of {', '.join(own)}")


@dataclass(frozen=True)
class _Reader:
    """`place` says where a dotted key is; `known` are all dotted keys, one of which a misspelt one means."""

    place: Callable[[str], str]
    known: list[str]

    def build(self, cls: type[T], table: Any, name: str) -> T:
        """Return the `cls` of section `name`."""
        values = self.values(cls, table, name)
        for field, hint in _fields(cls):
            if field.name not in values and field.default is field.default_factory is dataclasses.MISSING:
                self.refuse(_joined(name, field.name), "nothing", _expected(hint, field))
        try:
            return cls(**values)
        except BadInput as error:
            first = re.match(r"\w*", error.where)
            rest = next((values[field.name] for field, hint in _fields(cls) if is_rest(hint)), {})
            if first is not None and first[0] in {*rest, *(field.name for field, _ in _fields(cls))}:
                raise error.moved_to(self.place(_joined(name, error.where))) from error
            place = self.place(name).removesuffix(": ")
            raise (error.at(place) if place else error) from error

    def values(self, cls: type[Any], table: Any, name: str) -> dict[str, Any]:
        """Return what section `name` says, by the fields of `cls`."""
        fields = {field.name: (field, hint) for field, hint in _fields(cls) if not is_rest(hint)}
        if not isinstance(table, Mapping):
            expected = f"a table of {', '.join(fields)}" if name.endswith("]") else f"a section [{name}]"
            self.refuse(name, described(table), expected)
        rest = next((field.name for field, hint in _fields(cls) if is_rest(hint)), None)
        others = {key: value for key, value in table.items() if key not in fields}
        if others and rest is None:
            last, value = next(iter(others.items()))
            key, what = _joined(name, last), "section" if isinstance(value, Mapping) else "key"
            instead = getattr(cls, "INSTEAD", {}).get(last)
            if instead is not None:
                raise BadInput(f"unknown {what}", where=self.place(key), hint=instead)
            raise unknown_key(key, fields, self.known, self.place(key), what)
        found = {
            key: self.value(value, *fields[key], _joined(name, key)) for key, value in table.items() if key in fields
        }
        return found if rest is None else found | {rest: others}

    def value(self, value: Any, field: "dataclasses.Field[Any]", hint: Any, name: str) -> Any:
        """Return one entry as its field declares it."""
        section = section_in(hint)
        if section is None:
            return declared(field, hint).read(value, self.place(name))
        if section in types_in(hint) and not (isinstance(value, list) and len(types_in(hint)) > 1):
            return self.build(section, value, name)
        if not isinstance(value, list):
            self.refuse(name, described(value), _expected(hint, field))
        return tuple(self.build(section, each, f"{name}[{k}]") for k, each in enumerate(value))

    def refuse(self, name: str, found: str, expected: str) -> NoReturn:
        """Raise BadInput for what is at `name`."""
        raise BadInput(where=self.place(name), found=found, expected=expected)


def _joined(name: str, key: str) -> str:
    return f"{name}.{key}" if name else key


def _fields(cls: type[Any]) -> "list[tuple[dataclasses.Field[Any], Any]]":
    """The fields of a dataclass with their resolved type hints."""
    hints = typing.get_type_hints(cls)
    return [(field, hints[field.name]) for field in dataclasses.fields(cls)]


def types_in(hint: Any) -> tuple[Any, ...]:
    """Return the alternatives of a type hint except None, which does not exist in TOML."""
    either = typing.get_args(hint) if isinstance(hint, UnionType) else (hint,)
    return tuple(kind for kind in either if kind is not type(None))


def is_rest(hint: Any) -> bool:
    """Return whether a field collects the keys that no other field has."""
    return typing.get_origin(hint) is Mapping


def section_in(hint: Any) -> type[Any] | None:
    """Return the dataclass that a hint asks for, alone or in a tuple; None where it asks for plain values."""
    for kind in types_in(hint):
        inner = typing.get_args(kind)[0] if typing.get_origin(kind) is tuple else kind
        if isinstance(inner, type) and dataclasses.is_dataclass(inner):
            return inner
    return None


def _expected(hint: Any, field: "dataclasses.Field[Any]") -> str:
    """What a field's value should have been, in words."""
    section = section_in(hint)
    if section is not None:
        return f"a section [{field.name}]" if section in types_in(hint) else f"sections [[{field.name}]]"
    return declared(field, hint).expected
