"""Scatter: the noise put in comes out, and a smooth BRDF has next to none."""

import math
from dataclasses import replace

import pytest
import torch

from homofact.brdf.materials import material
from homofact.brdf.quality.scatter import local_scatter, places_of
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model
from homofact.brdf.source import MEASURED_EPSILON, measured_epsilon


def clean(count: int = 20_000, isotropic: bool = True) -> Samples:
    samples = sample_model(material("lafortune-blue-paint").model, count, "discs", 0)
    return replace(samples, isotropic=isotropic)


def noisy(samples: Samples, multiplicative: float = 0.0, additive: float = 0.0) -> Samples:
    generator = torch.Generator().manual_seed(7)
    draw = torch.randn(2, *samples.values.shape, dtype=torch.float64, generator=generator)
    values = samples.values * torch.exp(multiplicative * draw[0]) + additive * samples.values.mean(0) * draw[1]
    return replace(samples, values=values.clamp_min(0))


@pytest.mark.parametrize("level", [0.02, 0.05, 0.2])
def test_multiplicative_noise_comes_out(level: float) -> None:
    scatter = local_scatter(noisy(clean(), multiplicative=level))
    assert scatter is not None
    assert scatter.relative == pytest.approx(level, rel=0.15)


def test_a_smooth_brdf_has_next_to_none_and_keeps_the_usual_epsilon() -> None:
    scatter = local_scatter(clean())
    assert scatter is not None
    assert scatter.relative < 2e-3
    assert scatter.floor < 1e-3
    assert measured_epsilon(clean()) == MEASURED_EPSILON


def test_the_floor_of_additive_noise_becomes_epsilon() -> None:
    samples = noisy(clean(), additive=0.06)
    scatter = local_scatter(samples)
    assert scatter is not None
    assert scatter.floor == pytest.approx(0.06, rel=0.25)
    assert measured_epsilon(samples) == pytest.approx(0.06, abs=0.011)
    assert measured_epsilon(noisy(clean(), additive=3.0)) == 0.2


def test_azimuth_is_a_coordinate_of_anisotropic_samples() -> None:
    samples = clean()
    grooved = 1 + 0.8 * torch.cos(2 * torch.atan2(samples.wi[:, 1], samples.wi[:, 0]))
    samples = replace(samples, values=grooved[:, None].expand(-1, 3).contiguous())
    true, told_wrong = (local_scatter(replace(samples, isotropic=flag)) for flag in (False, True))
    assert true is not None
    assert told_wrong is not None
    assert told_wrong.relative > 3 * true.relative
    assert told_wrong.relative > 0.2


def test_too_few_samples_say_nothing() -> None:
    samples = clean()
    assert local_scatter(samples.subset(23, 0)) is None
    assert local_scatter(samples.subset(24, 0)) is not None
    assert measured_epsilon(samples.subset(10, 0)) == MEASURED_EPSILON


@pytest.mark.parametrize("isotropic", [True, False])
def test_noise_on_a_constant_comes_out_as_it_was_put_in(isotropic: bool) -> None:
    """Twelve neighbours and a plane of four or seven numbers: what is left of the noise is put in proportion."""
    flat = replace(clean(isotropic=isotropic), values=torch.full((20_000, 3), 0.3, dtype=torch.float64))
    scatter = local_scatter(noisy(flat, multiplicative=0.05))
    assert scatter is not None
    assert scatter.relative == pytest.approx(0.05, rel=0.05)
    added = local_scatter(noisy(flat, additive=0.05))
    assert added is not None
    assert added.relative == pytest.approx(0.05, rel=0.05)


def test_the_floor_is_that_of_the_darkest_quarter() -> None:
    samples = clean()
    brightness = (samples.values / samples.values.mean(0)).mean(1)
    loud = brightness > brightness.quantile(0.35)
    noise = noisy(samples, additive=0.1).values
    some = replace(samples, values=torch.where(loud[:, None], noise, samples.values))
    scatter = local_scatter(some)
    assert scatter is not None
    assert scatter.floor < 0.02


@pytest.mark.parametrize("theta", [0.01, 0.3, 1.2])
def test_an_azimuth_counts_as_the_arc_it_moves_a_direction_by(theta: float) -> None:
    phi = torch.tensor([1.0, 1.02]).double()
    wi = torch.tensor([[math.sin(theta), 0.0, math.cos(theta)]]).double().expand(2, 3)
    wo = torch.stack((phi.cos() * math.sin(theta), phi.sin() * math.sin(theta), wi[:, 2]), 1)
    places = places_of(Samples(wi, wo, torch.ones(2, 1), channels=("Y",), isotropic=True))
    assert float((places[1] - places[0]).norm()) == pytest.approx(float((wo[1] - wo[0]).norm()), rel=1e-3)
