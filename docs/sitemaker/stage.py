"""The sources of the site: the pages of docs/ as they stand, their links turned to the site's, and what is written.

The pages are plain Markdown that reads well on a git host too. So what only the site has, tables of contents and pages
from declarations, is added here, in a folder of its own that Sphinx then builds.
"""

import os
import posixpath
import re
import shutil
from collections.abc import Callable, Iterable
from pathlib import Path

from sitemaker.commands import command_pages
from sitemaker.gallery import INDEX, fits, gallery_pages
from sitemaker.modules import reference_modules
from sitemaker.navigation import DOCS, ROOT, toctrees, written_pages
from sitemaker.notebooks import notebook_of
from sitemaker.reference import reference_pages
from sitemaker.sources import page_of, source_pages, title_of

_LINK = re.compile(r"(?<=\]\()(?![a-z]+:|#)([^()\s]+)(?=\))")
# Pages of the repository that are no page of docs/.
_ELSEWHERE = {"README.md": "index", "CHANGELOG.md": "changes", "docs/references.bib": "references"}
BIBLIOGRAPHY = """# References

The works that homofact builds on, from [references.bib](references.bib). Where a page or a docstring cites one by its
authors and year, it links here.

```{bibliography}
:all:
:list: bullet
```
"""


def stage(folder: Path) -> None:
    """Write the sources of the site into `folder`; files that are the same stay untouched, others are taken away."""
    pages = {name: (DOCS / f"{name}.md").read_text(encoding="utf-8") for name in ["index", *written_pages()]}
    pages["changes"] = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    homes = {name: f"docs/{name}.md" for name in pages} | {"changes": "CHANGELOG.md"}
    commands = command_pages(pages)
    reference = reference_pages(pages)
    shown = [module.path for module in reference_modules()]
    # Of the changes, files that have long been renamed are none to show.
    naming = {name: text for name, text in (pages | commands).items() if name != "changes"}
    sources = source_pages(naming, [*shown, *linked_files(pages, homes)])
    shown_fits = fits()
    gallery = gallery_pages(shown_fits)
    # Modules of the reference are reached from its index: in every page's sidebar they would double the site's build.
    under = {"commands/index": sorted(commands.keys() - {"commands/index"})}
    if gallery:
        under |= {"gallery": [INDEX], INDEX: [fit.page for fit in shown_fits]}
    trees = toctrees(under)
    notebooks = {name: notebook_of(text) for name, text in pages.items() if _is_tutorial(name)}
    pages = {name: turned(text, homes[name], sources.__contains__) for name, text in pages.items()}
    pages |= {name: _with_notebook(name, pages[name]) for name in notebooks}
    pages |= {**commands, **reference, **sources, **gallery, "references": BIBLIOGRAPHY}
    if gallery:
        pages["gallery"] += f"\n## With viewers\n\n[{title_of(gallery[INDEX])}](/{INDEX}.md)\n"
    for name, tree in trees.items():
        pages[name] = f"{pages[name].rstrip()}\n\n{tree}"
    wanted = {Path(f"{name}.md"): text.encode() for name, text in pages.items()}
    wanted |= {Path(f"{name}.ipynb"): text.encode() for name, text in notebooks.items()}
    for path in [DOCS / "references.bib", *_files(DOCS / "pictures")]:
        wanted[path.relative_to(DOCS)] = path.read_bytes()
    for fit in shown_fits:
        wanted |= {Path(f"{fit.page}/{path.name}"): path.read_bytes() for path in fit.pictures}
    _write(folder, wanted)


def turned(text: str, home: str, known: Callable[[str], bool]) -> str:
    """A page's text with its links to files of the repository as links to pages of the site.

    `home` is the page's own path in the repository; `known` tells whether the site has a page of that name. Links
    between pages of docs/ stay as they are but for a page that has moved up, CHANGELOG.md.
    """

    def moved(match: re.Match[str]) -> str:
        target, _, anchor = match[1].partition("#")
        path = posixpath.normpath(posixpath.join(posixpath.dirname(home), target))
        after = f"#{anchor}" if anchor else ""
        if path in _ELSEWHERE:
            return f"/{_ELSEWHERE[path]}.md{after}"
        if known(page_of(path)):
            return f"/{page_of(path)}.md"
        return f"/{path.removeprefix('docs/')}{after}" if path.startswith("docs/") else match[1]

    return _LINK.sub(moved, text)


def _is_tutorial(name: str) -> bool:
    return name.startswith("tutorials/") and name != "tutorials/index"


def _with_notebook(name: str, text: str) -> str:
    """A tutorial's text with a link to its notebook under the title."""
    title, _, rest = text.partition("\n")
    return f"{title}\n\n{{download}}`Download this page as a notebook </{name}.ipynb>`\n{rest}"


def linked_files(pages: dict[str, str], homes: dict[str, str]) -> Iterable[str]:
    """Files of the repository that a page links to: those outside docs/, and the LaTeX source of a paper in it."""
    for name, text in pages.items():
        for target in _LINK.findall(text):
            path = posixpath.normpath(posixpath.join(posixpath.dirname(homes[name]), target.partition("#")[0]))
            outside = not path.startswith("docs/") or path.endswith(".tex")
            if outside and path not in _ELSEWHERE and (ROOT / path).is_file():
                yield path


def _files(folder: Path) -> Iterable[Path]:
    return (path for path in sorted(folder.rglob("*")) if path.is_file())


def _write(folder: Path, wanted: dict[Path, bytes]) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for path in _files(folder):
        if path.relative_to(folder) not in wanted:
            path.unlink()
    for name, content in wanted.items():
        path = folder / name
        if not path.exists() or path.read_bytes() != content:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
    for place, folders, names in os.walk(folder, topdown=False):
        if not folders and not names:
            shutil.rmtree(place)
