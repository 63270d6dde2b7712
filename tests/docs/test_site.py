"""The site's parts: navigation, links, pages from declarations. That it builds without a warning is `make docs`."""

import json
import re
from pathlib import Path

import pytest

pytest.importorskip("pybtex", reason="the site's tools are not installed: pip install 'homofact[docs]'")

from sphinx.search.en import SearchEnglish
from typer.main import get_command

from homofact.cli.main import app
from sitemaker import links
from sitemaker.commands import command_pages, runs_of
from sitemaker.links import broken_links
from sitemaker.navigation import DOCS, ROOT, SECTIONS, toctrees, written_pages
from sitemaker.scripts_page import scripts_page
from sitemaker.sources import named_files, page_of, script_paths, source_pages, summary, title_of
from sitemaker.stage import linked_files, turned
from sitemaker.uses import modules_of

MADE_WITH_THE_SITE = {"commands/index", "api/index", "references", "changes"}
PAGES = {name: (DOCS / f"{name}.md").read_text(encoding="utf-8") for name in ["index", *written_pages()]}


def test_every_page_has_one_place_in_the_navigation() -> None:
    places = [page for section in SECTIONS for page in section.pages]
    assert sorted(places) == sorted({*written_pages(), *MADE_WITH_THE_SITE})
    trees = toctrees({"commands/index": ["commands/fit"]})
    shown = re.findall(r"^/(\S+)$", "\n".join(trees.values()), re.MULTILINE)
    assert sorted(shown) == sorted([*places, "commands/fit"])


@pytest.mark.parametrize("name", sorted(PAGES))
def test_every_page_reads_as_plain_markdown(name: str) -> None:
    """No directive or role of the site's: a git host would show it as it stands."""
    text = re.sub(r"^(`{3,}).*?^\1", "", PAGES[name], flags=re.DOTALL | re.MULTILINE)
    assert re.findall(r"^:::|\{[a-z:]+\}`|^\(\w+\)=", text, re.MULTILINE) == []
    assert re.findall(r"^```\{", PAGES[name], re.MULTILINE) == []
    assert len(re.findall(r"^# ", text, re.MULTILINE)) == 1
    assert title_of(PAGES[name])


@pytest.mark.parametrize("name", sorted(PAGES))
def test_every_link_of_a_page_leads_to_a_file(name: str) -> None:
    text = re.sub(r"^(`{3,}).*?^\1", "", PAGES[name], flags=re.DOTALL | re.MULTILINE)
    for target in re.findall(r"\]\((?![a-z]+:|#)([^()\s#]+)", text):
        assert (DOCS / f"{name}.md").parent.joinpath(target).exists(), target


def numbers_without_a_program(text: str) -> list[str]:
    """Sections with a table of numbers that do not say, nor does the page's head, what program made them."""
    parts = re.split(r"^## ", re.sub(r"^(`{3,}).*?^\1", "", text, flags=re.DOTALL | re.MULTILINE), flags=re.MULTILINE)
    number = re.compile(r"\|\s*[<≥≤±−-]?\d[\d.,]*\s*[%a-zA-Z]{0,2}\s*(?=\|)")
    named = re.compile(r"scripts/[\w/]+\.py|make stability|`homofact |^homofact ", re.MULTILINE)
    if named.search(parts[0]):
        return []
    return [
        part.splitlines()[0]
        for part in parts
        if not named.search(part)
        and sum(len(number.findall(row)) >= 2 for row in re.findall(r"^\|.*\|$", part, re.MULTILINE)) >= 2
    ]


@pytest.mark.parametrize("name", sorted(PAGES))
def test_every_table_of_numbers_names_the_program_that_made_it(name: str) -> None:
    assert numbers_without_a_program(PAGES[name]) == []


def test_a_table_without_its_program_is_found() -> None:
    table = "| a | b |\n| --- | ---: |\n| 1.2 | 3% |\n| 4 | 5.6 dB |\n"
    assert numbers_without_a_program(f"# T\n\n## S\n\n{table}") == ["S"]
    assert numbers_without_a_program(f"# T\n\n## S\n\n`python scripts/accuracy/seeds.py`\n\n{table}") == []
    assert numbers_without_a_program(f"# T\n\nMade by `python scripts/accuracy/seeds.py`.\n\n## S\n\n{table}") == []


