"""What a class of the reference has beside its methods: the fields of a dataclass, the values of an enumeration."""

import ast
import dataclasses
import re
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from sitemaker.docstrings import Entry, Section, row
from sitemaker.names import Scope
from sitemaker.signatures import linked_type, value_of

_MUTABLE = {"dict": "{}", "list": "[]"}


@dataclass(frozen=True)
class Member:
    """A field of a class: its type, what the declaration says of it, and its default in words."""

    name: str
    annotation: ast.expr | None
    words: str
    default: str


def listed(node: ast.ClassDef, scope: Scope, section: Section | None) -> str:
    """Return the fields of a class as a list under a heading; `section` of its docstring describes some of them."""
    members = {each.name: each for each in _members(node, scope)}
    entries = () if section is None else section.entries
    rows = [_described(entry, members, scope) for entry in entries]
    told = {name for entry in entries for name in _names(entry)}
    rows += [_row(each, scope) for name, each in members.items() if name not in told]
    title = section.title if section is not None else "Values" if _is_enum(node) else "Fields"
    return "\n".join([f"**{title}**", "", *rows]) if rows else ""


def has_fields(node: ast.ClassDef) -> bool:
    """Return whether the fields of a class are the arguments of its constructor."""
    return any("dataclass" in ast.unparse(each) for each in node.decorator_list) or "NamedTuple" in _bases(node)


def public_bases(node: ast.ClassDef, scope: Scope) -> list[str]:
    """Return the bases of a class as Markdown; those of a private one in its place, since its fields are listed."""
    found = []
    for base in node.bases:
        private = scope.class_named(ast.unparse(base)) if ast.unparse(base).startswith("_") else None
        found += [linked_type(base, scope)] if private is None else public_bases(private, scope)
    return list(dict.fromkeys(found))


def _names(entry: Entry) -> list[str]:
    return entry.head.split(", ")


def _described(entry: Entry, members: dict[str, Member], scope: Scope) -> str:
    """An entry of the docstring with the types and the defaults of the fields that it is about."""
    found = [members[name] for name in _names(entry) if name in members]
    defaults = [each.default for each in found]
    if len({*defaults}) > 1:
        defaults = [each.default.replace("Default", f"Default of `{each.name}`") for each in found]
    kind = entry.kind or (_type(found[0], scope) if found else "")
    more = "" if "Default:" in entry.words else " ".join(each for each in dict.fromkeys(defaults) if each)
    return row(dataclasses.replace(entry, kind=kind), False, scope, more)


def _row(member: Member, scope: Scope) -> str:
    rows = [row(Entry(member.name, _type(member, scope), member.words), False, scope, member.default)]
    for table in _tables(member.annotation, scope):
        rows += [textwrap.indent(_row(each, scope), "  ") for each in _members(table, scope)]
    return "\n".join(rows)


def _type(member: Member, scope: Scope) -> str:
    return "" if member.annotation is None else linked_type(member.annotation, scope)


def _tables(annotation: ast.expr | None, scope: Scope) -> Iterator[ast.ClassDef]:
    """The private classes in a type, whose keys are listed in the place of their names."""
    nodes = [] if annotation is None else ast.walk(annotation)
    names = dict.fromkeys(node.id for node in nodes if isinstance(node, ast.Name) and node.id.startswith("_"))
    found = map(scope.class_named, names)
    yield from (each for each in found if each is not None)


def _members(node: ast.ClassDef, scope: Scope) -> Iterator[Member]:
    """The fields in their order, first those of private bases; or the values of an enumeration."""
    if _is_enum(node):
        for each in node.body:
            if isinstance(each, ast.Assign) and isinstance(each.targets[0], ast.Name):
                yield Member(each.targets[0].id, None, f"`{ast.unparse(each.value)}`", "")
    if not has_fields(node):
        return
    options = _options(node, scope)
    for name, each in _fields(node, scope).items():
        words, default = _told(options[name]) if name in options else ("", _default(each.value, scope))
        yield Member(name, each.annotation, words, default)


def _fields(node: ast.ClassDef, scope: Scope) -> dict[str, ast.AnnAssign]:
    found: dict[str, ast.AnnAssign] = {}
    for base in (scope.class_named(name) for name in _bases(node) if name.startswith("_")):
        found |= {} if base is None else _fields(base, scope)
    for each in node.body:
        if isinstance(each, ast.AnnAssign) and not ast.unparse(each.annotation).startswith("ClassVar"):
            found[ast.unparse(each.target)] = each
    return {name: each for name, each in found.items() if not name.startswith("_")}


def _default(value: ast.expr | None, scope: Scope) -> str:
    """A default in words; none for a private class."""
    given: dict[str | None, ast.expr | None] = {"default": value}
    if isinstance(value, ast.Call) and ast.unparse(value.func) == "field":
        given = {each.arg: each.value for each in value.keywords}
    factory, default = given.get("default_factory"), given.get("default")
    told = "" if default is None else ast.unparse(value_of(default, scope))
    if factory is not None:
        told = _MUTABLE.get(ast.unparse(factory), f"{ast.unparse(factory)}()")
    return f"Default: `{told}`." if told and not re.search(r"(?<!\w)_[A-Za-z]", told) else ""


def _options(node: ast.ClassDef, scope: Scope) -> dict[str, dataclasses.Field[Any]]:
    """The fields that declare options. The class is imported, because functions compute their help and defaults."""
    calls = (each.value for each in _fields(node, scope).values() if isinstance(each.value, ast.Call))
    if all(ast.unparse(call.func) == "field" for call in calls):
        return {}  # not loaded for nothing
    settings = getattr(import_module(scope.module), node.name)
    return {each.name: each for each in dataclasses.fields(settings) if "option" in each.metadata}


def _told(declared: dataclasses.Field[Any]) -> tuple[str, str]:
    """The help and the default of an option, in words."""
    option = declared.metadata["option"]
    words = f"{option.help}."
    if option.choices:
        words += f" One of {', '.join(f'`{choice!r}`' for choice in option.choices)}."
    if option.unit:
        words += f" Unit: {option.unit}."
    if declared.default is dataclasses.MISSING:
        return words, "Required." if declared.default_factory is dataclasses.MISSING else ""
    if declared.default is None:
        meaning = f" ({option.none})" if option.none not in ("", "none") else ""
        return words, "" if "Default:" in words else f"Default: `None`{meaning}."
    return words, f"Default: `{declared.default!r}`."


def _bases(node: ast.ClassDef) -> list[str]:
    return [ast.unparse(base) for base in node.bases]


def _is_enum(node: ast.ClassDef) -> bool:
    return bool({"Enum", "IntEnum", "StrEnum"} & {*_bases(node)})
