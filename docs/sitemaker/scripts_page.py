"""docs/scripts.md: the programs of scripts/ by topic, from their docstrings; `python docs/make_scripts_page.py`."""

from collections.abc import Mapping
from pathlib import PurePosixPath

from sitemaker.navigation import DOCS, ROOT, written_pages
from sitemaker.sources import named_files, script_paths, summary, title_of

NAME = "scripts"
HEAD = """\
<!-- Made by `python docs/make_scripts_page.py`: change the docstrings, not this page. -->
# Programs behind the numbers

Programs in the repository produce the numbers, tables and pictures of this documentation. Find the program here, and
run it from a checkout to repeat the measurement. The last column of each table links to the pages that name the
program. If the column is empty, no page names the program, for example because the program only checks something.
To run a program:

    python scripts/accuracy/seeds.py --help
    python scripts/accuracy/seeds.py --short

`--short` runs a smoke test in seconds. `--data FOLDER`, or the environment variable HOMOFACT_DATA, sets the folder with
the real measurements. `--out FILE.md` also writes the printed tables to a file. `scripts/shared/harness.py` contains
the code that all programs share.
"""


def scripts_page() -> str:
    """The text of docs/scripts.md."""
    pages = {name: (DOCS / f"{name}.md").read_text(encoding="utf-8") for name in written_pages() if name != NAME}
    naming = {name: named_files(text) for name, text in pages.items()}
    parts = [HEAD]
    for folder in sorted({PurePosixPath(path).parent for path in script_paths()} - {PurePosixPath("scripts/shared")}):
        parts += _topic(folder, pages, naming)
    return "\n".join(parts)


def _topic(folder: PurePosixPath, pages: Mapping[str, str], naming: Mapping[str, set[str]]) -> list[str]:
    paths = [path for path in script_paths() if PurePosixPath(path).parent == folder]
    programs = [path for path in paths if "__main__" in (ROOT / path).read_text(encoding="utf-8")]
    rows = []
    for path in programs:
        on = [f"[{title_of(pages[name])}]({name}.md)" for name, named in naming.items() if path in named]
        rows.append(f"| {_link(path)} | {summary(path)} | {', '.join(on)} |")
    others = [f"{_link(path)}: {summary(path)}" for path in paths if path not in programs]
    return [
        f"## {folder.name.capitalize()}\n",
        f"{summary(f'{folder}/__init__.py')}\n",
        "| program | what it does | named on the pages |",
        "| --- | --- | --- |",
        *rows,
        *(["", "Modules of these programs:\n", *(f"* {line}" for line in others)] if others else []),
        "",
    ]


def _link(path: str) -> str:
    return f"[`{PurePosixPath(path).name}`](../{path})"
