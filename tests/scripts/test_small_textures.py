"""The study in docs/papers/small_textures: its source hangs together, and one command makes all that it includes."""

import json
import re
import shutil
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

latexwalker = pytest.importorskip("pylatexenc.latexwalker")

from scripts.papers import small_results, small_textures  # noqa: E402
from scripts.papers.latex import Macros, booktabs, figure, fixed, words  # noqa: E402
from scripts.papers.small_figures import FIGURES  # noqa: E402
from scripts.papers.small_numbers import claims, numbers  # noqa: E402
from scripts.papers.small_tables import TABLES  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
PAPER = ROOT / "docs" / "papers" / "small_textures"
SOURCE = (PAPER / "paper.tex").read_text(encoding="utf-8")
# The commands of LaTeX and of the paper's packages that its text may use; every other one has to be a number's.
_LATEX_WORDS = """
begin end item input includegraphics caption centering label ref eqref cite citep citet section subsection paragraph
maketitle bibliography bibliographystyle footnotesize scriptsize setlength tabcolsep columnwidth emph texttt code
frac tfrac sum prod log exp max cos bigl bigr Bigl Bigr approx tilde hat partial nabla top ast lambda mu theta pi rho
varepsilon delta alpha beta omega wi wo ell langle rangle le gg pm mapsto operatorname qquad quad circ raggedright
"""
LATEX = set(re.findall(r"\w+", _LATEX_WORDS))


@pytest.fixture(scope="module")
def results() -> small_results.Results:
    return small_results.read(small_results.KEPT)


@pytest.fixture
def kept(tmp_path: Path) -> Path:
    """A copy of the kept results, to change."""
    return Path(shutil.copytree(small_results.KEPT, tmp_path / "kept"))


def nodes_of(text: str) -> list[Any]:
    """The parse of a source; raises where a brace, an environment or a formula is not closed."""
    return latexwalker.LatexWalker(text, tolerant_parsing=False).get_latex_nodes()[0]


def body() -> str:
    """The document without comments."""
    text = re.sub(r"(?<!\\)%.*", "", SOURCE)
    return text[text.index(r"\begin{document}") :]


def arguments_of(*commands: str) -> list[str]:
    """The arguments of some commands in the source, split at commas."""
    found = re.findall(rf"\\(?:{'|'.join(commands)})(?:\[[^]]*\])?{{([^}}]*)}}", SOURCE)
    return [each.strip() for group in found for each in group.split(",")]


def change(file: Path, edit: Any) -> None:
    """Edit the rows of a file of JSON lines; `edit` gets all of them as a dict."""
    rows = dict(json.loads(line) for line in file.read_text(encoding="utf-8").splitlines())
    edit(rows)
    file.write_text("".join(json.dumps(row) + "\n" for row in rows.items()), encoding="utf-8")


def test_the_source_parses() -> None:
    assert len(nodes_of(SOURCE)) > 10
    for broken in (r"\end{equation}", r"\end{itemize}", r"\end{table*}"):
        with pytest.raises(latexwalker.LatexWalkerParseError):
            nodes_of(SOURCE.replace(broken, "", 1))


def test_every_reference_has_its_label() -> None:
    labels = Counter(arguments_of("label"))
    assert max(labels.values()) == 1
    assert set(arguments_of("ref", "eqref")) <= set(labels)
    floats = {label for label in labels if label.split(":")[0] in ("fig", "tab")}
    assert floats <= set(arguments_of("ref"))  # the text names every figure and table
    assert len(floats) == len(FIGURES) + len(TABLES)


def test_every_work_is_in_the_bibliography() -> None:
    (named,) = arguments_of("bibliography")
    bibliography = (PAPER / f"{named}.bib").resolve()
    assert bibliography == ROOT / "docs" / "references.bib"
    keys = set(re.findall(r"^@\w+{(\w+),", bibliography.read_text(encoding="utf-8"), re.MULTILINE))
    cited = set(arguments_of("cite", "citep", "citet"))
    assert cited <= keys
    works = {"McCool2001", "Cole2002", "Wang2004", "Sztrajman2021", "Bagher2016", "Dupuy2018", "Belcour2014"}
    assert works <= cited


