"""`homofact compare --metrics`: what is measured, how it reads, and what it says under which conditions."""

import json
import sys
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from homofact.brdf.scattered import Scattered
from homofact.brdf.source import Source, open_source
from homofact.cli.main import main
from homofact.errors import BadInput
from homofact.evaluation.compare import fit_and_measure, held_out_samples
from homofact.evaluation.judging import FitEvaluator, chosen_metrics
from homofact.evaluation.metric_table import LIGHT, METRICS, SIX
from homofact.evaluation.wording import brief_figure
from homofact.methods.mccool import McCool

SIZE = ["material:blinn-phong-50", "--count", "600", "--size", "6"]
FAST = [
    "material:blinn-phong-50", "--count", "600", "--size", "6", "--textures", "1", "--restarts", "1",
    "--search-size", "4", "--search-samples", "200",
]  # fmt: skip


@pytest.fixture(scope="module")
def source() -> Source:
    return open_source("material:blinn-phong-50", count=600)


@pytest.mark.slow
def test_all_metrics_read_in_80_columns(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    methods = "mccool,mccool:theta_h-theta_d,mccool:h,mccool:wi+h,mccool:d,mccool:wi"
    assert main(["compare", *SIZE, "--methods", methods, "--metrics", "all", "-q"]) == 0
    out = capsys.readouterr().out
    assert all(len(line) <= 80 for line in out.splitlines())
    assert "…" not in out
    assert out.count("ciede2000") == 2  # six methods in two tables
    assert "white point D65" in out
    assert "each sample over the density of its drawing (lobe)" in " ".join(out.split())


@pytest.mark.slow
def test_json_has_a_metrics_object_a_row(capsys: pytest.CaptureFixture[str]) -> None:
    def rows(*metrics: str) -> list[dict[str, dict[str, float]]]:
        assert main(["compare", *SIZE, "--methods", "mccool:theta_h-theta_d,mccool:wi", "--json", *metrics]) == 0
        return json.loads(capsys.readouterr().out)["rows"]

    every = rows("--metrics", "all")
    for row in every:
        assert list(row["metrics"]) == list(METRICS)
        assert {name: row["metrics"][name] for name in SIX} == row["error"]["held_out"]
        assert {name: row["metrics"][name] for name in LIGHT} == {name: row["appearance"][name] for name in LIGHT}
    good, bad = (row["metrics"] for row in every)
    for name in ("male", "cosine_rms", "cube_root_rms", "low_rms", "log_rms_80", "albedo_error", "ciede2000", "flip"):
        assert good[name] < bad[name], name
    assert good["psnr"] > bad["psnr"]
    assert good["ssim"] > bad["ssim"]
    few = rows("--metrics", "flip, male")
    assert [row["metrics"] for row in few] == [
        {name: row["metrics"][name] for name in ("male", "flip")} for row in every
    ]
    assert list(rows()[0]["metrics"]) == list(SIX)


def test_an_unknown_metric_is_refused_with_all_names(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("homofact.brdf.source.Opening.open", lambda *_, **__: pytest.fail("opened"))
    assert main(["compare", *FAST, "--metrics", "male,psrn"]) == 2
    err = capsys.readouterr().err
    assert len(err.splitlines()) == 1
    assert "'psrn'" in err
    assert all(name in err for name in METRICS)
    with pytest.raises(BadInput, match="found none"):
        chosen_metrics(())


def test_the_cole_error_is_a_metric_by_its_name() -> None:
    assert chosen_metrics(("cole", "log_mse", "mae")) == ("log_mse", "mae")


def test_a_missing_library_is_said_before_the_fit(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "flip_evaluator", None)
    assert main(["compare", *FAST, "--metrics", "flip"]) == 2
    assert "homofact[metrics]" in capsys.readouterr().err


def test_a_configuration_names_metrics(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "c.toml"
    file.write_text('[compare]\nmethods = ["mccool:h"]\nmetrics = ["male"]\n', encoding="utf-8")
    assert main(["compare", *SIZE, "--config", str(file), "--json"]) == 0
    assert list(json.loads(capsys.readouterr().out)["rows"][0]["metrics"]) == ["male"]


def test_metrics_are_of_the_held_out_samples(source: Source) -> None:
    settings = McCool(size=6, seed=3)
    row = fit_and_measure(source, settings)
    found = FitEvaluator(source, chosen_metrics(("six",))).measure(row.factorization, row.split)
    assert found == pytest.approx(row.held_out.record(), rel=1e-12)
    assert found != pytest.approx(row.train.record(), rel=1e-3)
    train, test = source.samples.split(0.2, 3)
    assert len(held_out_samples(source, 0.2, 3)) == len(test) < len(train)
    assert torch.equal(held_out_samples(source, 0.2, 3).values, test.values)


def test_what_is_not_defined_is_none(source: Source) -> None:
    row = fit_and_measure(source, McCool(size=6))
    upright = source.samples.select(source.samples.wi[:, 2] > 0.8)
    only = Source(source.name, source.kind, upright, source.reflectance, 1e-5, 0.0)
    found = FitEvaluator(only, ("male_theta_i_75_90", "male")).measure(row.factorization, row.split)
    assert found["male_theta_i_75_90"] is None
    alone = replace(source, reflectance=Scattered(source.samples))
    assert FitEvaluator(alone, ("highlight",)).measure(row.factorization, row.split) == {"highlight": None}
    assert found["male"] is not None


@pytest.mark.slow
def test_a_subset_is_said_and_recorded(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    for command in (["compare", "--methods", "mccool:theta_h-theta_d"], ["factorize", "--out", str(tmp_path / "o")]):
        fast = SIZE if command[0] == "compare" else FAST
        arguments = [command[0], *fast, *command[1:], "--subset", "300", "--json"]
        assert main(arguments) == 0
        out, err = capsys.readouterr()
        answer = json.loads(out)
        row = answer["rows"][0] if "rows" in answer else answer
        assert (row["subset"]["samples"], row["subset"]["of"], row["samples"]) == (300, 480, 600)
        assert "fitted to 300 of 480 samples" in err


@pytest.mark.slow
def test_several_seeds_are_means_with_their_spread(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    command = ["compare", *FAST, "--methods", "mccool,cole", "--seeds", "3", "--metrics", "six,male"]
    assert main([*command, "--json", "--plot", str(tmp_path / "a.png")]) == 0
    mccool, cole = json.loads(capsys.readouterr().out)["rows"]
    assert cole["seeds"] == [0, 1, 2]
    errors = [row["error"]["held_out"]["log_mse"] for row in cole["rows"]]
    assert cole["error"]["held_out"]["log_mse"] == pytest.approx(sum(errors) / 3)
    assert cole["metrics"]["log_mse"] == pytest.approx(sum(errors) / 3)
    spread = cole["spread"]["error"]["held_out"]["log_mse"]
    assert (spread["min"], spread["max"]) == (min(errors), max(errors))
    # A model has no azimuth copies: McCool's fit has no luck in it.
    assert mccool["spread"]["error"]["held_out"]["log_mse"]["standard_deviation"] == 0
    light = cole["spread"]["appearance"]["rms_cosine"]
    assert light["mean"] == pytest.approx(sum(row["appearance"]["rms_cosine"] for row in cole["rows"]) / 3)
    assert main(command) == 0
    ran = capsys.readouterr()
    out = ran.out
    assert "mean ± standard deviation of 3 fits by different seeds" in " ".join(out.split())
    assert f"±{brief_figure(light['standard_deviation'])}" in out.partition("Light, fit over source")[2]
    assert f"±{brief_figure(cole['spread']['seconds']['fit']['standard_deviation'])[:1]}" in out.partition("Cost")[2]
    trusted = [row["verdict"]["trusted"] for row in cole["rows"]]
    assert f"Verdict on cole, seed 0 (trusted: {sum(trusted)} of 3 fits)" in " ".join(out.split())
    assert "homofact: mccool: all seeds gave the same fit" in ran.err
    assert f"±{brief_figure(spread['standard_deviation'])}" in out
