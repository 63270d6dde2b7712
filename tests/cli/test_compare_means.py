"""`homofact compare` of several sources and seeds: one table of means, as CSV and LaTeX."""

import csv
import json
from pathlib import Path

import pytest

import homofact
from homofact.brdf.formats.csv import write as write_csv
from homofact.cli.main import main
from homofact.evaluation.wording import brief_figure
from homofact.methods.table import unused_settings

FAST = ["material:phong-10", "material:lafortune-clay", "--count", "300", "--size", "5", "--methods", "mccool,cole"]
FAST += ["--textures", "1", "--restarts", "1", "--search-size", "4"]


@pytest.fixture
def fast(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.mark.slow
@pytest.mark.usefixtures("fast")
def test_several_sources_and_seeds_are_one_table(capsys: pytest.CaptureFixture[str]) -> None:
    line = [*FAST, "--seeds", "0,3", "--csv", "t/a.csv", "--latex", "t/a.tex", "--metrics", "log_mse,male"]
    assert main(["compare", *line, "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert [each["source"] for each in answer["sources"]] == ["phong-10", "lafortune-clay"]
    rows = {
        (each["source"], row["label"], seed["seed"]): seed["error"]["held_out"]["log_mse"]
        for each in answer["sources"]
        for row in each["rows"]
        for seed in row["rows"]
    }
    assert len(rows) == 8
    mean = {each["method"]: each for each in answer["means"]}
    for method in ("mccool", "cole"):
        errors = [error for (_, label, _), error in rows.items() if label == method]
        found = mean[method]
        assert (found["fits"], found["sources"]) == (4, 2)
        assert found["metrics"]["log_mse"]["mean"] == pytest.approx(sum(errors) / 4)
        assert found["metrics"]["log_mse"]["max"] == max(errors)
    with open("t/a.csv", encoding="utf-8", newline="") as file:
        table = list(csv.DictReader(file))
    assert float(table[0]["mean"]) == mean["mccool"]["metrics"]["log_mse"]["mean"]
    assert {row["source"] for row in table} == {"all", "phong-10", "lafortune-clay"}
    assert r"\toprule" in Path("t/a.tex").read_text(encoding="utf-8")
    assert (answer["csv"], answer["latex"]) == ("t/a.csv", "t/a.tex")


@pytest.mark.slow
@pytest.mark.usefixtures("fast")
def test_a_measurement_beside_a_model_has_another_epsilon(capsys: pytest.CaptureFixture[str]) -> None:
    write_csv("clay.csv", homofact.read("material:lafortune-clay", count=300).samples)
    line = ["compare", "clay.csv", *FAST[:1], "--count", "300", "--size", "5", "--methods", "mccool"]
    assert main([*line, "--latex", "a.tex", "--csv", "a.csv"]) == 0
    words = "log_mse, log_mae, log_max: the means are over different ε (clay.csv 0.01, phong-10 1e-05); for one ε give"
    assert f"homofact: {words} --epsilon 0.01\n" in capsys.readouterr().err
    latex = Path("a.tex").read_text(encoding="utf-8").splitlines()
    assert latex[1] == "% clay.csv: epsilon 0.01; 60 of 300 samples held out; as measured, split by seed 0"
    assert latex[3] == f"% Beware: {words} `epsilon=0.01`"
    assert main([*line, "--epsilon", "0.01", "--latex", "a.tex", "--force", "--json"]) == 0
    streams = capsys.readouterr()
    assert "different" not in streams.err
    assert [each["epsilon"] for each in json.loads(streams.out)["means"]] == [0.01]


@pytest.mark.usefixtures("fast")
@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--plot", "a.png"], "plot: found 2 sources, expected one for a figure; draw each in a run of its own"),
        (["--csv", "a.txt"], "a.txt: ends in '.txt', expected .csv"),
        (["--latex", "a"], "a: ends in nothing, expected .tex"),
        (["--by-source"], "by_source: found no LaTeX table, expected a file for one"),
        (["--seeds", "1,1"], "seeds: found '1,1', expected different seeds"),
        (["--seeds", "many"], "seeds: found 'many', expected how many (3)"),
        (["--splits", "0"], "splits: found 0, expected at least 1"),
        (["none.brdf"], "none.brdf"),
    ],
)
def test_what_cannot_be_meant_is_refused_before_a_fit(
    more: list[str], words: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("homofact.evaluation.repeats.fit_repeats", lambda *_: pytest.fail("it fitted"))
    assert main(["compare", *FAST, *more]) == 2
    assert words in " ".join(capsys.readouterr().err.split())
    assert list(Path().iterdir()) == []


@pytest.mark.slow
@pytest.mark.usefixtures("fast")
def test_the_latex_table_can_have_the_rows_of_each_source(capsys: pytest.CaptureFixture[str]) -> None:
    line = ["compare", *FAST[:6], "--methods", "mccool", "--metrics", "log_mse", "--quiet"]
    assert main([*line, "--latex", "a.tex", "--csv", "a.csv", "--by-source"]) == 0
    assert capsys.readouterr().out == ""
    latex = Path("a.tex").read_text(encoding="utf-8").splitlines()
    body = latex[latex.index(r"\midrule") + 1 : latex.index(r"\bottomrule")]
    assert [each for each in body if not each.startswith("McCool")] == [
        r"\multicolumn{5}{l}{phong-10} \\", r"\midrule",
        r"\multicolumn{5}{l}{lafortune-clay} \\", r"\midrule",
        r"\multicolumn{5}{l}{All sources} \\",
    ]  # fmt: skip
    with open("a.csv", encoding="utf-8", newline="") as file:
        means = {row["source"]: float(row["mean"]) for row in csv.DictReader(file)}
    shown = [float(each.split("$")[1].split()[0]) for each in body if each.startswith("McCool")]
    assert shown == pytest.approx([means["phong-10"], means["lafortune-clay"], means["all"]], rel=0.2)
    assert main([*line, "--latex", "b.tex"]) == 0
    assert r"\multicolumn" not in Path("b.tex").read_text(encoding="utf-8")


@pytest.mark.usefixtures("fast")
def test_splits_are_compared_one_by_one(capsys: pytest.CaptureFixture[str]) -> None:
    line = ["compare", FAST[0], "--count", "300", "--size", "5", "--methods", "mccool,svd", "--metrics", "log_mse"]
    line += ["--splits", "3", "--seed", "2", "--latex", "a.tex"]
    assert main([*line, "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    errors = {
        row["label"]: [fit["error"]["held_out"]["log_mse"] for fit in row["rows"]]
        for row in answer["rows"]
    }  # fmt: skip
    assert [[fit["split"]["seed"] for fit in row["rows"]] for row in answer["rows"]] == [[2, 3, 4]] * 2
    (pair,) = answer["split_by_split"]
    ratios = [own / other for own, other in zip(errors[pair["method"]], errors[pair["other"]], strict=True)]
    assert len(set(ratios)) == 3
    assert pair["errors"]["log_mse"]["ratios"] == pytest.approx(ratios)
    lower = sum(ratio < 1 for ratio in ratios)
    assert pair["errors"]["log_mse"]["lower_on"] == lower
    latex = Path("a.tex").read_text(encoding="utf-8").splitlines()
    assert "1 source with method seed 2 and 3 splits" in latex[0]
    assert latex[1].endswith("split by seeds 2 to 4")
    Path("a.tex").unlink()
    assert main(line) == 0
    out = " ".join(capsys.readouterr().out.split())
    assert "standard deviation of 3 fits on different splits" in out
    assert f"{pair['other']} {lower} of 3 {brief_figure(min(ratios))}–{brief_figure(max(ratios))}" in out
    assert "split 2 (trusted:" in out


def test_settings_are_unused_where_no_method_of_the_line_has_them() -> None:
    words = "effort has no effect: neither mccool nor ggx has such a setting; search has it"
    assert unused_settings(["mccool", "ggx"], ["size", "effort"]) == {"effort": words}
    assert unused_settings(["mccool", "search"], ["size", "effort"]) == {}


@pytest.mark.slow
@pytest.mark.usefixtures("fast")
def test_a_setting_that_no_compared_method_has_is_noted(capsys: pytest.CaptureFixture[str]) -> None:
    line = ["compare", FAST[0], "--count", "300", "--size", "5", "--methods", "mccool,ggx", "--metrics", "log_mse"]
    assert main([*line, "--json"]) == 0
    plain = json.loads(capsys.readouterr().out)["rows"]
    assert main([*line, "--textures", "2", "--effort", "quick", "--json"]) == 0
    streams = capsys.readouterr()
    assert "homofact: effort has no effect: neither mccool nor ggx has such a setting; search has it" in streams.err
    assert "textures has no effect: neither mccool nor ggx" in " ".join(streams.err.split())
    assert [row["error"] for row in json.loads(streams.out)["rows"]] == [row["error"] for row in plain]
    assert main([*line[:-2], "--textures", "2", "--chart", "chart", "--quiet"]) == 0
    mixed = ["mccool,search" if part == "mccool,ggx" else part for part in line]
    capsys.readouterr()
    assert main([*mixed, "--effort", "quik"]) == 2
    assert "effort: found 'quik', expected quick, normal" in capsys.readouterr().err
