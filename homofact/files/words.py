"""Words from elsewhere made harmless to show: names of channels, files and materials may hold anything.

A control character can move a terminal's cursor, a bidirectional one can make code read otherwise than it runs, a lone
surrogate cannot be written at all. Each is shown by its number, as JSON writes it.
"""

import re
from collections.abc import Sequence
from typing import Any

_SPACES = frozenset("\u00a0\u2007\u2009\u200a\u202f")


def harmless(text: str, keep: str = "") -> str:
    """The text with every character that is no visible one, a space, or in `keep`, as \\u and its four digits."""
    if text.isascii() and text.isprintable():
        return text
    return "".join(each if each.isprintable() or each in _SPACES or each in keep else _escaped(each) for each in text)


def harmless_words(value: Any) -> Any:
    """Return a JSON-able value with all its texts `harmless`, names of entries included; line ends are kept."""
    if isinstance(value, str):
        return harmless(value, keep="\n")
    if isinstance(value, dict):
        return {harmless_words(name): harmless_words(each) for name, each in value.items()}
    if isinstance(value, list | tuple):
        return [harmless_words(each) for each in value]
    return value


def listed(names: Sequence[str]) -> str:
    """Return names with commas; of more than eight the first, the last and how many they are."""
    shown = names if len(names) <= 8 else (names[0], "…", f"{names[-1]} ({len(names)})")
    return ", ".join(harmless(each) for each in shown)


def on_one_line(text: str) -> str:
    """Return the text `harmless` and on one line, its blanks single spaces."""
    return " ".join(harmless(" ".join(text.split())).split())


def in_markdown(text: str) -> str:
    """The text as Markdown that shows it: on one line, nothing in it a tag, a link, a table's bar or emphasis.

    An underscore between letters or digits begins no emphasis and stays.
    """
    line = on_one_line(text)
    return re.sub(
        r"[\\`*\[\]<>|]|(?<![^\W_])_|_(?![^\W_])", lambda found: f"&#{ord(found[0])};", line.replace("&", "&amp;")
    )


def _escaped(character: str) -> str:
    """By its UTF-16 units, so that the escape is the character's own in a JSON text too."""
    units = character.encode("utf-16-be", "surrogatepass")
    return "".join(f"\\u{units[k]:02x}{units[k + 1]:02x}" for k in range(0, len(units), 2))
