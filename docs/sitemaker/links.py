"""Every link of the built site followed: pages, places in pages, pictures, styles; nothing may come from a network."""

import hashlib
import json
import os
import posixpath
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import NamedTuple
from urllib.parse import unquote, urlsplit

from sitemaker.gallery import VIEWER

# Attributes that name what a page loads or leads to.
_LINKS = {"href", "src", "poster", "data-src"}


class _Found(NamedTuple):
    """The links of a page, (tag, link) each once, and the places in it."""

    links: list[tuple[str, str]]
    places: set[str]


class _Page(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.links: dict[tuple[str, str], None] = {}
        self.places: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if value and name in _LINKS:
                self.links[tag, value] = None
            if value and (name == "id" or (tag == "a" and name == "name")):
                self.places.add(value)


def broken_links(site: Path, kept: Path | None = None) -> tuple[int, int, list[str]]:
    """Pages of the site, its links among itself, and a line for each that leads nowhere or loads from elsewhere.

    What was read of the pages is kept in the file `kept`: pages with the same bytes are not parsed again.
    """
    files = {place.relative_to(site).as_posix() for place in _files(site)}
    folders = {folder for name in files for folder in _above(name)}
    # A viewer is whole in itself, and its megabytes hold no link.
    pages = _read(site, sorted(n for n in files if n.endswith(".html") and posixpath.basename(n) != VIEWER), kept)
    asked = dict(pages)
    broken: list[str] = []
    count = 0
    for name, page in pages.items():
        for tag, link in page.links:
            parts = urlsplit(link)
            if parts.scheme in ("http", "https") or link.startswith("//"):
                if tag not in ("a",):
                    broken.append(f"{name}: loads {link} from the network")
                continue
            if parts.scheme or (link.startswith("#") and len(link) == 1):
                continue
            count += 1
            path = unquote(parts.path)
            target = posixpath.normpath(posixpath.join(posixpath.dirname(name), path)) if path else name
            if target in folders:
                target = posixpath.normpath(posixpath.join(target, "index.html"))
            if target not in files:
                broken.append(f"{name}: {link} leads to nothing")
            elif parts.fragment and target.endswith(".html"):
                if target not in asked:
                    asked[target] = _parsed((site / target).read_text(encoding="utf-8"))
                if unquote(parts.fragment) not in asked[target].places:
                    broken.append(f"{name}: {link} leads to no such place")
    return len(pages), count, broken


def _files(site: Path) -> Iterator[Path]:
    for folder, _, names in os.walk(site):
        yield from (Path(folder, name) for name in names)


def _above(name: str) -> Iterator[str]:
    """The folders that a file is in, "." the outermost."""
    while name:
        name = posixpath.dirname(name)
        yield name or "."


def _read(site: Path, names: list[str], kept: Path | None) -> dict[str, _Found]:
    """What is in pages of these names."""
    # What another version of this module found may be something else.
    version = hashlib.sha256(Path(__file__).read_bytes()).hexdigest()
    before = {} if kept is None else _kept(kept, version)
    found: dict[str, tuple[str, _Found]] = {}
    for name in names:
        data = (site / name).read_bytes()
        key = hashlib.sha256(data).hexdigest()
        found[name] = key, before.get(key) or _parsed(data.decode("utf-8"))
    if kept is not None:
        record = {key: [page.links, sorted(page.places)] for key, page in found.values()}
        if record.keys() != before.keys():
            _keep(kept, {"version": version, "pages": record})
    return {name: page for name, (_, page) in found.items()}


def _parsed(text: str) -> _Found:
    page = _Page()
    page.feed(text)
    return _Found(list(page.links), page.places)


def _kept(file: Path, version: str) -> dict[str, _Found]:
    """What was read of pages before, by the hash of their bytes; nothing of a file that is damaged or out of date."""
    try:
        record = json.loads(file.read_bytes())
        pages = record["pages"] if record["version"] == version else {}
        return {
            key: _Found([(tag, link) for tag, link in links], set(places)) for key, (links, places) in pages.items()
        }
    except (OSError, ValueError, TypeError, KeyError, AttributeError):
        return {}


def _keep(file: Path, record: object) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    partial = file.with_name(f"{file.name}.partial")
    partial.write_text(json.dumps(record), encoding="utf-8")
    partial.replace(file)
