"""Hostile names on the terminal, in pages, in a result's folder and in an export: shown, never obeyed."""

import io
import json
import os
import re
from html.parser import HTMLParser
from pathlib import Path

import pytest
from hostile import FORBIDDEN, NAMES
from rich.table import Table

import homofact
from homofact.brdf.formats import csv as write_csv
from homofact.brdf.materials import material
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model
from homofact.cli.main import main
from homofact.cli.screen import Screen, _Console
from homofact.cli.tables import facts_table
from homofact.exporting.result import open_result
from homofact.web.page import write_view

CONTROLS = set(FORBIDDEN) - {"\x1b"}


@pytest.mark.parametrize("terminal", [False, True])
@pytest.mark.parametrize("name", NAMES)
def test_the_terminal_shows_names_as_they_are(name: str, terminal: bool, capsys: pytest.CaptureFixture[str]) -> None:
    screen = Screen(False, False)
    for console in (screen._out, screen._err):
        console._force_terminal = terminal
    table = facts_table(name, {name: name})
    assert isinstance(table, Table)
    screen.show(name, table)
    screen.note(name)
    out, err = capsys.readouterr()
    for text in (out, err):
        assert not set(text) & CONTROLS
        # What is left are rich's own colours, and those on a terminal alone.
        assert "\x1b" not in re.sub(r"\x1b\[[\d;]*m", "", text) if terminal else "\x1b" not in text
        assert "\x1b[31m" not in text
    if "[bold]" in name:
        assert "[/] [bold]x[/bold] :smile:" in out


@pytest.mark.parametrize("name", NAMES)
def test_the_one_json_object_holds_the_name_itself(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    Screen(True, False).answer({"name": name})
    out = capsys.readouterr().out
    assert json.loads(out) == {"name": name}
    assert not set(out) & set(FORBIDDEN)


@pytest.mark.parametrize("encoding", ["ascii", "latin-1"])
def test_a_stream_that_cannot_write_a_letter_gets_its_number(
    encoding: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "日本.csv"
    rows = "".join(f"0.{k},0,0.2,3,0.5\n" for k in range(8))
    file.write_text(f"# isotropic: true\ntheta_i,phi_i,theta_o,phi_o,λ\n{rows}", "utf-8")
    for options in ([], ["--json"]):
        raw = io.BytesIO()
        monkeypatch.setattr("sys.stdout", io.TextIOWrapper(raw, encoding))
        assert main(["info", str(file), *options]) == 0
        text = raw.getvalue().decode(encoding)
        assert "\\u65e5\\u672c.csv" in text
        assert not options or "日本.csv" in json.loads(text).values()


@pytest.mark.parametrize("name", NAMES)
def test_what_is_refused_is_said_in_one_harmless_line(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", f"material:{name}"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert re.fullmatch(r"homofact: [^\n]+\n", err), err
    assert not set(err) & set(FORBIDDEN)


class Elements(HTMLParser):
    """The tags of a page, their attributes' names, and what stands in its data."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, tuple[str, ...]]] = []
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, tuple(name for name, _ in attrs)))


@pytest.mark.slow
def test_folders_exports_and_pages_of_hostile_channels(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    samples = sample_model(material("phong-10").model, 300)
    pages = {}
    # Three names in each fit, since an export takes a second: each alone as a channel and a comment, all as a material.
    named_so = [("R", "G", "B"), *(tuple((NAMES * 2)[k : k + 3]) for k in range(0, len(NAMES), 3))]
    for k, names in enumerate(named_so):
        named = Samples(
            samples.wi, samples.wo, samples.values, channels=names, isotropic=True,
            provenance={"material": " ".join(names), "comments": list(names)},
        )  # fmt: skip
        fitted = homofact.McCool(size=4).fit(named).factorization
        fitted.save(tmp_path / "fit.npz")
        again = homofact.load(str(tmp_path / "fit.npz"))
        assert again.channels == fitted.channels
        write_view(again, tmp_path / "page.html")
        page = (tmp_path / "page.html").read_text("utf-8")
        assert not set(page) & set(FORBIDDEN)
        pages[names] = Elements(page).tags
        # In one of two formats.
        folder = tmp_path / str(k)
        form = ("exr", "png8")[k % 2]
        assert main(["export", str(tmp_path / "fit.npz"), "--out", str(folder), "--format", form]) == 0
        for file in folder.glob("brdf.*"):
            assert not set(file.read_text("utf-8")) & set(FORBIDDEN)
        assert open_result(folder).channels == fitted.channels
        for text in capsys.readouterr():
            assert not set(text) & set(FORBIDDEN)
    assert all(tags == pages[named_so[0]] for tags in pages.values())


def test_the_console_prints_nothing_as_markup(capsys: pytest.CaptureFixture[str]) -> None:
    _Console().print("[/] [red]a[/red] :smile:")
    assert capsys.readouterr().out == "[/] [red]a[/red] :smile:\n"


# What no figure can hold as it stands: half a letter of UTF-8, and what Matplotlib takes for a formula.
@pytest.mark.slow
@pytest.mark.parametrize("name", [os.fsdecode(b"paint\xff.csv"), r"a$\nope$b.csv"])
def test_files_of_any_name_are_fitted_drawn_and_compared(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("matplotlib")
    monkeypatch.chdir(tmp_path)
    try:
        write_csv.write(Path(name), sample_model(material("phong-10").model, 300), ("a paint",))
    except OSError:
        pytest.skip("no such names in this file system")
    fit = ["--method", "mccool", "--size", "4"]
    assert main(["info", name, "--plot", "info.png"]) == 0
    assert main(["factorize", name, *fit, "--out", "fit"]) == 0
    assert main(["compare", name, "--methods", "mccool", "--size", "4", "--plot", "rows.png", "--csv", "rows.csv"]) == 0
    assert main(["compare", name, "--methods", "mccool", "--size", "4", "--chart", "charts"]) == 0
    assert main(["view", "fit", "--out", "view.html"]) == 0
    drawn = ["info.png", "fit/compare.png", "rows.png", *(str(each) for each in Path("charts").glob("*.png"))]
    assert all(Path(each).stat().st_size > 1000 for each in drawn)
    for text in capsys.readouterr():
        assert not set(text) & set(FORBIDDEN)
