"""Means over sources and seeds: hand-made numbers, digits by the deviation, CSV and LaTeX that others read back."""

import csv
import io
import math
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest
from pylatexenc.latex2text import LatexNodes2Text
from pylatexenc.latexwalker import LatexEnvironmentNode, LatexWalker

from homofact.api.progress import ProgressStep, ProgressSteps
from homofact.errors import BadInput
from homofact.evaluation.latex_means import escaped, latex_of, rounded
from homofact.evaluation.means import (
    MeasuredFit,
    csv_of,
    mean_rows,
    mixed_epsilons,
    same_fits,
    settings_in_words,
    without_numbers,
)
from homofact.evaluation.metric_table import METRICS
from homofact.evaluation.repeats import asked_seeds
from homofact.methods.cole import Cole
from homofact.methods.fitting import FitProgress
from homofact.methods.mccool import McCool
from homofact.methods.search import Search
from homofact.methods.table import ALL_METHODS

HOSTILE = r"50%_of #1 & {a}\input{x} $x$ ~^ <b>|\"quoted\""


def fit(source: str, method: str, seed: int, nbytes: int, log_mse: float | None, psnr: float = 30.0) -> MeasuredFit:
    numbers = {"log_mse": log_mse, "mae": 0.5, "psnr": psnr}
    return MeasuredFit(source, method, seed, nbytes, 3, numbers, 0.01, 300, 60)


FITS = [
    fit("paint", "search", 0, 6144, 0.1), fit("paint", "search", 1, 6144, 0.3),
    fit("clay", "search", 0, 6144, 0.5), fit("clay", "search", 1, 3072, 0.7),
    fit("paint", "mccool", 0, 6144, 0.4, math.inf), fit("clay", "mccool", 0, 6144, None),
]  # fmt: skip


def test_fits_are_gathered_by_method_and_bytes() -> None:
    small, large, mccool = mean_rows(FITS)
    assert [(row.method, row.nbytes, row.sources, row.fits) for row in (small, large, mccool)] == [
        ("search", 3072, 1, 1), ("search", 6144, 2, 3), ("mccool", 6144, 2, 2),
    ]  # fmt: skip
    found = large.spreads["log_mse"]
    assert found is not None
    # Of the sources' means 0.2 and 0.5: mean 0.35 and √(2 · 0.15²); of the seeds 0.1 and 0.3 √(2 · 0.1²).
    assert (found.mean, found.deviation) == pytest.approx((0.35, 0.15 * 2**0.5))
    assert (found.count, found.low, found.high) == (3, 0.1, 0.5)
    assert large.within_source["log_mse"] == pytest.approx(0.1 * 2**0.5)
    one = small.spreads["log_mse"]
    assert one is not None
    assert one.deviation is None
    assert mccool.spreads["log_mse"] is None
    psnr = mccool.spreads["psnr"]
    assert psnr is not None
    assert (psnr.mean, psnr.deviation) == (math.inf, None)
    assert [row.fits for row in mean_rows(FITS, "clay")] == [1, 1, 1]
    # Of one source the deviation is that of its seeds, and stands once.
    (paint, _) = mean_rows(FITS, "paint")
    one = paint.spreads["log_mse"]
    assert one is not None
    assert (one.deviation, paint.within_source["log_mse"]) == (pytest.approx(0.1 * 2**0.5), None)
    assert (mccool.within_source["psnr"], mccool.within_source["log_mse"]) == (None, None)


def test_the_deviation_within_source_is_over_the_sources_that_have_several() -> None:
    values = {"paint": (1.0, 3.0), "clay": (5.0, 5.0, 8.0), "skin": (7.0,)}
    fits = [fit(source, "search", k, 4, value) for source, own in values.items() for k, value in enumerate(own)]
    (row,) = mean_rows(fits)
    found = row.spreads["log_mse"]
    assert found is not None
    # Each source counts once: 2, 6 and 7. Variances of seeds: 2 and 3.
    assert (found.mean, found.deviation) == pytest.approx((5.0, 7**0.5))
    assert row.within_source["log_mse"] == pytest.approx(2.5**0.5)
    (line,) = [line for line in latex_of(fits).splitlines() if line.startswith("Search")]
    assert line.split(" & ")[4] == r"$5.00 \pm 2.65\;(1.6)$"


