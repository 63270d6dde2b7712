"""Citations as the pages and docstrings have them, "Wang, Tran and Luebke (2004)", and their keys in references.bib.

One pattern finds them for the links of the site and for the test that every cited work is in the bibliography.
"""

import re
import unicodedata
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

from pybtex.database import Person, parse_file

from sitemaker.navigation import DOCS

_NAME = r"(?:(?:[Vv]an|[Dd]e)\s+)?[A-Z][\w’-]*[a-zß-ÿ’-](?:'s)?"
_YEAR = r"(?:1[5-9]\d\d|20\d\d)[a-z]?"
_PATTERN = re.compile(
    rf"(?P<names>{_NAME}(?:(?:,\s+(?:and\s+)?|\s+and\s+){_NAME})*(?:\s+et\s+al\.)?),?\s+(?P<year>\(?{_YEAR}\b)"
)
_BARE_YEAR = re.compile(rf"\(({_YEAR})[),]")


@dataclass(frozen=True)
class Work:
    """One entry of references.bib: its key, the authors' surnames as words without accents, the year."""

    key: str
    surnames: tuple[str, ...]
    year: str


@dataclass(frozen=True)
class Cited:
    """Where a text has authors and a year, and the key of what they wrote; no key where nothing is known of it."""

    start: int
    end: int
    text: str
    key: str | None


@cache
def works() -> tuple[Work, ...]:
    """What references.bib holds."""
    entries = parse_file(DOCS / "references.bib").entries
    return tuple(
        Work(key, tuple(map(_surname, entry.persons.get("author", []))), entry.fields.get("year", ""))
        for key, entry in entries.items()
    )


def citations(text: str) -> Iterator[Cited]:
    """The citations in `text`, over the ends of lines too."""
    for match in _PATTERN.finditer(text):
        names = [_plain(name.removesuffix("'s")) for name in re.findall(_NAME, match["names"])]
        year = match["year"].lstrip("(")
        begin, key = match.start(), None
        # Words before the authors may be capitalised too: "Microfacets of", "The".
        for first in range(len(names)):
            key = _key(names[first:], year, match["names"].endswith("al."))
            if key is not None:
                begin = match.start() + _offset(match["names"], first)
                break
        end = match.end() + (match["year"].startswith("(") and text[match.end() : match.end() + 1] == ")")
        yield Cited(begin, end, " ".join(text[begin:end].split()), key)


def unknown_years(text: str) -> list[str]:
    """Years in brackets before which no author of a work of that year stands: "a model (2000)" cites what?"""
    flat = re.sub(r"\s+", " ", text)
    found = []
    for match in _BARE_YEAR.finditer(flat):
        before = _plain(flat[max(0, match.start() - 120) : match.start()])
        if not any(work.year == match[1] and any(name in before for name in work.surnames) for work in works()):
            found.append(flat[max(0, match.start() - 60) : match.end()])
    return found


def _key(names: list[str], year: str, more: bool) -> str | None:
    """The work of that year whose authors are these: all of them, or the first or last and others left out."""
    candidates = [work for work in works() if work.year == year and work.surnames[: len(names)] == tuple(names)]
    exact = [work for work in candidates if len(work.surnames) == len(names)]
    if exact and not more:
        return exact[0].key
    if candidates and (more or len(names) == 1):
        return candidates[0].key
    return None


def _offset(names: str, skipped: int) -> int:
    return [match.start() for match in re.finditer(_NAME, names)][skipped]


def _surname(person: Person) -> str:
    return _plain(" ".join(map(str, [*person.rich_prelast_names, *person.rich_last_names])))


def _plain(text: str) -> str:
    decomposed = unicodedata.normalize("NFD", " ".join(text.split()))
    return "".join(letter for letter in decomposed if not unicodedata.combining(letter)).casefold()
