"""What an export warns of: a verdict that does not trust the fit, storage that moves it; and edited fits of 8 bits."""

import json
import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

import homofact
from homofact.cli import export
from homofact.cli.main import main
from homofact.factor.factorization import Factorization


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("results") / "paint"
    line = ["factorize", "material:lafortune-blue-paint", "--count", "1000", "--method", "mccool", "--size", "6"]
    assert main([*line, "--out", str(out), "-q"]) == 0
    return out


@pytest.mark.parametrize("trusted", [True, False])
def test_a_fit_that_its_verdict_does_not_trust_is_exported_with_the_verdict(
    trusted: bool, result: Path, tmp_path: Path, capsys
) -> None:
    copy = tmp_path / "paint"
    shutil.copytree(result, copy)
    report = json.loads((copy / "report.json").read_text())
    report["verdict"] |= {"trusted": trusted, "summary": "a word on it"}
    (copy / "report.json").write_text(json.dumps(report))
    assert main(["export", str(copy), "--out", str(tmp_path / "engine")]) == 0
    streams = capsys.readouterr()
    assert ("read the verdict before you ship: a word on it" in streams.err) is not trusted
    assert ("Verdict on the fit: a word on it" in streams.out) is trusted
    # A fit in memory has its own.
    found = homofact.export(homofact.load(copy), tmp_path / "other")
    assert found.verdict is not None
    assert (found.verdict["trusted"], found.verdict["summary"].endswith("a word on it")) == (trusted, True)
    assert found.record()["verdict"] == found.verdict


@pytest.mark.parametrize(
    ("label", "form", "moved", "words"),
    [
        ("stored as png8", "png8", 0.04, ()),
        ("stored as png8", "png8", 0.06, ("stored as png8", "0.06", "--quantize png8", "png16")),
        ("solved for png8", "png8", 0.2, ("solved for png8", "0.2", "png16")),
        ("stored as dds", "dds", 0.2, ("stored as dds", "0.2")),
    ],
)
def test_storage_that_moves_a_fit_by_much_is_told(label: str, form: str, moved: float, words: tuple[str, ...]) -> None:
    errors = {"as fitted": {"log_difference": 0.0}, label: {"log_difference": moved}}
    said = export._storage_warning(cast(Any, SimpleNamespace(errors=errors, format=form)))
    assert bool(said) is bool(words)
    for each in words:
        assert each in said
    assert ("--quantize" in said) is ("--quantize png8" in words)


def test_an_edited_fit_is_solved_on_its_own_values(result: Path, tmp_path: Path) -> None:
    fit = homofact.load(result).factorization
    assert isinstance(fit, Factorization)
    edits = [{"angle": "theta_h", "way": "texels", "rms": 0.01}]
    edited = homofact.Fit(replace(fit, provenance=fit.provenance | {"edits": edits}))
    found = homofact.export(edited, tmp_path / "engine", quantize="png8")
    moved = {label: errors["log_difference"] for label, errors in found.errors.items()}
    assert 0 < moved["solved for png8"] < moved["each texel rounded"]