def test_fits_of_as_many_asked_bytes_are_one_row_with_the_most_bytes_and_fetches() -> None:
    sizes = ((6132, 2), (6120, 3), (6144, 1))
    fits = [replace(fit("paint", "search", k, n, 0.1), asked=6144, fetches=f) for k, (n, f) in enumerate(sizes)]
    (row,) = mean_rows(fits)
    assert (row.nbytes, row.fetches, row.fits) == (6144, 3, 3)
    other = replace(fit("paint", "search", 0, 3060, 0.1), asked=3072)
    assert [each.nbytes for each in mean_rows([*fits, other])] == [3060, 6144]
    # Bytes that were not asked for are told apart.
    assert len(mean_rows([replace(one, asked=None) for one in fits])) == 3


@pytest.mark.parametrize(
    ("mean", "deviation", "expected"),
    [
        (0.123456, 0.0123, ("0.123", "0.012", 0)),
        (0.123456, 0.0345, ("0.123", "0.034", 0)),
        (0.5, 0.0996, ("0.500", "0.100", 0)),
        (0.5, 0.0949, ("0.500", "0.095", 0)),
        (45.2, 14.7, ("45.2", "14.7", 0)),
        (24.3, 31.0, ("24.3", "31.0", 0)),
        (1234.0, 56.0, ("1230", "60", 0)),
        (12.345, None, ("12.3", "", 0)),
        (0.00123, 0.0, ("0.00123", "0", 0)),
        (0.0, 0.0, ("0.00", "0", 0)),
        (1.2345e-5, 3.2e-7, ("1.23", "0.03", -5)),
        (-1.2345e-5, 3.2e-7, ("-1.23", "0.03", -5)),
        (123456.0, 1234.0, ("1.235", "0.012", 5)),
        (1e-7, 2.0, ("0.00", "2.00", 0)),
    ],
)
def test_a_mean_has_three_digits_or_those_of_its_deviation(
    mean: float, deviation: float | None, expected: tuple
) -> None:
    assert rounded(mean, deviation) == expected


def test_the_csv_reads_back_to_the_last_bit() -> None:
    rows = list(csv.DictReader(io.StringIO(csv_of(FITS))))
    assert [row["source"] for row in rows[::3]] == ["all"] * 3 + ["paint"] * 2 + ["clay"] * 3
    picked = {(row["source"], row["method"], row["bytes"], row["metric"]): row for row in rows}
    assert len(picked) == len(rows)
    row = picked["all", "search", "6144", "log_mse"]
    assert float(row["mean"]) == pytest.approx(0.35, rel=1e-15)
    assert float(row["standard_deviation"]) == pytest.approx(0.15 * 2**0.5)
    assert float(row["within_source"]) == pytest.approx(0.1 * 2**0.5)
    assert picked["paint", "search", "6144", "log_mse"]["within_source"] == ""
    assert (row["sources"], row["fits"], row["fetches"], row["unit"]) == ("2", "3", "3", "")
    assert picked["all", "search", "6144", "mae"]["unit"] == "sr⁻¹"
    assert picked["all", "mccool", "6144", "log_mse"]["mean"] == ""
    assert picked["all", "mccool", "6144", "psnr"]["mean"] == "inf"
    assert picked["paint", "search", "6144", "log_mse"]["fits"] == "2"


def test_means_over_different_epsilons_are_named() -> None:
    mixed = [replace(one, epsilon=1e-5) if one.source == "clay" else one for one in FITS]
    assert mixed_epsilons(FITS) == ""
    words = "log_mse: the mean is over different ε (paint 0.01, clay 1e-05); for one ε give `epsilon=0.01`"
    assert mixed_epsilons(mixed) == words
    assert f"% Beware: {words}" in latex_of(mixed)
    assert "Beware" not in latex_of(FITS)
    # Errors of f have no ε.
    assert mixed_epsilons([replace(one, values={"mae": 0.5}) for one in mixed]) == ""
    assert [row.epsilon for row in mean_rows(mixed)] == [1e-5, None, None]
    rows = list(csv.DictReader(io.StringIO(csv_of(mixed))))
    found = {(row["source"], row["metric"]): row["epsilon"] for row in rows if row["method"] == "mccool"}
    assert (found["all", "log_mse"], found["paint", "log_mse"], found["clay", "log_mse"]) == ("", "0.01", "1e-05")
    assert found["paint", "mae"] == ""