def test_links_to_files_of_the_repository_become_links_to_their_pages() -> None:
    known = {page_of("configs/chart.toml")}.__contains__
    text = "[a](../configs/chart.toml) [b](light.md#x) [c](../README.md) [d](references.bib) [e](https://x.org) [f](#y)"
    assert turned(text, "docs/export.md", known) == (
        "[a](/source/configs/chart.toml.md) [b](/light.md#x) [c](/index.md) [d](/references.md)"
        " [e](https://x.org) [f](#y)"
    )
    assert turned("[a](../light.md)", "docs/tutorials/paint.md", known) == "[a](/light.md)"


def test_a_file_that_a_page_names_has_a_page_that_names_it_back() -> None:
    named = named_files(
        "made by `python scripts/accuracy/seeds.py --size 8`, not by scripts/absent.py or my/scripts/accuracy/seeds.py"
    )
    assert named == {"scripts/accuracy/seeds.py"}
    found = source_pages({"light": "# Light\n\n`python scripts/accuracy/seeds.py`"}, ["configs/chart.toml"])
    assert "Named on [Light](/light.md)" in found["source/scripts/accuracy/seeds.py"]
    assert (ROOT / "scripts/accuracy/seeds.py").read_text(encoding="utf-8").rstrip() in found[
        "source/scripts/accuracy/seeds.py"
    ]
    assert "Named on" not in found["source/configs/chart.toml"]
    paper = "docs/papers/small_textures/paper.tex"
    assert list(linked_files({"papers": PAGES["papers"]}, {"papers": "docs/papers.md"})) == [paper]
    assert "```latex" in source_pages({}, [paper])[page_of(paper)]
    assert {page_of(path) for path in script_paths()} <= found.keys()


def test_the_index_of_scripts_is_up_to_date() -> None:
    """Else: python docs/make_scripts_page.py."""
    assert PAGES["scripts"] == scripts_page()
    for path in script_paths():
        if "/shared/" not in path:
            assert f"](../{path})" in PAGES["scripts"]
            assert summary(path) in PAGES["scripts"]


def test_every_command_and_option_stands_in_the_reference_as_help_has_it() -> None:
    group = get_command(app)
    pages = command_pages({"trust": "# Trust\n\n    homofact factorize x --out y\n", "light": "# Light"})
    commands = dict(group.commands.items())  # type: ignore[attr-defined]
    inner = commands.pop("research").commands
    commands |= {f"research-{name}": inner[name] for name in inner}
    assert {"research-terms", "research-stability", "compare"} <= set(commands)
    for name, command in commands.items():
        text = pages[f"commands/{name}"]
        assert f"](/commands/{name}.md)" in pages["commands/index"]
        everyday, _, research = text.partition("{dropdown}")
        for each in command.params:
            for word in (word for word in [*each.opts, *each.secondary_opts] if word.startswith("-")):
                where = research if each.hidden else everyday
                shown = re.compile(rf"\{{option\}} .*{re.escape(word)}(?![\w-])")
                assert shown.search(where), (name, word)
                assert not (each.hidden and shown.search(everyday)), (name, word)
    assert "--help-all" in pages["commands/factorize"]
    assert "[Trust](/trust.md)" in pages["commands/factorize"]
    assert "Light" not in pages["commands/factorize"]
    assert runs_of("`homofact research terms x`\n\n    homofact info y") == {"research terms", "info"}


def test_runs_are_told_from_mentions() -> None:
    assert runs_of("    homofact fit-x a\n`homofact plan S.toml` and homofact view, homofact's\n$ homofact edit x") == {
        "fit", "plan", "edit",
    }  # fmt: skip


def test_uses_are_read_off_imports_and_names_of_the_front_door() -> None:
    found = modules_of(("from homofact.brdf import samples", "import homofact as h\nimport homofact\nhomofact.Svd()"))
    assert {"homofact.brdf", "homofact.brdf.samples", "homofact.methods.svd"} <= found
    assert "homofact.methods.cole" not in found


