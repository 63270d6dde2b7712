"""`homofact research terms`: counts, costs, the comparison with a fit, and what is refused."""

import json

import pytest

from homofact.cli.main import main
from homofact.theory.term_costs import map_bytes

MATERIAL = "material:torrance-sparrow-20"


def test_the_counts_and_the_bytes(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["research", "terms", MATERIAL, "--count", "50", "--json"]) == 0
    out, err = capsys.readouterr()
    answer = json.loads(out)
    assert err == ""
    assert (answer["share"], answer["limit_degrees"], answer["settled"]) == (0.99, pytest.approx(85), True)
    assert answer["measured"] == pytest.approx(answer["predicted"], rel=0.2)
    assert answer["predicted"] == round((answer["l_star"] + 1) ** 2 / 4)
    assert answer["bytes"] == answer["measured"] * 2 * 32 * 32 * 3 * 4 == map_bytes(answer["measured"], 3)
    assert "fit" not in answer


def test_less_energy_and_one_channel_need_less(capsys: pytest.CaptureFixture[str]) -> None:
    answers = []
    for more in ([], ["--share", "0.9"], ["--limit", "60"], ["--channels", "G"]):
        assert main(["research", "terms", MATERIAL, "--count", "50", "--json", *more]) == 0
        answers.append(json.loads(capsys.readouterr().out))
    whole, *less = answers
    assert all(each["bytes"] < whole["bytes"] for each in less)
    assert all(each["measured"] < whole["measured"] for each in less[:2])


def test_a_table_for_people(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["research", "terms", MATERIAL, "--count", "50"]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    for words in ("0.99 of Σσ²", "θ ≤ 85°", "= (l* + 1)²/4", "by SVD", "as 32² maps"):
        assert words in shown


def test_a_count_that_has_not_settled_is_said_to_be_rough(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["research", "terms", "material:ward-brushed", "--count", "50"]) == 0
    out, err = capsys.readouterr()
    assert "about" in out
    assert "are a rough count: the highlight is too sharp for the finest grid, 20 rings of 60" in err
    assert err.count("\n") == 1


@pytest.mark.slow
def test_beside_a_fit(tmp_path, capsys: pytest.CaptureFixture[str]) -> None:
    quick = tmp_path / "quick.toml"
    quick.write_text('[fit]\nmethod = "mccool"\nsize = 8\n')
    assert main(["research", "terms", MATERIAL, "--fit", "--count", "1500", "-c", str(quick), "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    beside = answer["within_limit"]
    assert 150 < beside["samples"] < 300  # of 300 held out, those within 85°
    assert beside["counted"]["terms"] == answer["measured"]
    assert beside["counted"]["bytes"] == answer["bytes"]
    assert beside["counted"]["fetches"] == 2 * answer["measured"]
    assert 0 <= beside["counted"]["negative"] < 0.05
    assert beside["fit_error"] == pytest.approx(answer["fit"]["error"]["held_out"]["log_mse"], rel=0.5)
    if beside["matching"] is not None:
        assert beside["matching"]["error"] <= beside["fit_error"]
    assert main(["research", "terms", MATERIAL, "--fit", "--count", "1500", "-c", str(quick)]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert "held-out samples within the limit, ε = 1e-05" in shown
    assert "fit (mccool)" in shown
    assert "terms as good as the fit" in shown


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["research", "terms"], "SOURCE: none given"),
        (["research", "terms", MATERIAL, "--share", "1"], "share: found 1.0, expected between 0 and 1"),
        (["research", "terms", MATERIAL, "--share", "nan"], "share: found nan, expected between 0 and 1"),
        (["research", "terms", MATERIAL, "--limit", "91"], "limit: found 91 degrees, expected above 0 and at most 90"),
        (["research", "terms", "material:none"], "material: found 'none'"),
        (["research", "terms", "nowhere.brdf"], "nowhere.brdf: no such file"),
    ],
)
def test_one_line_names_what_is_wrong(arguments: list[str], expected: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert expected in err
    assert err.count("\n") == 1
