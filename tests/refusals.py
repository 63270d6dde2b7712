"""Bad input refused: its fields are asserted where it happens, its wording is pinned in one catalogue.

`messages/catalogue.txt` has every message that a `refused` of the suite has seen, by the package that raises it, to be
read from top to bottom. A message that is not in it fails its test. After rewording, `pytest --write-messages` adds the
messages of the tests that it runs; delete the file before a run of all tests to make it anew.
"""

import fcntl
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

import pytest

from homofact.errors import BadInput

CATALOGUE = Path(__file__).parent / "messages" / "catalogue.txt"
ROOT = Path(__file__).resolve().parent.parent
DATA = Path(os.environ.get("HOMOFACT_DATA", ROOT.parent / "shared" / "data"))
# What the tests of this process have seen: (package, message). None where it is checked, not written.
seen: set[tuple[str, str]] | None = None


def plain(text: str) -> str:
    """A text without the folders that hang on the machine: a test's own is HERE."""
    text = re.sub(r"[^\s'\"]*/pytest-of-[^/\s]+/pytest-\d+/(?:popen-gw\d+/)?[^/\s:,'\")]+", "HERE", text)
    return text.replace(f"{DATA}/", "").replace(f"{ROOT}/", "")


@contextmanager
def refused(
    match: str | None = None, *, where: str | None = None, found: str | None = None
) -> Iterator[pytest.ExceptionInfo[BadInput]]:
    """BadInput is raised with these fields; of a place in the test's own folder, without the folder.

    `match` is searched for in the message, for tests of what a message is made of.
    """
    __tracebackhide__ = True
    with pytest.raises(BadInput, match=match) as caught:
        yield caught
    error = caught.value
    if where is not None:
        assert plain(error.where).removeprefix("HERE/") == where
    if found is not None:
        assert plain(error.found).removeprefix("HERE/") == found
    check(_package(caught), plain(str(error)))


def check(package: str, message: str) -> None:
    """The message is in the catalogue, or will be."""
    if seen is not None:
        seen.add((package, message))
        return
    known = {line for lines in catalogue().values() for line in lines}
    assert message in known, f"not in {CATALOGUE.relative_to(ROOT)} (pytest --write-messages adds it): {message}"


@cache
def catalogue() -> dict[str, list[str]]:
    """Messages by package."""
    found: dict[str, list[str]] = {}
    lines = CATALOGUE.read_text(encoding="utf-8").split("\n") if CATALOGUE.is_file() else []
    for line in filter(None, lines):
        if line.startswith("## "):
            found[line[3:]] = []
        else:
            found[list(found)[-1]].append(line)
    return found


def write(messages: set[tuple[str, str]]) -> None:
    """Add messages to the catalogue; several processes may."""
    CATALOGUE.parent.mkdir(exist_ok=True)
    with CATALOGUE.open("a+", encoding="utf-8") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        catalogue.cache_clear()
        merged = {package: set(lines) for package, lines in catalogue().items()}
        for package, message in messages:
            merged.setdefault(package, set()).add(message)
        parts = ["\n".join([f"## {package}", "", *sorted(merged[package])]) for package in sorted(merged)]
        file.truncate(0)
        file.write("\n\n".join(parts) + "\n")


def _package(caught: pytest.ExceptionInfo[BadInput]) -> str:
    """The package of the innermost module of homofact's."""
    places = [Path(entry.path) for entry in caught.traceback]
    own = [place.relative_to(ROOT / "homofact").parts[0] for place in places if (ROOT / "homofact") in place.parents]
    return own[-1].removesuffix(".py") if own else "elsewhere"
