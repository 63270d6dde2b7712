"""Sampling a model: the three schemes and their refusals."""

import pytest
import torch
from refusals import refused

from homofact.brdf.materials import material
from homofact.brdf.sampling import grid_side, sample_model
from homofact.geometry.parabolic import to_disc

PAINT = material("lafortune-blue-paint").model


def test_default_is_45000_pairs_in_the_discs() -> None:
    samples = sample_model(PAINT)
    assert len(samples) == 45_000
    squared = (to_disc(samples.wi) ** 2).sum(1)
    assert float(squared.max()) < 0.98
    assert float(squared.mean()) == pytest.approx(0.49, abs=0.01)
    assert samples.isotropic
    assert samples.channels == ("R", "G", "B")
    assert samples.provenance["sampling"]["noise_free"] is True
    assert torch.equal(samples.values, PAINT.evaluate(samples.wi, samples.wo))


def test_cosine_weighs_the_normal() -> None:
    samples = sample_model(PAINT, 20_000, "cosine", seed=1)
    assert float(samples.wi[:, 2].mean()) == pytest.approx(2 / 3, abs=0.01)


def test_grid_needs_no_seed_and_comes_near_the_count() -> None:
    samples = sample_model(PAINT, 45_000, "grid", seed=1)
    assert abs(len(samples) - 45_000) < 4500
    assert torch.equal(sample_model(PAINT, 45_000, "grid", seed=2).wi, samples.wi)


@pytest.mark.parametrize(("count", "side"), [(1, 2), (16, 2), (150, 4), (10**4, 11)])
def test_grid_side_is_the_nearest(count: int, side: int) -> None:
    # Cells inside the disc, squared: side 2: 16, 3: 81, 4: 144, 11: 97² = 9409.
    assert grid_side(count) == side


@pytest.mark.parametrize("scheme", ["discs", "cosine"])
def test_seeds_repeat_and_differ(scheme: str) -> None:
    first = sample_model(PAINT, 100, scheme, seed=1)
    assert torch.equal(sample_model(PAINT, 100, scheme, seed=1).wi, first.wi)
    assert not torch.equal(sample_model(PAINT, 100, scheme, seed=2).wi, first.wi)


def test_anisotropy_is_carried_over() -> None:
    assert not sample_model(material("ward-brushed").model, 10).isotropic


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"scheme": "disc"}, "sampling scheme: found 'disc', expected one of lobe, discs, cosine, grid"),
        ({"count": 0}, "sample count: found 0, expected at least 1"),
        ({"radius_squared": 0.0}, "radius squared: found 0.0"),
        ({"radius_squared": 1.1}, "radius squared: found 1.1"),
    ],
)
def test_impossible_arguments_are_refused(arguments: dict, message: str) -> None:
    with refused(message):
        sample_model(PAINT, **arguments)
