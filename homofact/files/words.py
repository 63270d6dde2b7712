"""Make untrusted words harmless to print: names of channels, files and materials may contain anything.

A control character can move a terminal's cursor. A bidirectional character can make code look different from what it
runs. A lone surrogate cannot be written at all. Each of them is replaced by its escape code, as in JSON.
"""

import re
from collections.abc import Sequence
from typing import Any

_SPACES = frozenset("\u00a0\u2007\u2009\u200a\u202f")


def harmless(text: str, keep: str = "") -> str:
    """Return the text with all but visible characters, spaces and those in `keep` as \\u and its four digits."""
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
    """Join names with commas; of more than eight, show only the first, the last and the number of names."""
    shown = names if len(names) <= 8 else (names[0], "…", f"{names[-1]} ({len(names)})")
    return ", ".join(harmless(each) for each in shown)


def on_one_line(text: str) -> str:
    """Return the text `harmless` and on one line, its blanks single spaces."""
    return " ".join(harmless(" ".join(text.split())).split())


def in_markdown(text: str) -> str:
    """Escape a text for Markdown, on one line, so that it contains no tag, link, table bar or emphasis.

    An underscore between letters or digits stays, because it does not begin emphasis.
    """
    line = on_one_line(text)
    return re.sub(
        r"[\\`*\[\]<>|]|(?<![^\W_])_|_(?![^\W_])", lambda found: f"&#{ord(found[0])};", line.replace("&", "&amp;")
    )


def _escaped(character: str) -> str:
    """By its UTF-16 units, so that the escape is the character's own in a JSON text too."""
    units = character.encode("utf-16-be", "surrogatepass")
    return "".join(f"\\u{units[k]:02x}{units[k + 1]:02x}" for k in range(0, len(units), 2))
