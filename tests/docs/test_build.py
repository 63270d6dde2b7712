"""A site of three pages built as the whole is: citations, paths and formulas as the pages have them."""

import json
import re
from pathlib import Path

import pytest

pytest.importorskip("sphinx", reason="the site's tools are not installed: pip install 'homofact[docs]'")

from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.cmd.build import build_main

from sitemaker.extension import with_accents
from sitemaker.gallery import INDEX, fits, gallery_pages, viewers
from sitemaker.links import broken_links
from sitemaker.navigation import DOCS
from sitemaker.stage import BIBLIOGRAPHY

PAGE = """# T

Projections are searched (Cole 2002), as Wang, Tran and Luebke (2004, eq. 3) do not; `python scripts/accuracy/seeds.py`.
Of a map `(Cole 2002)` stays as it stands, with `--size` dashes.
More in docs/references.md, as {pytype}`list[homofact.A]`.

```{py:class} homofact.A
```

$$a = \\sqrt{b} + \\tilde f_{nc}$$

[The program](/source/scripts/accuracy/seeds.py.md)

```{toctree}
references
```
"""


def built(folder: Path, page: str) -> int:
    sources = folder / "sources"
    (sources / "source" / "scripts" / "accuracy").mkdir(parents=True, exist_ok=True)
    (sources / "index.md").write_text(page, encoding="utf-8")
    (sources / "references.md").write_text(BIBLIOGRAPHY, encoding="utf-8")
    (sources / "references.bib").write_text((DOCS / "references.bib").read_text(encoding="utf-8"), encoding="utf-8")
    (sources / "source" / "scripts" / "accuracy" / "seeds.py.md").write_text(
        "---\norphan: true\n---\n# seeds\n", encoding="utf-8"
    )
    return build_main(["-b", "html", "-c", str(DOCS), "-W", "--keep-going", "-q", str(sources), str(folder / "site")])


# Sphinx and its extensions leave files for the collector, and warn of what they will rename.
pytestmark = pytest.mark.filterwarnings("ignore")


@pytest.mark.slow
def test_a_page_gets_its_links_and_formulas(tmp_path: Path) -> None:
    assert built(tmp_path, PAGE) == 0
    page = (tmp_path / "site" / "index.html").read_text(encoding="utf-8")
    assert 'href="references.html#cole2002">Cole 2002</a>' in page
    assert 'href="references.html#wang2004">Wang, Tran and Luebke (2004</a>, eq. 3)' in page
    assert page.count("#cole2002") == 1
    assert '<a class="reference internal" href="source/scripts/accuracy/seeds.py.html"><code' in page
    assert 'More in <a class="reference internal" href="references.html">References</a>, as <code' in page
    assert '<span class="pre">list[</span><a class="reference internal" href="#homofact.A" title="homofact.A">' in page
    assert "<msqrt>" in page
    formula = re.sub(r"\s", "", page)
    index = "<mrow><mi>n</mi><mi>c</mi></mrow>"
    assert f'<msub><moveraccent="true"><mi>f</mi><mostretchy="false">~</mo></mover>{index}</msub>' in formula
    assert "mathjax" not in page.lower()
    assert "--size" in page
    pages, _, broken = broken_links(tmp_path / "site")
    assert pages >= 3
    assert broken == []


@pytest.mark.slow
def test_a_page_that_changed_makes_the_site_that_a_build_from_scratch_makes(tmp_path: Path) -> None:
    changed = PAGE.replace("```{toctree}", "One more sentence (Wang, Tran and Luebke 2004).\n\n```{toctree}")
    assert built(tmp_path / "again", PAGE) == 0
    first = written(tmp_path / "again" / "site")
    assert built(tmp_path / "again", changed) == 0
    assert built(tmp_path / "scratch", changed) == 0
    again, scratch = (written(tmp_path / name / "site") for name in ("again", "scratch"))
    assert again.keys() == scratch.keys()
    assert [name for name in again if again[name] != scratch[name]] == []
    assert [name for name in again if again[name] != first[name]] == ["index.html", "searchindex.js"]


def written(site: Path) -> dict[str, bytes]:
    """The files of a site by their names; what Sphinx keeps for itself is none of it."""
    files = (path for path in sorted(site.rglob("*")) if path.is_file() and ".doctrees" not in path.parts)
    return {path.relative_to(site).as_posix(): path.read_bytes() for path in files}


def formulas(text: str) -> list[str]:
    text = re.sub(r"^(`{3,}).*?^\1", "", text, flags=re.DOTALL | re.MULTILINE)
    blocks = re.findall(r"\$\$(.+?)\$\$", text, re.DOTALL)
    return blocks + re.findall(r"\$([^$\n]+)\$", re.sub(r"\$\$.+?\$\$", "", text, flags=re.DOTALL))


@pytest.mark.parametrize("path", sorted(DOCS.rglob("*.md")), ids=lambda path: path.stem)
def test_every_formula_of_a_page_can_be_shown(path: Path) -> None:
    for formula in formulas(path.read_text(encoding="utf-8")):
        assert with_accents(tex2mathml(formula)).startswith("<math")


@pytest.mark.slow
def test_what_cannot_be_shown_fails_the_build(tmp_path: Path) -> None:
    assert built(tmp_path / "formula", PAGE.replace("\\sqrt", "\\nosuch")) == 1
    assert built(tmp_path / "link", PAGE.replace("seeds.py.md", "absent.py.md")) == 1


def test_the_gallery_shows_the_fits_that_are_there(tmp_path: Path) -> None:
    assert gallery_pages(fits(tmp_path)) == {}
    finding = {"name": "coverage", "grade": "severe", "found": "half was not measured", "remedy": "measure there"}
    report = {
        "verdict": {"trusted": True, "summary": "right to 3%", "findings": [finding]},
        "error": {"held_out": {"log_mse": 0.0123}},
        "textures": 3, "bytes": 36864, "fetches": 3, "epsilon": 0.01, "appearance": {"psnr_sky": 50.04},
    }  # fmt: skip
    for order, (name, group) in enumerate((("zinc", "Metals"), ("aqua", "Paints"))):
        folder = tmp_path / name
        folder.mkdir()
        made = {"source": f"{name}.brdf", "effort": "quick"}
        record = {"order": order, "group": group, "what": "a thing", "report": report, "made": made}
        (folder / "gallery.json").write_text(json.dumps(record), encoding="utf-8")
        for picture in ("sphere.png", "texture_0.png", "compare.png"):
            (folder / picture).write_bytes(b"")
    found = fits(tmp_path)
    pages = gallery_pages(found)
    assert [fit.folder.name for fit in found] == ["zinc", "aqua"]
    assert pages[INDEX].index("## Metals") < pages[INDEX].index("zinc") < pages[INDEX].index("## Paints")
    page = pages["gallery_fits/zinc"]
    for told in ("Trusted; right to 3%.", "half was not measured: measure there", "0.0123", "36,864", "50.0 dB"):
        assert told in page
    for picture in ("sphere.png", "texture_0.png", "compare.png"):
        assert f"(zinc/{picture})" in page
    assert 'href="zinc/view.html"' in page
    assert "homofact factorize zinc.brdf --textures 3 --size 32 \\\n    --effort quick --out zinc\n" in page
    assert next(iter(viewers(found))) == (tmp_path / "zinc" / "view.html", "gallery_fits/zinc/view.html")
