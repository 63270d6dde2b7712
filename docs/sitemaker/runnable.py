"""Pages whose blocks run: Python, command lines of homofact, and TOML files, each from the top of the page to its end.

```python blocks share their names, ```sh blocks hold lines that start with `homofact`, a ```toml block whose first line
is `# NAME.toml` is written to a file of that name. A ```text block right behind one of them shows what it printed.
"""

import contextlib
import io
import os
import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

_BLOCK = re.compile(r"^```(python|sh|toml)\n(.*?)^```\n(?:\n```text\n(?P<shown>.*?)^```\n)?", re.DOTALL | re.MULTILINE)
_NAMED = re.compile(r"# ([\w./-]+\.toml)\b")


@dataclass(frozen=True)
class Block:
    """A block of a page: its language, what stands in it, and where the output shown behind it stands, if any is.

    `begin` and `end` are the places in the page of the whole block, its output included.
    """

    language: str
    text: str
    shown: tuple[int, int] | None
    begin: int = 0
    end: int = 0


def blocks_of(page: str, *languages: str) -> list[Block]:
    """The blocks of a page in `languages`, or in all that run; TOML without a file's name does not."""
    found = []
    for match in _BLOCK.finditer(page):
        language, text = match[1], match[2]
        if language in (languages or ("python", "sh", "toml")) and (language != "toml" or _NAMED.match(text)):
            shown = match.span("shown") if match["shown"] is not None else None
            found.append(Block(language, text, shown, *match.span()))
    return found


def toml_name(block: Block) -> str:
    """The name of the file that a TOML block is written to."""
    named = _NAMED.match(block.text)
    assert named is not None, f"found {block.text[:40]!r}, expected a first line # NAME.toml"
    return named[1]


def run(page: Path, blocks: list[Block], names: dict[str, Any] | None = None) -> tuple[dict[str, Any], list[str]]:
    """Run the blocks in the working folder; the names that Python leaves, and what each block printed to stdout.

    Raises AssertionError for a command that ends with another code than 0.
    """
    names = {} if names is None else names
    printed = []
    for number, block in enumerate(blocks, 1):
        out = io.TextIOWrapper(io.BytesIO(), encoding="utf-8", write_through=True)
        with contextlib.redirect_stdout(out):
            if block.language == "python":
                exec(compile(block.text, f"{page.name}, block {number}", "exec"), names)
            elif block.language == "toml":
                Path(toml_name(block)).write_text(block.text, encoding="utf-8")
            else:
                for arguments in commands_in(block.text):
                    _command(page, arguments)
        out.seek(0)
        printed.append(out.read())
    return names, printed


def commands_in(block: str) -> Iterator[list[str]]:
    """The arguments of each line `homofact ...`, a backslash at its end going on. Other lines are refused."""
    for line in block.replace("\\\n", " ").splitlines():
        words = shlex.split(line, comments=True)
        if words:
            assert words[0] == "homofact", f"found {line!r}, expected a line of homofact's"
            yield words[1:]


def with_output(page: str, blocks: list[Block], printed: list[str]) -> str:
    """The page with what its blocks have printed in the places where that is shown."""
    for block, text in reversed(list(zip(blocks, printed, strict=True))):
        if block.shown is not None:
            trimmed = "\n".join(line.rstrip() for line in text.strip("\n").splitlines())
            page = f"{page[: block.shown[0]]}{trimmed}\n{page[block.shown[1] :]}"
    return page


def _command(page: Path, arguments: list[str]) -> None:
    from homofact.cli.main import main

    os.environ.setdefault("COLUMNS", "100")
    errors = io.StringIO()
    with contextlib.redirect_stderr(errors):
        code = main(arguments)
    assert code == 0, f"{page.name}: homofact {shlex.join(arguments)} ended with {code}: {errors.getvalue()[-2000:]}"
