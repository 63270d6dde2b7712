"""`homofact compare` of several sources and seeds: one table of means, as CSV and LaTeX."""

import csv
import json
from pathlib import Path

import pytest

from homofact.cli.main import main

FAST = ["material:phong-10", "material:lafortune-clay", "--count", "300", "--size", "5", "--methods", "mccool,cole"]
FAST += ["--textures", "1", "--restarts", "1", "--search-size", "4"]


@pytest.fixture
def fast(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)


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


@pytest.mark.usefixtures("fast")
@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--plot", "a.png"], "plot: found 2 sources, expected one for a figure"),
        (["--csv", "a.txt"], "a.txt: ends in '.txt', expected .csv"),
        (["--latex", "a"], "a: ends in nothing, expected .tex"),
        (["--seeds", "1,1"], "seeds: found '1,1', expected different seeds"),
        (["--seeds", "many"], "seeds: found 'many', expected how many (3)"),
        (["none.brdf"], "none.brdf"),
    ],
)
def test_what_cannot_be_meant_is_refused_before_a_fit(
    more: list[str], words: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("homofact.evaluation.seeds.fit_seeds", lambda *_: pytest.fail("it fitted"))
    assert main(["compare", *FAST, *more]) == 2
    assert words in " ".join(capsys.readouterr().err.split())
    assert list(Path().iterdir()) == []
