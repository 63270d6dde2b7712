"""Every work that a page or a docstring cites by its authors and year is in references.bib."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("pybtex", reason="the site's tools are not installed: pip install 'homofact[docs]'")

from sitemaker.citations import citations, unknown_years, works
from sitemaker.navigation import DOCS, ROOT

# A capital and a number that cite nothing: "For 2000 pairs".
NO_CITATION = re.compile(r"^(?:For|CIE|January|February|March|April|May|June|July|August|Python|Windows) ?\(?\d{4}$")


def texts() -> Iterator[tuple[str, str]]:
    """Pages, and the docstrings and comments of the code, each with the name of its file."""
    for path in [ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted(DOCS.rglob("*.md"))]:
        yield str(path.relative_to(ROOT)), path.read_text(encoding="utf-8")
    for folder in ("homofact", "scripts"):
        for path in sorted((ROOT / folder).rglob("*.py")):
            source = path.read_text(encoding="utf-8")
            documented = (ast.Module, ast.ClassDef, ast.FunctionDef)
            told = [
                ast.get_docstring(node) or "" for node in ast.walk(ast.parse(source)) if isinstance(node, documented)
            ]
            comments = re.findall(r"(?:^ *#.*\n)+", source, re.MULTILINE)
            yield (
                str(path.relative_to(ROOT)),
                "\n\n".join([*told, *(re.sub(r"^ *#", "", c, flags=re.M) for c in comments)]),
            )


@pytest.mark.slow
def test_every_cited_work_is_in_the_bibliography() -> None:
    missing = [
        f"{name}: {cited.text}"
        for name, text in texts()
        for cited in citations(text)
        if cited.key is None and not NO_CITATION.match(cited.text)
    ]
    assert missing == [], "put them into docs/references.bib"


@pytest.mark.slow
def test_every_year_in_brackets_belongs_to_a_work() -> None:
    missing = [f"{name}: {words}" for name, text in texts() for words in unknown_years(text)]
    assert missing == [], "put the works into docs/references.bib"


def test_the_bibliography_names_works_once_and_fully() -> None:
    keys = [work.key for work in works()]
    assert len(keys) == len({key.lower() for key in keys})
    assert [work.key for work in works() if not work.surnames or not (work.year or work.key == "Cornell")] == []
    text = Path(DOCS / "references.bib").read_text(encoding="utf-8")
    for entry in re.split(r"^@", text, flags=re.MULTILINE)[1:]:
        assert re.search(r"^\s*title\s*=", entry, re.MULTILINE), entry


@pytest.mark.parametrize(
    ("text", "keys"),
    [
        ("as Cole (2002) has it", ["Cole2002"]),
        ("of Wang, Tran\n   and Luebke (2004, eq. 3)", ["Wang2004"]),
        ("Löw et al. 2012 and Filip and Vávra 2014", ["Low2012", "Filip2014"]),
        ("Microfacets of Walter, Marschner, Li and Torrance (2007)", ["Walter2007"]),
        ("van Elfrinkhof 1897; Dana, van Ginneken, Nayar and Koenderink 1999", ["Elfrinkhof1897", "Dana1999"]),
        ("Cole 2003", [None]),
        ("Wang, Tran and Smith 2004", [None]),
        ("Luebke 2004", [None]),
        ("in 2004 (2000 samples)", []),
    ],
)
def test_citations_are_found(text: str, keys: list[str | None]) -> None:
    assert [cited.key for cited in citations(text)] == keys


def test_a_year_without_its_authors_is_found() -> None:
    assert unknown_years("Ashikhmin and Shirley's anisotropic Phong model (2000), Nobody (2004)") != []
    assert unknown_years("Ashikhmin and Shirley's anisotropic Phong model (2000)") == []
    assert len(unknown_years("a model of others (2003)")) == 1