def test_the_latex_names_the_samples_of_each_source() -> None:
    whole = [replace(one, held_out=0) if one.source == "clay" else one for one in FITS]
    lines = latex_of(whole).splitlines()
    assert lines[1] == "% paint: epsilon 0.01; 60 of 300 samples held out"
    assert lines[2] == "% clay: epsilon 0.01; no sample of 300 held out"


def cells(latex: str) -> list[list[str]]:
    """The rows of the only tabular as a strict parser of LaTeX reads them, as text."""
    nodes, _, _ = LatexWalker(latex, tolerant_parsing=False).get_latex_nodes()
    (tabular,) = [node for node in nodes if isinstance(node, LatexEnvironmentNode)]
    assert tabular.environmentname == "tabular"
    body = "".join(node.latex_verbatim() for node in tabular.nodelist)
    for rule in (r"\toprule", r"\midrule", r"\bottomrule"):
        assert body.count(rule) == 1
        body = body.replace(rule, "")
    text = LatexNodes2Text(math_mode="text")
    # An escaped ampersand is no border.
    rows = [line.replace(r"\&", "\0").split("&") for line in body.split("\\\\\n") if line.strip()]
    return [[text.latex_to_text(cell.replace("\0", r"\&")).strip() for cell in row] for row in rows]


def test_the_latex_is_what_a_parser_of_latex_reads() -> None:
    latex = latex_of([*FITS, fit("paint", HOSTILE, 0, 10, 1.5e-5)])
    head, small, large, mccool, hostile, (note,) = cells(latex)
    assert "±: over the sources" in note
    # 0.7 and 1.5e-5 in one column: the head has the power of ten of both.
    assert [cell.replace(" ", "") for cell in head[:5]] == [
        "Method", "Bytes", "Fetches", "Fits", "LogMSE(10^-3)",
    ]  # fmt: skip
    assert [cell.replace(" ", "") for cell in head[5:]] == ["MAE(sr^-1)", "PSNR(dB)"]
    assert small == ["Search", "3072", "3", "1", "700", "0.500", "30.0"]
    assert [cell.replace(" ", "") for cell in large] == [
        "Search",
        "6144",
        "3",
        "3",
        "350±212(140)",
        "0.500±0(0)",
        "30.0±0(0)",
    ]
    assert [cell.strip() for cell in mccool[4:]] == ["–", "0.500 ± 0", "∞"]
    assert hostile[0].replace("ˆ", "^").replace(" ", "") == HOSTILE.replace(" ", "")
    assert hostile[4].replace(" ", "") == "0.0150"
    assert r"\begin{tabular}{lrrrrrr}" in latex
    assert latex.splitlines()[0].endswith("2 sources with method seeds 0 and 1, on held-out samples.")


@pytest.mark.parametrize(
    ("means", "head", "both"),
    [
        ((92426.0, 7574.0), "LogMSE", "50000 ± 60000"),
        ((924260.0, 75740.0), "LogMSE(10^5)", "5.00 ± 6.00"),
        ((0.004, 0.002), "LogMSE", "0.00300 ± 0.00141"),
        ((0.0004, 0.0002), "LogMSE(10^-4)", "3.00 ± 1.41"),
    ],
)
def test_a_column_has_a_power_of_ten_only_where_its_numbers_need_one(
    means: tuple[float, float], head: str, both: str
) -> None:
    first, row = cells(latex_of([fit("paint", "search", seed, 4, mean) for seed, mean in enumerate(means)]))
    assert (first[4].replace(" ", ""), row[4].strip()) == (head, both)


@pytest.mark.parametrize("name", ALL_METHODS)
def test_latex_writes_each_method_as_papers_do(name: str) -> None:
    (_, row) = cells(latex_of([fit("paint", name, 0, 4, 1.0)]))
    assert row[0].lower() == name
    assert row[0] != name
    (_, row) = cells(latex_of([fit("paint", f"{name}:wi+h", 0, 4, 1.0)]))
    assert row[0].lower() == f"{name} (wi+h)"


def test_latex_has_no_options_in_its_names() -> None:
    for label, words in (("ggx:1", "GGX (1 lobe)"), ("ggx:2", "GGX (2 lobes)"), ("svd:half-diff", "SVD (half-diff)")):
        (_, row) = cells(latex_of([fit("paint", label, 0, 4, 1.0)]))
        assert row[0] == words


def test_a_name_cannot_leave_its_comment_or_its_cell() -> None:
    latex = latex_of([fit("a\n\\end{tabular}\r\u2028x", "b\n\\end{tabular}", 0, 4, 1.0)])
    assert latex.count("\n\\end{tabular}") == 1
    assert len(cells(latex)) == 2
    assert escaped("\\") == r"\textbackslash{}"