def test_every_file_is_made_by_the_command_and_used() -> None:
    made = {f"tables/{name}" for name in (*TABLES, "numbers")} | {f"figures/{name}.pdf" for name in FIGURES}
    named = arguments_of("input", "includegraphics")
    assert Counter(named) == Counter(made)
    for each in named:
        assert (PAPER / each).is_file() or (PAPER / f"{each}.tex").is_file()


def test_every_command_is_latex_or_a_number(results: small_results.Results) -> None:
    known = set(re.findall(r"\\newcommand{\\(\w+)}", numbers(results).text()))
    used = set(re.findall(r"\\([A-Za-z]+)", body()))
    assert used - LATEX <= known
    assert len(used & known) > 60
    assert not known & LATEX
    assert not known & set(re.findall(r"\\newcommand{\\(\w+)}", SOURCE))


def test_no_number_is_typed_by_hand() -> None:
    text = re.sub(r"\\begin{(equation|verbatim)}.*?\\end{\1}", "", body(), flags=re.DOTALL)
    text = re.sub(r"(?<!\\)\$[^$]*\$", "", text)
    text = re.sub(
        r"\\(?:cite[pt]?|ref|eqref|label|input|includegraphics|setlength{\\\w+})(?:\[[^]]*\])?{[^}]*}", "", text
    )
    assert re.findall(r".*\d.*", text) == []
    formulas = re.findall(r"(?<!\\)\$([^$]*)\$", body())
    assert [each for each in formulas if re.search(r"\d\.\d|\d{2}", re.sub(r"tfrac12", "", each))] == []