def test_links_that_lead_nowhere_are_found(tmp_path: Path) -> None:
    (tmp_path / "a.html").write_text(
        '<a href="b.html#x">1</a><a href="b.html#no">2</a><a href="c.html">3</a><img src="no.png">'
        '<a href="https://elsewhere.org">4</a><script src="https://cdn.org/x.js"></script><a href="../out.html">5</a>'
        '<a href="#">6</a><a href="mailto:x@y.z">7</a><p id="here"></p><a href="#here">8</a><a href="d/">9</a>'
        '<a href="e/#f">10</a>'
    )
    (tmp_path / "b.html").write_text('<p id="x"></p>')
    (tmp_path / "d").mkdir()
    (tmp_path / "e").mkdir()
    (tmp_path / "e" / "index.html").write_text('<p id="f"></p>')
    pages, links, broken = broken_links(tmp_path)
    assert (pages, links) == (3, 8)
    assert [line.split(" ", 1)[1] for line in broken] == [
        "b.html#no leads to no such place",
        "c.html leads to nothing",
        "no.png leads to nothing",
        "loads https://cdn.org/x.js from the network",
        "../out.html leads to nothing",
        "d/ leads to nothing",
    ]


def test_pages_that_are_kept_change_no_finding(tmp_path: Path) -> None:
    """Whatever was read before, and whatever became of its file, the findings are those of pages as they are."""
    site, kept = tmp_path / "site", tmp_path / "cache" / "links.json"
    site.mkdir()
    text = '<a href="b.html#x">1</a>'
    (site / "a.html").write_text(text)
    (site / "b.html").write_text('<p id="x"></p><a href="a.html">2</a>')

    def check(pages: int, links: int, *broken: str) -> None:
        for file in (kept, kept, None):
            assert broken_links(site, file) == (pages, links, list(broken))

    check(2, 2)
    # A page that changed loses its place; one that is gone is led to no more.
    before = kept.read_bytes()
    (site / "b.html").write_text('<p id="y"></p><a href="a.html">2</a>')
    check(2, 2, "a.html: b.html#x leads to no such place")
    (site / "b.html").unlink()
    check(1, 1, "a.html: b.html#x leads to nothing")
    # Two pages alike, and a page of another name with bytes that are known, have their own findings.
    (site / "d").mkdir()
    (site / "d" / "a.html").write_text(text)
    check(2, 2, "a.html: b.html#x leads to nothing", "d/a.html: b.html#x leads to nothing")
    record = json.loads(kept.read_bytes())
    other = {"version": "another", "pages": {key: [[], []] for key in record["pages"]}}
    for damaged in (b"", b"[1]", json.dumps(other).encode(), before[: len(before) // 2]):
        kept.write_bytes(damaged)
        check(2, 2, "a.html: b.html#x leads to nothing", "d/a.html: b.html#x leads to nothing")


def test_what_is_kept_is_not_parsed_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    site, kept = tmp_path / "site", tmp_path / "links.json"
    site.mkdir()
    for name in "abc":
        (site / f"{name}.html").write_text(f'<p id="{name}"></p><a href="a.html#a">1</a>')
    parsed: list[str] = []
    real = links._parsed
    monkeypatch.setattr(links, "_parsed", lambda text: parsed.append(text) or real(text))
    broken_links(site, kept)
    assert len(parsed) == 3
    (site / "c.html").write_text('<a href="b.html#b">1</a>')
    assert broken_links(site, kept) == (3, 3, [])
    assert parsed[3:] == ['<a href="b.html#b">1</a>']


def test_no_page_has_the_name_of_one_that_the_builder_makes() -> None:
    """The builder's own would be written over it."""
    assert not {"search", "genindex", "py-modindex"} & {*PAGES}


def searched(text: str) -> set[str]:
    """The words of a text as the site's search index has them: stemmed, without those too common to search for."""
    language = SearchEnglish({})
    return {language.stem(word.lower()) for word in language.split(text) if language.word_filter(word.lower())}


@pytest.mark.parametrize(
    ("query", "page", "heading"),
    [
        ("normal map", "export", "Normal maps"),
        ("three.js", "interchange", "three.js"),
        ("reciprocity", "concepts/reciprocity", "Reciprocity"),
        ("GGX", "sampling", "Noise compared with a cosine, GGX and Mitsuba"),
    ],
)
def test_the_search_finds_what_people_look_for(query: str, page: str, heading: str) -> None:
    """A page whose heading has all words of the query, which the search ranks above pages that only use them."""
    headings = re.findall(r"^#+ (.*)$", PAGES[page], re.MULTILINE)
    assert searched(query)
    assert heading in [each for each in headings if searched(query) <= searched(each)]
