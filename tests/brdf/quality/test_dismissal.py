"""Suspicions that somebody has checked: they are not raised again, others are, and fits remember them."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from refusals import refused

import homofact
from homofact.brdf.formats import csv
from homofact.brdf.materials import material
from homofact.brdf.quality.mending import mending_lines
from homofact.brdf.quality.suspicion.dismissal import dismissed
from homofact.brdf.quality.suspicion.suspects import NAMES, suspicions
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model
from homofact.cli.main import main
from homofact.evaluation.reopening import reopen
from homofact.exporting.result import open_result


@pytest.fixture(scope="module")
def struck() -> Samples:
    """A paint whose values hold cosθo, some of them cut at zero: two suspicions."""
    samples = replace(sample_model(material("lafortune-clay").model, 1000, "discs", 3), provenance={})
    return replace(samples, values=samples.values * samples.wo[:, 2:] * (torch.arange(1000) % 12 > 0)[:, None])


@pytest.fixture
def file(struck: Samples, tmp_path: Path) -> Path:
    path = tmp_path / "struck.csv"
    csv.write(path, struck)
    return path


def names(samples: Samples) -> set[str]:
    return {each.name for each in suspicions(samples)}


def test_what_is_dismissed_is_not_raised_and_the_rest_is(struck: Samples) -> None:
    found = names(struck)
    assert found == {"zeros", "cosine-o"}
    assert "zeros" not in names(dismissed(struck, ["zeros"]))
    assert names(dismissed(struck, ["zeros"])) == {"cosine-o"}
    without = names(dismissed(struck, ["cosine-o"]))
    assert "cosine-o" not in without
    assert "zeros" in without
    assert names(dismissed(struck, ["all"])) == set()


@pytest.mark.parametrize("name", NAMES)
def test_every_suspicion_can_be_dismissed(struck: Samples, name: str) -> None:
    assert dismissed(struck, [name]).provenance["dismissed"] == [name]
    assert name not in names(dismissed(struck, [name]))


def test_samples_read_in_python_are_dismissed_too(struck: Samples) -> None:
    assert names(homofact.read(struck, dismiss=["zeros"]).samples) == {"cosine-o"}
    again = homofact.read(homofact.read(struck), dismiss=["zeros"])
    assert names(again.samples) == {"cosine-o"}
    assert any("zeros" in line for line in mending_lines(again.samples.provenance))


@pytest.mark.parametrize("given", [["cosine"], ["zeros", "all"], [""]])
def test_a_name_that_is_none_is_refused(struck: Samples, given: list[str]) -> None:
    with refused("dismiss: found '.*', expected some of radians, "):
        dismissed(struck, given)


@pytest.mark.parametrize("source", ["material:phong-30", lambda wi, wo: 0 * wi[:, 2] + 0.1])
def test_what_no_instrument_measured_has_none(source: object) -> None:
    with refused("dismiss: found .*, expected a measurement"):
        homofact.read(source, count=100, dismiss=["zeros"])


def test_info_offers_it_and_then_says_that_it_was_done(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", str(file)]) == 0
    assert "--dismiss zeros+cosine-o" in capsys.readouterr().out.replace("\n", " ")
    assert main(["info", str(file), "--dismiss", "zeros", "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert [each["name"] for each in facts["suspected"]] == ["cosine-o"]
    assert facts["dismissed"] == ["zeros"]


def test_a_fit_is_judged_without_it_and_remembers(file: Path, tmp_path: Path) -> None:
    fitted = ["factorize", str(file), "--method", "mccool", "--size", "6"]
    assert main([*fitted, "--out", str(tmp_path / "plain")]) == 0
    assert main([*fitted, "--dismiss", "all", "--out", str(tmp_path / "checked")]) == 0
    plain, checked = (json.loads((tmp_path / each / "report.json").read_text()) for each in ("plain", "checked"))
    assert plain["dismissed"] is None
    assert set(checked["dismissed"]) == set(NAMES)
    found = [{each["name"] for each in report["verdict"]["findings"]} for report in (plain, checked)]
    assert found[0] - found[1] == {"cosine-o"}
    advice = next(each for each in plain["verdict"]["findings"] if each["name"] == "cosine-o")
    assert "dismiss='cosine-o'" in advice["remedy"]
    widths = [
        next(each["error"] for each in report["verdict"]["bars"]["all"] if each["quantity"] == "sky")
        for report in (plain, checked)
    ]
    assert widths[1] < widths[0]
    source = reopen(open_result(str(tmp_path / "checked"))).source
    assert source.opening is not None
    assert source.opening.dismiss == ("all",)
    assert names(source.samples) == set()