@pytest.mark.slow
def test_the_kept_files_are_those_of_the_kept_results(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Tables byte for byte; figures by the same libraries only, so they are compared with a second run instead."""
    made = []
    for folder in (tmp_path / "one", tmp_path / "two"):
        assert small_textures.main(["--paper", str(folder)]) == 0
        assert capsys.readouterr().out == ""
        made.append({path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()})
    assert made[0] == made[1]
    assert len(made[0]) == len(TABLES) + 1 + len(FIGURES)
    for place, text in made[0].items():
        assert place.suffix == ".pdf" or text == (PAPER / place).read_bytes(), f"run small_textures.py: {place}"
        assert place.suffix != ".pdf" or text.startswith(b"%PDF")


@pytest.mark.parametrize("name", TABLES)
def test_every_row_of_a_table_has_a_cell_per_column(results: small_results.Results, name: str) -> None:
    text = TABLES[name](results)
    assert nodes_of(text)
    columns = len(re.search(r"@{}(\w+)@{}", text)[1])  # type: ignore[index]
    rows = [line for line in text.splitlines() if line.endswith(r"\\")]
    assert len(rows) > 3
    assert {line.count("&") + 1 for line in rows} == {columns}
    assert text.isascii()


def test_the_numbers_are_those_of_the_pages(results: small_results.Results) -> None:
    """docs/real.md publishes the same lines: 3.2 KiB against the published network."""
    page = (ROOT / "docs" / "real.md").read_text(encoding="utf-8")
    made = numbers(results)
    assert f"{made['ratioRawThree']}, lower on {made['lowerRawThree']} of {made['rglCount']}" in page
    row = next(line for line in page.splitlines() if line.startswith("| ours 3.2 KiB | 10 |")).split(" | ")
    assert row[2:5] == [made["bytesThree"], made["maleThree"], made["rmsThree"]]
    assert row[10] == made["psnrThree"]


def test_the_comparisons_of_the_text_hold(results: small_results.Results) -> None:
    assert [words for words, holds in claims(results) if not holds] == []


@pytest.mark.slow
def test_other_results_show_which_sentence_is_wrong(
    kept: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def worse(rows: dict[str, Any]) -> None:
        rows["irid_flake_paint1_rgb"]["tilt"]["in_plane"]["interval"] = [0.5, 0.6]

    change(kept / "straightening.jsonl", worse)
    assert small_textures.main(["--results", str(kept), "--paper", str(tmp_path / "paper")]) == 1
    told = capsys.readouterr().err
    assert "do not bear out: the intervals of both variants of the flake paint overlap." in told
    assert told.count("do not bear out") == 1


def test_missing_results_are_refused(kept: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    paper = tmp_path / "paper"
    given = ["--results", str(kept), "--paper", str(paper)]
    change(kept / "relighting.jsonl", lambda rows: rows.popitem())
    assert small_textures.main(given) == 2
    assert "found no line of spot | golden yellow | factored, 32 terms" in capsys.readouterr().err
    (kept / "slices.jsonl").unlink()
    assert small_textures.main(given) == 2
    assert "slices.jsonl" in capsys.readouterr().err
    assert not paper.exists()


def test_a_material_that_some_way_has_not_fitted_is_left_out(kept: Path) -> None:
    before = small_results.read(kept).time
    last = list(before)[-1]
    change(kept / "time.jsonl", lambda rows: rows.pop(f"{last} nbrdf"))
    assert list(small_results.read(kept).time) == list(before)[:-1]


@pytest.mark.slow
def test_anew_replaces_results_when_they_are_whole(kept: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An ended run leaves the older results; the next one goes on and notes its conditions."""
    rows = dict(small_results.Finished(kept / "slices.jsonl").items())
    before = (kept / "slices.jsonl").read_bytes()
    run: list[int] = []

    def measured(_: Path, file: Path) -> None:
        finished = small_results.Finished(file)
        for key in rows:
            if key not in finished:
                run.append(1)
                finished.keep(key, rows[key])
                if len(run) == 2:
                    raise KeyboardInterrupt

    monkeypatch.setitem(small_results.EXPERIMENTS, "slices", (measured, "scripts/papers/here.py"))
    given = ["--anew", "slices", "--results", str(kept), "--paper", str(tmp_path / "paper")]
    with pytest.raises(KeyboardInterrupt):
        small_textures.main(given)
    assert (kept / "slices.jsonl").read_bytes() == before
    assert small_textures.main(given) == 0
    assert len(run) == len(rows)
    assert not (kept / "slices.new.jsonl").exists()
    noted = small_results.read(kept).conditions
    assert noted["slices"]["command"] == "python scripts/papers/here.py"
    assert noted["search"] == small_results.read(small_results.KEPT).conditions["search"]


def test_profiles_of_a_straightened_measurement_agree(results: small_results.Results) -> None:
    """The figure's claim: swapping light and viewer moves the raw highlight, and the straightened one far less."""
    for degrees in small_results.SLICE_DEGREES:
        apart = {}
        for kind in ("raw", "straightened"):
            found = results.slices[f"{kind} {degrees:g}"]
            pairs = list(zip(found["measured"], found["swapped"], strict=True))
            apart[kind] = sum((a - b) ** 2 for a, b in pairs) / sum((a + b) ** 2 for a, b in pairs)
        assert apart["straightened"] < 0.1 * apart["raw"]


def test_cells_are_latex() -> None:
    assert words("a_b × 5%") == r"a\_b $\times$ 5\%"
    with pytest.raises(ValueError, match="no LaTeX for"):
        words("ε")
    assert (figure(0.00258), figure(-2.0), figure(1.5e-5), figure(None)) == (
        "0.00258",
        "$-2$",
        r"$1.50\cdot 10^{-5}$",
        "--",
    )
    assert (fixed(0.07, 3, sign=True), fixed(-0.35, 2), fixed(1.0, 1)) == ("$+0.070$", "$-0.35$", "1.0")
    made = booktabs(("a b", "dB, $x$", "$y$"), [("c", "d", "e"), None])
    assert r"A b & dB, $x$ & $y$ \\" in made
    assert r"c & d & e \\" in made
    with pytest.raises(ValueError, match="a row of 1 cells"):
        booktabs(("a", "b"), [("c",)])


def test_a_number_has_one_name() -> None:
    macros = Macros()
    macros.add("maleThree", 0.5)
    assert macros.text() == r"\newcommand{\maleThree}{0.5}" + "\n"
    for name in ("maleThree", "male3", "a_b", ""):
        with pytest.raises(ValueError, match="is taken, or has more than letters"):
            macros.add(name, 1)