def test_a_compiler_takes_the_table(tmp_path: Path) -> None:
    compiler = shutil.which("pdflatex") or shutil.which("tectonic")
    if compiler is None:
        pytest.skip("no pdflatex or tectonic here")
    text = latex_of([*FITS, fit("paint", HOSTILE, 0, 10, 1.5e-5)])
    start = "\\documentclass{article}\n\\usepackage[T1]{fontenc}\n\\usepackage{booktabs}\n\\begin{document}\n"
    (tmp_path / "a.tex").write_text(f"{start}{text}\\end{{document}}\n", encoding="utf-8")
    flags = ["-interaction=nonstopmode", "-halt-on-error"] if "pdflatex" in compiler else []
    run = subprocess.run([compiler, *flags, "a.tex"], cwd=tmp_path, capture_output=True, text=True)
    assert run.returncode == 0, run.stdout


@pytest.mark.parametrize("name", METRICS)
def test_every_metric_has_a_head_in_latex(name: str) -> None:
    fits = [MeasuredFit("paint", "mccool", 0, 12, 3, {name: 0.5}, 0.01, 300, 60)]
    assert METRICS[name].unit == "" or "(" in cells(latex_of(fits))[0][-1]


@pytest.mark.parametrize(
    ("text", "seeds"), [("3", (5, 6, 7)), ("0,1,2", (0, 1, 2)), ("7,", (7,)), (" 4, 2 ", (4, 2)), ("1", (5,))]
)
def test_seeds_are_counted_or_listed(text: str, seeds: tuple[int, ...]) -> None:
    assert asked_seeds(5, text) == seeds


@pytest.mark.parametrize("text", ["", "0", "-1", "1,-2", "two", "1.5", "1,,2", ",", "1,1", "²", f"1,{2**63}", "9" * 30])
def test_seeds_that_are_none_are_refused(text: str) -> None:
    with pytest.raises(BadInput, match="seeds: found"):
        asked_seeds(0, text)


def test_numbers_of_a_column_have_one_power_of_ten() -> None:
    def column(*values: float) -> tuple[str, list[str]]:
        head, *rows = cells(latex_of([fit("paint", f"m{k}", 0, 4, value) for k, value in enumerate(values)]))
        return head[4].replace(" ", ""), [row[4].replace(" ", "") for row in rows]

    assert column(0.5, 0.00123) == ("LogMSE", ["0.500", "0.00123"])
    assert column(1.23e-5, 4.56e-6) == ("LogMSE(10^-6)", ["12.3", "4.56"])
    assert column(1.23e-5, 0.04) == ("LogMSE(10^-4)", ["0.123", "400"])
    assert column(123456.0, 2e4) == ("LogMSE(10^4)", ["12.3", "2.00"])
    # Too far apart for one: each has its own, and all are written alike.
    assert column(1e-6, 0.5) == ("LogMSE", ["1.00×10^-6", "5.00×10^-1"])
    # The unit stands beside the power.
    (head, _) = cells(latex_of([replace(FITS[0], values={"mae": 1e-5})]))
    assert head[4].replace(" ", "") == "MAE(10^-5sr^-1)"


def test_the_note_names_what_scatters_in_the_rows_of_a_source() -> None:
    fits = [replace(fit(source, "search", 0, 4, 0.1 + 0.01 * split), split_seed=split)
            for source in ("paint", "clay") for split in (0, 1)]  # fmt: skip
    whole, each = (latex_of(fits, by_source).splitlines() for by_source in (False, True))
    (note,), (of_rows,) = ([line for line in lines if "footnotesize" in line] for lines in (whole, each))
    assert "rows of one source" not in note
    assert "rows of one source: over its" in of_rows


def test_sizes_are_bounds_where_the_method_chooses_the_shape() -> None:
    assert "size up to 16²" in settings_in_words(McCool(size=16))
    assert "size 16" in settings_in_words(Search(size=16))


def test_rows_of_sources_share_the_powers_of_the_whole_table() -> None:
    small = [fit("paint", "search", 0, 4, 1e-5), fit("clay", "search", 0, 4, 3e-5)]
    latex = latex_of(small, by_source=True)
    assert latex.count("times 10^") == 0
    assert [line.split(" & ")[4] for line in latex.splitlines() if line.startswith("Search")] == [
        "$1.00$", "$3.00$", r"$2.00 \pm 1.41$",
    ]  # fmt: skip


