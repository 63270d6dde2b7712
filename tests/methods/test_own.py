"""A method of a user beside the others: what its function returns is measured as any fit."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from refusals import refused

import homofact
from homofact.brdf.materials import material
from homofact.evaluation.compare import fit_and_measure

PAINT = homofact.read("material:phong-10", count=600)
MODEL = material("phong-10").model


class Everywhere:
    """A reflectance that does not end at the horizon."""

    channels = ("R", "G", "B")

    def evaluate(self, wi: torch.Tensor, wo: torch.Tensor) -> torch.Tensor:
        return torch.full_like(wi, 0.1)


def mean(samples: homofact.Samples, seed: int) -> Any:
    """Everywhere the mean of the samples, with the seed in its last digits."""
    value = samples.values.mean(0).numpy() + 1e-6 * seed
    return lambda wi, wo: 0 * wi[:, :1] + value


def test_what_the_function_returns_is_measured() -> None:
    exact = fit_and_measure(PAINT, homofact.OwnMethod(function=lambda samples, seed: MODEL, nbytes=28, fetches=2))
    assert exact.held_out.log_mse == pytest.approx(0, abs=1e-12)
    assert (exact.factorization.nbytes, exact.factorization.fetches) == (28, 2)
    assert exact.verdict.trusted
    row = fit_and_measure(PAINT, homofact.OwnMethod(function=mean))
    train, test = row.split.parts(PAINT)[0], row.split.test_samples(PAINT)
    assert row.held_out.max == pytest.approx(float((train.values.mean(0) - test.values).abs().max()), rel=1e-5)
    below = fit_and_measure(PAINT, homofact.OwnMethod(function=lambda samples, seed: Everywhere())).factorization
    assert below.evaluate(test.wi[:1], test.wo[:1]).tolist() == [[0.1, 0.1, 0.1]]
    assert below.evaluate(test.wi[:1], -test.wo[:1]).tolist() == [[0, 0, 0]]


def test_it_stands_beside_the_others_with_its_seeds(tmp_path: Path) -> None:
    methods = {"ours": homofact.OwnMethod(function=mean, nbytes=12), "mccool": homofact.McCool(size=4)}
    found = homofact.compare(PAINT, methods, seeds=[3, 4], latex=tmp_path / "a.tex")
    assert list(found.rows) == ["ours", "mccool"]
    ours = found.rows["ours"]
    assert ours.seeds == (3, 4)
    assert (ours.held_out["mae"].deviation or 0) > 0
    assert ours.record()["bytes"] == 12
    written = (tmp_path / "a.tex").read_text()
    assert (
        "% phong-10: epsilon 1e-05; 120 of 600 samples held out; drawn by the scheme lobe, split by seed 0" in written
    )
    assert "ours & 12 & 0 & 2 &" in written


@pytest.mark.parametrize(
    ("function", "words"),
    [
        (3, "function: found 3, expected a function of samples and a seed"),
        (
            lambda samples, seed: lambda wi, wo: np.ones((len(wi), 2)),
            "function: found 2 channels, expected those",
        ),
        (lambda samples, seed: lambda wi, wo: "light", "source"),
    ],
)
def test_what_is_no_such_function_is_refused_in_a_line(function: Any, words: str) -> None:
    with refused(words):
        homofact.OwnMethod(function=function).fit(PAINT.samples)


def test_a_fit_of_it_cannot_be_stored(tmp_path: Path) -> None:
    fit = homofact.OwnMethod(function=mean).fit(PAINT.samples)
    with refused("a fit of your own method: found a function of yours"):
        fit.save(tmp_path / "a.npz")
    with refused("a fit of your own method: found no textures"):
        fit.factorization.with_textures([])
    assert not list(tmp_path.iterdir())
