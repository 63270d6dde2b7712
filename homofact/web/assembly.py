"""Assemble a self-contained HTML file from head, body, style, scripts and data; it loads no other file.

The data are JSON in a script element. They contain `<` only as \\u003c, so that no text can end the element, and all
strings are `harmless`. All scripts share the scope of one function.
"""

import html
import json
import re
from collections.abc import Sequence
from functools import cache
from importlib.resources import files
from typing import Any

from homofact.files.template import BRACES, filled, source_digest
from homofact.files.words import harmless, harmless_words
from homofact.version import __version__

# Pieces of pages: {{choice tones|Tones}} is choice.html with these two words as its {{1}} and {{2}}.
_PIECES = re.compile(r"\{\{(start|choice|exposure|help|end|scripts)(?: ([^{}]*))?\}\}")


@cache
def part(package: str, name: str) -> str:
    """Return the text of a package's file, without blank space at its start and end."""
    return files(package).joinpath(name).read_text(encoding="utf-8").strip()


def assembled(
    body: str,
    *,
    title: str,
    subtitle: str,
    styles: Sequence[str],
    scripts: Sequence[str],
    data: dict[str, Any],
    policy: str = "",
    head: str | None = None,
    content: str = "",
) -> str:
    """Return the page: head.html followed by `body`, with {{title}}, {{data}} and the other placeholders filled in.

    Shared pieces of pages are inserted first (`_pieced`). `policy` lists what the page may load besides pictures in its
    data. `head` replaces head.html. `content` is generated HTML, in which placeholders are not filled in. The
    Content-Security-Policy allows the one style and the one script by their digests, so nothing else in the page runs.
    """
    # In JSON a letter may be written by its number: the text can then neither end nor open anything in HTML.
    text = json.dumps(harmless_words(data), ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    style = "\n" + "\n".join(styles) + "\n"
    script = '\n(() => {\n"use strict";\n' + "\n".join(scripts) + "\n})();\n"
    fill = {
        "style_digest": source_digest(style),
        "script_digest": source_digest(script),
        "policy": policy,
        "generator": f"homofact {__version__}",
        "title": html.escape(harmless(title)),
        "subtitle": html.escape(harmless(subtitle)),
        "css": style,
        "data": text.replace("<", "\\u003c"),
        "script": script,
        "content": content,
    }
    return filled(_pieced(f"{head or part('homofact.web', 'head.html')}\n{body}"), BRACES, fill)


def _pieced(text: str) -> str:
    """Return the text with all shared pieces inserted, also those within pieces."""

    def piece(match: re.Match[str]) -> str:
        words = (match[2] or "").split("|")
        found = part("homofact.web", f"{match[1]}.html")
        return _pieced(re.sub(r"\{\{(\d)\}\}", lambda place: words[int(place[1]) - 1], found))

    return _PIECES.sub(piece, text)