def test_fits_that_are_not_reciprocal_are_marked() -> None:
    free = replace(FITS[0], swapped=0.042, settings="textures 2, size 16, effort normal")
    latex = latex_of([free, *FITS[1:]])
    lines = latex.splitlines()
    assert lines[3] == "% search: textures 2, size 16, effort normal; 1 of 4 fits not reciprocal"
    rows = [line for line in lines if line.startswith(("Search", "McCool"))]
    assert [r"$^{\dagger}$" in row for row in rows] == [False, True, False]
    assert lines[-2].startswith(r"\multicolumn{7}{l}{")
    assert r"changes up to 4\% of the light." in lines[-2]
    assert lines[-3].startswith(r"\multicolumn{7}{l}{\footnotesize $\pm$: over the sources")
    assert lines[-4] == r"\bottomrule"
    # Rounding is no lack of reciprocity.
    assert "dagger" not in latex_of([replace(FITS[0], swapped=1e-6), *FITS[1:]])


def test_a_deviation_of_nothing_is_explained() -> None:
    assert same_fits(FITS) == ""
    # Two seeds of a source with the same numbers, and one fit of another.
    paint, clay = [fit("paint", "search", seed, 4, 0.1) for seed in (0, 1)], fit("clay", "search", 0, 4, 0.3)
    assert same_fits(paint).startswith("search: all seeds")
    assert same_fits([*paint, clay]).startswith("search on paint: all seeds")
    assert same_fits([*paint, clay, replace(clay, seed=1)]).startswith("search: all seeds")
    # On several splits it is not the seed that their numbers scatter with.
    assert same_fits([*paint, replace(clay, split_seed=1)]) == ""
    assert same_fits([paint[0], replace(paint[1], nbytes=8)]) == ""
    assert same_fits([paint[0], replace(paint[1], method="cole")]) == ""
    assert f"% {same_fits(paint)}" in latex_of(paint).splitlines()
    # Of several splits the deviation is theirs.
    splits = [*paint, *(replace(each, split_seed=1, values={"log_mse": 0.2}) for each in paint)]
    assert same_fits(splits).endswith("that of the splits alone")
    assert same_fits([*splits[:3], replace(splits[3], values={"log_mse": 0.3})]) == ""


def test_notes_are_comments_of_the_latex_table() -> None:
    assert "% search against ggx: 5 of 5" in latex_of(FITS, notes=["search against ggx: 5 of 5"]).splitlines()


def test_the_settings_that_decide_are_named() -> None:
    assert settings_in_words(Search(textures=2, size=16, effort="quick")).startswith(
        "textures 2, size 16, effort quick"
    )
    assert settings_in_words(Search(bytes=4096)).startswith("textures up to 3, bytes 4096, effort normal")
    cole = settings_in_words(Cole(textures=2, size=16, restarts=4))
    assert "restarts 4, joint_terms 2" in cole
    assert "effort" not in cole


@pytest.mark.parametrize("projections", [None, ("theta_h-theta_d", "theta_h-theta_d")])
@pytest.mark.parametrize("effort", ["quick", "normal", "thorough", 300])
def test_restarts_are_named_where_a_search_makes_them(effort: str | float, projections: tuple[str, ...] | None) -> None:
    """A quick or normal search of known mixes makes none, and its progress names none either."""
    words = settings_in_words(Search(effort=effort, projections=projections))
    assert ("restarts 6" in words) == (projections is not None or effort not in ("quick", "normal"))


@pytest.mark.parametrize(("restarts", "words"), [(1, "fit: term 1/2"), (6, "fit: term 1/2, restart 1/6")])
def test_progress_names_restarts_where_there_are_several(restarts: int, words: str) -> None:
    told: list[ProgressStep] = []
    steps = ProgressSteps(told.append)
    steps.stage("fit")
    steps(FitProgress(1, 2, 1, restarts, 10, 0.1))
    assert told[-1].stage == words


def test_sources_without_a_number_are_named_once_for_each_metric() -> None:
    fits = [fit("paint", "search", 0, 12, 0.1), fit("clay", "search", 0, 12, None), fit("clay", "search", 1, 12, None)]
    assert without_numbers(fits) == "no mean of log_mse: clay has none"
    assert without_numbers(fits[:1]) == ""
    assert without_numbers([]) == ""
