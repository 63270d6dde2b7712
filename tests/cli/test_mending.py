"""--calibrate and --clipped from the command line to the report; a fit is reopened with the samples it was made of."""

import json
from pathlib import Path

import pytest
import torch

from homofact.brdf.formats import csv, read_samples
from homofact.brdf.materials import material
from homofact.brdf.samples import Samples
from homofact.brdf.source import open_source
from homofact.cli.main import main
from homofact.evaluation.reopening import reopen
from homofact.exporting.result import open_result
from homofact.geometry.directions import from_spherical

METHOD = ["--method", "mccool", "--size", "6", "--projections", "theta_h-theta_d"]


@pytest.fixture
def paint(tmp_path: Path) -> Path:
    """A paint on rings of θi, each with a gain of its own, its highlight clipped."""
    angles = (torch.linspace(low, high, steps, dtype=torch.float64).deg2rad()
              for low, high, steps in ((5, 80, 8), (0, 83, 10), (0, 180, 9)))  # fmt: skip
    one, two, turn = (each.reshape(-1) for each in torch.meshgrid(*angles, indexing="ij"))
    wi, wo = from_spherical(one, torch.zeros_like(one)), from_spherical(two, turn)
    ring = (torch.arange(len(one)) // 90).double()
    values = material("lafortune-clay").model.evaluate(wi, wo) * torch.exp(0.3 * torch.sin(3 * ring))[:, None]
    values = torch.minimum(values, values.quantile(0.97, dim=0))
    path = tmp_path / "paint.csv"
    csv.write(path, Samples(wi, wo, values, channels=("R", "G", "B"), isotropic=True))
    return path


@pytest.mark.slow
def test_a_fit_says_what_was_mended_and_is_reopened_so(
    paint: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    line = ["factorize", str(paint), *METHOD, "--calibrate", "rings", "--clipped", "found", "--out", str(out)]
    assert main(line) == 0
    said = capsys.readouterr().out
    assert "gains by ring of θ: " in said
    assert "divided out, their mean kept" in said
    assert "clipped: 22 values of R at " in said
    report = json.loads((out / "report.json").read_text())
    assert report["gains"]["rings"]["removed"] is True
    assert len(report["gains"]["rings"]["theta_i"]) == 8
    assert report["clipped"]["G"]["samples"] == 22
    source = reopen(open_result(str(out)), None).source
    assert source.opening is not None
    assert (source.opening.calibrate, source.opening.clipped) == (("rings",), "found")
    assert torch.equal(source.samples.values, open_source(str(paint), calibrate=("rings",)).samples.values)
    assert not torch.equal(source.samples.values, open_source(str(paint)).samples.values)


def test_convert_writes_samples_without_their_gains(
    paint: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target = tmp_path / "mended.csv"
    assert main(["convert", str(paint), str(target), "--calibrate", "rings"]) == 0
    assert "divided out" in capsys.readouterr().out
    assert torch.equal(read_samples(target).values, open_source(str(paint), calibrate=("rings",)).samples.values)


def test_info_says_the_gains_and_svd_takes_no_bounds(
    paint: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["info", str(paint), "--calibrate", "rings+rows", "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert set(facts["gains"]) == {"rings", "rows"}
    assert facts["clipped"] is None
    line = ["factorize", str(paint), "--method", "svd", "--clipped", "found", "--out", str(tmp_path / "o")]
    assert main(line) == 2
    assert "clipped: svd takes no values as bounds, expected search, cole or mccool" in capsys.readouterr().err
    assert not (tmp_path / "o").exists()


def test_convert_and_factorize_say_what_they_found_of_a_tilt(
    paint: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["convert", str(paint), str(tmp_path / "straight.csv"), "--calibrate", "tilt"]) == 0
    assert "tilt" in capsys.readouterr().out
