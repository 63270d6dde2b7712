"""Every link of the built site followed: pages, places in pages, pictures, styles; nothing may come from a network."""

from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

from sitemaker.gallery import VIEWER

# Attributes that name what a page loads or leads to.
_LINKS = {"href", "src", "poster", "data-src"}


class _Page(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.links: list[tuple[str, str]] = []
        self.places: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if value and name in _LINKS:
                self.links.append((tag, value))
            if value and (name == "id" or (tag == "a" and name == "name")):
                self.places.add(value)


@cache
def _read(path: Path) -> _Page:
    page = _Page()
    page.feed(path.read_text(encoding="utf-8"))
    return page


def broken_links(site: Path) -> tuple[int, int, list[str]]:
    """Pages of the site, its links among itself, and a line for each that leads nowhere or loads from elsewhere."""
    _read.cache_clear()
    broken: list[str] = []
    count = 0
    # A viewer is whole in itself, and its megabytes hold no link.
    paths = sorted(path for path in site.rglob("*.html") if path.name != VIEWER)
    for path in paths:
        for tag, link in dict.fromkeys(_read(path).links):
            parts = urlsplit(link)
            if parts.scheme in ("http", "https") or link.startswith("//"):
                if tag not in ("a",):
                    broken.append(f"{path.relative_to(site)}: loads {link} from the network")
                continue
            if parts.scheme or (link.startswith("#") and len(link) == 1):
                continue
            count += 1
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            if target.is_dir():
                target = target / "index.html"
            if not target.is_relative_to(site.resolve()) or not target.is_file():
                broken.append(f"{path.relative_to(site)}: {link} leads to nothing")
            elif parts.fragment and target.suffix == ".html" and unquote(parts.fragment) not in _read(target).places:
                broken.append(f"{path.relative_to(site)}: {link} leads to no such place")
    return len(paths), count, broken
