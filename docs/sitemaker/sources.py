"""Pages that show a file of the repository: the script behind a number, the configuration of a run, a module.

Pages name such files in code, `python scripts/accuracy/seeds.py --size 8`, or link to them,
`[...](../configs/chart.toml)`. Each file that is named so gets a page with its text and with the pages that name it, so
that the site leads from every number to what made it without a network.
"""

import ast
import re
from collections import defaultdict
from collections.abc import Iterable, Mapping
from pathlib import PurePosixPath

from sitemaker.navigation import ROOT

NAMED = re.compile(r"(?<![\w/.-])(?:scripts|configs|homofact|tests|data_synthetic)/[\w./-]+\.(?:py|toml|html|json)\b")
_LANGUAGE = {".py": "python", ".toml": "toml", ".html": "html", ".json": "json", ".tex": "latex"}
# After these a sentence goes on.
_SHORT = {"al.", "cf.", "e.g.", "eq.", "eqs.", "fig.", "figs.", "i.e.", "vs."}


def named_files(text: str) -> set[str]:
    """Files of the repository that `text` names by their paths."""
    return {path for path in NAMED.findall(text) if (ROOT / path).is_file()}


def page_of(path: str) -> str:
    """The page that shows a file, as the name of a document."""
    return f"source/{path}"


def script_paths() -> list[str]:
    """The files of scripts/, sorted by topic and name."""
    found = sorted((ROOT / "scripts").glob("*/*.py"))
    return [path.relative_to(ROOT).as_posix() for path in found if path.name != "__init__.py"]


def source_pages(pages: Mapping[str, str], also: Iterable[str] = ()) -> dict[str, str]:
    """A page for each file that the texts of `pages` (by name) name, and for those in `also`."""
    naming: dict[str, list[str]] = defaultdict(list)
    for name, text in sorted(pages.items()):
        for path in named_files(text):
            naming[path].append(name)
    every = {*naming, *also, *script_paths()}
    return {page_of(path): _page(path, naming.get(path, []), pages) for path in sorted(every)}


def title_of(text: str) -> str:
    """The first heading of a page."""
    match = re.search(r"^# (.+)$", text, re.MULTILINE)
    return match[1] if match else ""


def links_to(names: Iterable[str], pages: Mapping[str, str]) -> str:
    """Links to pages by their titles, with commas."""
    return ", ".join(f"[{title_of(pages[name])}](/{name}.md)" for name in names)


def _page(path: str, naming: list[str], pages: Mapping[str, str]) -> str:
    text = (ROOT / path).read_text(encoding="utf-8")
    fence = "`" * max(3, 1 + max((len(run) for run in re.findall(r"`+", text)), default=0))
    named = f"Named on {links_to(naming, pages)}.\n\n" if naming else ""
    language = _LANGUAGE[PurePosixPath(path).suffix]
    return f"---\norphan: true\n---\n# {path}\n\n{named}{fence}{language}\n{text.rstrip()}\n{fence}\n"


def summary(path: str) -> str:
    """The first sentence of a program's or module's docstring, fit for a cell of a table."""
    told = ast.get_docstring(ast.parse((ROOT / path).read_text(encoding="utf-8"))) or ""
    return first_sentence(told).rstrip(":").replace("|", "\\|")


def first_sentence(text: str) -> str:
    """The first sentence of a text; the full stop of "et al." or "eq." ends none."""
    words = text.split("\n\n")[0].split()
    ends = (n for n, word in enumerate(words, 1) if word.endswith(".") and word.lstrip("(").lower() not in _SHORT)
    return " ".join(words[: next(ends, None)])
