"""The JSON Schema of a TOML file, from the dataclass that it is read into, for editors that complete and check keys.

A schema contains what `settings.tables` checks for each key: sections, types, choices and ranges, with the help of
every key. It does not contain conditions between two keys, or the additional checks of a field; only the program checks
these.
"""

import dataclasses
import typing
from collections.abc import Mapping
from typing import Any

from homofact.settings.options import Declared, declared
from homofact.settings.tables import is_rest, section_in, types_in

DRAFT = "https://json-schema.org/draft/2020-12/schema"
_PLAIN = {bool: "boolean", int: "integer", float: "number", str: "string"}


def schema_of(cls: type[Any], title: str, rests: Mapping[type, Mapping[str, Any]] | None = None) -> dict[str, Any]:
    """Return the schema of a file with this dataclass as its whole table.

    `rests` maps dataclasses to additional properties, for sections that accept keys which are not fields.
    """
    return {"$schema": DRAFT, "title": title, **_section(cls, rests or {})}


def value_schema(own: Declared) -> dict[str, Any]:
    """Return the schema of one value: alternatives where it may be of several types."""
    kinds = [_kind(own, kind) for kind in own.kinds]
    if own.is_list and "+" in own.option.separators:
        kinds.append({"type": "string"})
    found: dict[str, Any] = kinds[0] if len(kinds) == 1 else {"anyOf": kinds}
    said = own.option.help + (f" ({own.option.unit})" if own.option.unit else "")
    if said:
        found = {"description": said, **found}
    if own.default is not None and own.default is not dataclasses.MISSING:
        found["default"] = list(own.default) if isinstance(own.default, tuple) else own.default
    return found


def _kind(own: Declared, kind: Any) -> dict[str, Any]:
    given = own.option
    if typing.get_origin(kind) is tuple:
        items = typing.get_args(kind)
        found: dict[str, Any] = {"type": "array", "items": _kind(own, items[0])}
        return found if items[-1] is Ellipsis else found | {"minItems": len(items), "maxItems": len(items)}
    found = {"type": _PLAIN[kind]}
    if kind is str and given.choices:
        found["enum"] = list(given.choices)
    if kind in (int, float):
        ends = {
            "minimum": given.least, "exclusiveMinimum": given.above, "maximum": given.most,
            "exclusiveMaximum": given.below,
        }  # fmt: skip
        found |= {name: end for name, end in ends.items() if end is not None}
    return found


def _section(cls: type[Any], rests: Mapping[type, Mapping[str, Any]]) -> dict[str, Any]:
    hints = typing.get_type_hints(cls)
    properties: dict[str, Any] = {}
    needed = []
    for each in dataclasses.fields(cls):
        hint = hints[each.name]
        if is_rest(hint):
            continue
        if each.default is each.default_factory is dataclasses.MISSING:
            needed.append(each.name)
        section = section_in(hint)
        if section is None:
            properties[each.name] = value_schema(declared(each, hint))
            continue
        made = _section(section, rests)
        ways = [made if kind is section else {"type": "array", "items": made} for kind in types_in(hint)]
        properties[each.name] = ways[0] if len(ways) == 1 else {"anyOf": ways}
    properties |= rests.get(cls, {})
    found = {"type": "object", "properties": properties, "additionalProperties": False}
    return found | ({"required": needed} if needed else {})
