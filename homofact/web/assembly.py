"""A self-contained HTML file of its parts: head, body, style, scripts and data, nothing loaded from anywhere.

The data are JSON in a script element, `<` written as \\u003c so that nothing in them ends it; texts are made
`harmless`. Scripts share one function's scope.
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
    """Return the text of a package's file, without the blank lines round it."""
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
    """Return the page: head.html and the `body` that goes on from it, with {{title}}, {{data}} and the like filled in.

    What pages have alike is put in first (`_pieced`). `policy` is what the page may load beside pictures in its data;
    `head` is another text than head.html; `content` is HTML that was made, in which no mark is looked for. The one
    style and the one script are allowed by their digests: nothing else in the page runs.
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
    """The text with all pieces put in, those of pieces too."""

    def piece(match: re.Match[str]) -> str:
        words = (match[2] or "").split("|")
        found = part("homofact.web", f"{match[1]}.html")
        return _pieced(re.sub(r"\{\{(\d)\}\}", lambda place: words[int(place[1]) - 1], found))

    return _PIECES.sub(piece, text)
