"""Docstrings as Markdown: numpy's sections as lists, examples and code as blocks, names as links to their pages."""

import ast
import re
import textwrap
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass

from sitemaker.modules import module_pages
from sitemaker.names import CONSTANT, Scope

NOTHING = Scope("", {})
_HEADING = re.compile(r"^(\S[^\n]*)\n-{3,}$", re.MULTILINE)
_COLUMNS = re.compile(r"\S {3,}\S")
# Sections whose entries begin with a type; those of others begin with names.
_TYPED = {"Returns", "Raises", "Yields"}
# A line is filled to about this column, so a type is over where the next word would have fitted.
_FILLED = 90


@dataclass(frozen=True)
class Entry:
    """An entry of a section: `head` has its names, or its type, `kind` the type of the names."""

    head: str
    kind: str
    words: str


@dataclass(frozen=True)
class Section:
    """A section of a docstring: its entries, and the paragraphs after them."""

    title: str
    entries: tuple[Entry, ...]
    rest: str


def markdown(text: str, scope: Scope = NOTHING, returned: str = "") -> str:
    """Return a docstring as Markdown; `returned` is the return type, which precedes a section Returns without one."""
    prose, sections = parsed(text)
    parts = [blocks(prose, scope), *(shown(each, scope, returned) for each in sections)]
    return "\n\n".join(part for part in parts if part)


def parsed(text: str) -> tuple[str, list[Section]]:
    """Return the paragraphs of a docstring before its first section, and its sections."""
    prose, *parts = _HEADING.split(text)
    return prose.strip("\n"), [_section(*each) for each in zip(parts[::2], parts[1::2], strict=True)]


def shown(section: Section, scope: Scope, returned: str = "") -> str:
    """Return a section as Markdown."""
    rest = blocks(section.rest, scope)
    if section.title == "Returns" and returned and not section.entries:
        rest = f"{returned}: {rest}"
    rows = "\n".join(row(each, section.title in _TYPED, scope) for each in section.entries)
    return "\n\n".join(part for part in (f"**{section.title}**", rows, rest) if part)


def row(entry: Entry, typed: bool, scope: Scope, more: str = "") -> str:
    """Return an entry as an item of a list; `more` is appended."""
    head = _head_words(entry.head, scope) if typed else ", ".join(f"`{name}`" for name in entry.head.split(", "))
    kind = f" ({type_words(entry.kind, scope)})" if entry.kind else ""
    words = textwrap.indent(linked(entry.words, scope), "  ").strip()
    return f"- {head}{kind}" + (f": {words}" if words else "." if more else "") + (f" {more}" if more else "")


def type_words(text: str, scope: Scope) -> str:
    """Return a type in words, "tuple of Run", with links to its classes that have pages."""

    def link(match: re.Match[str]) -> str:
        path = scope.described(match[0])
        return match[0] if path is None else f"{{pytype}}`{path}`"

    return re.sub(r"(?<![\"\w.])[A-Z][A-Za-z]+(?![\"\w])", link, text)


def blocks(text: str, scope: Scope) -> str:
    """Return paragraphs as Markdown: examples and code as fenced blocks."""
    found: list[tuple[str, str]] = []
    for paragraph in _paragraphs(text):
        language = _language(paragraph)
        code = textwrap.dedent(paragraph)
        if language and language != "pycon" and found and found[-1][0] == language:
            found[-1] = language, f"{found[-1][1]}\n\n{code}"
        else:
            found.append((language, code if language else linked(paragraph, scope)))
    return "\n\n".join(f"```{language}\n{part}\n```" if language else part for language, part in found)


def linked(text: str, scope: Scope) -> str:
    """Return prose with links from names in code to their pages, constants with their values, and stars as they are."""
    parts = re.split(r"(`[^`\n]+`)", text)
    return "".join(_code(each[1:-1], scope) if number % 2 else _plain(each) for number, each in enumerate(parts))


def _head_words(text: str, scope: Scope) -> str:
    """A type in words; one that is the name of a class without a page is code."""
    found = type_words(text, scope)
    return f"`{text}`" if found == text and re.fullmatch(r"[A-Z]\w+", text) else found


def _plain(text: str) -> str:
    return re.sub(r"^#", r"\\#", re.sub(r"(?<![*\w])\*(?=\w)", r"\\*", text), flags=re.MULTILINE)


def _code(word: str, scope: Scope) -> str:
    value = scope.constant(word) if CONSTANT.fullmatch(word) else None
    if value is not None:
        return f"`{value}`" if word.startswith("_") else f"`{word} = {value}`"
    if re.fullmatch(r"\w+(\.\w+)*", word) and (word[0].isupper() or "." in word):
        page = module_pages().get(f"homofact.{word.removeprefix('homofact.')}")
        path = scope.described(word) or scope.described(f"homofact.{word}")
        if path is not None:
            return f"{{py:obj}}`{word} <{path}>`"
        if page is not None:
            return f"[`{word}`](/{page}.md)"
    return f"`{word}`"


def _section(title: str, text: str) -> Section:
    entries, *rest = re.split(r"\n\n(?=\S)", text.strip("\n"), maxsplit=1)
    if title == "Examples" or not re.search(r"^ +\S| : ", entries, re.MULTILINE):
        return Section(title, (), text.strip("\n"))
    return Section(title, tuple(map(_entry, re.split(r"\n(?=\S)", entries))), "".join(rest))


def _entry(text: str) -> Entry:
    line, _, body = text.partition("\n")
    head, colon, kind = line.partition(" : ")
    words = textwrap.dedent(body)
    goes_on = line.endswith((",", ";")) or len(line) + len(words.split(" ")[0]) >= _FILLED
    if colon and (not words or goes_on):
        return Entry(head, "", f"{kind}\n{words}".strip())
    return Entry(head, kind, words)


def _paragraphs(text: str) -> Iterator[str]:
    """The paragraphs of a text; an example is one of its own."""
    for part in re.split(r"\n\s*\n", text):
        for each in re.split(r"\n(?=>>> )", part, maxsplit=1) if not part.startswith(">>> ") else [part]:
            if each.strip():
                yield each


def _language(paragraph: str) -> str:
    """The language of a paragraph of code: one that is indented, in columns, or Python or TOML by its syntax."""
    if paragraph.startswith(">>> "):
        return "pycon"
    code = textwrap.dedent(paragraph)
    if _is_toml(code):
        return "toml"
    if _is_python(code):
        return "python"
    lines = paragraph.split("\n")
    columns = all(_COLUMNS.search(line) or line.startswith(" ") for line in lines)
    return "text" if columns or paragraph.startswith("    ") else ""


def _is_toml(code: str) -> bool:
    try:
        return tomllib.loads(code) != {}
    except tomllib.TOMLDecodeError:
        return False


def _is_python(code: str) -> bool:
    """Whether it is Python that does something; a text of one word is Python too."""
    try:
        nodes = ast.parse(code).body
    except SyntaxError:
        return False
    calls = (isinstance(node, ast.Expr) and isinstance(node.value, ast.Call) for node in nodes)
    return any(calls) or any(isinstance(node, ast.Assign | ast.Import | ast.ImportFrom) for node in nodes)
