"""Who uses what of the Python interface: pages with examples and programs of scripts/, read off their imports."""

import ast
import re
from collections.abc import Iterable, Iterator, Mapping
from functools import cache

from sitemaker.navigation import ROOT
from sitemaker.sources import script_paths

_BLOCK = re.compile(r"^```python\n(.*?)^```", re.DOTALL | re.MULTILINE)


def used_by_page(module: str, pages: Mapping[str, str]) -> list[str]:
    """Pages whose examples use a module, tutorials first."""
    found = [name for name, text in pages.items() if module in modules_of(tuple(_BLOCK.findall(text)))]
    return sorted(found, key=lambda name: (not name.startswith("tutorials/"), name))


def scripts_using(module: str) -> list[str]:
    """The programs of scripts/ that use a module."""
    return [path for path, used in _used_by_scripts().items() if module in used]


@cache
def _used_by_scripts() -> dict[str, frozenset[str]]:
    return {path: modules_of(((ROOT / path).read_text(encoding="utf-8"),)) for path in script_paths()}


@cache
def modules_of(sources: tuple[str, ...]) -> frozenset[str]:
    """The modules of homofact that Python texts use: by import, or as `homofact.NAME` of what the package hands out."""
    return frozenset(_modules(sources))


def _modules(sources: Iterable[str]) -> Iterator[str]:
    for source in sources:
        for node in ast.walk(ast.parse(source)):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("homofact"):
                yield str(node.module)
                yield from (f"{node.module}.{each.name}" for each in node.names)
            elif isinstance(node, ast.Import):
                yield from (each.name for each in node.names if each.name.startswith("homofact"))
            elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "homofact":
                yield from _home(node.attr)


def _home(name: str) -> Iterator[str]:
    if name in front_door():
        yield front_door()[name]


def front_door() -> dict[str, str]:
    """The names that the package itself hands out, each with the module that it is of; none of them is loaded."""
    import homofact

    return {name: f"homofact.{homofact._HOMES[name]}" for name in homofact.__all__ if name in homofact._HOMES}
