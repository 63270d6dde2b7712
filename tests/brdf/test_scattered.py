"""The interpolated measurement: it goes through its samples, ignores azimuth, invents nothing, is quick."""

import time
from pathlib import Path

import pytest
import torch
from refusals import refused
from torch import Tensor

from homofact.brdf.analytic import Lambert
from homofact.brdf.formats import read_samples
from homofact.brdf.materials import material
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model
from homofact.brdf.scattered import GLOBAL_LIMIT, Scattered
from homofact.geometry.directions import draw_uniform, from_spherical

PAINT = material("lafortune-blue-paint").model
BRUSHED = material("ward-brushed").model


def log_error(train: Samples, samples: Samples, found: Tensor, epsilon: float = 1e-2) -> float:
    """Cole's error, A the mean of the training samples."""
    mean = train.values.mean(0)
    return float(((torch.log(found / mean + epsilon) - torch.log(samples.values / mean + epsilon)) ** 2).mean())


@pytest.mark.parametrize(("count", "limit"), [(600, 0.004), (GLOBAL_LIMIT + 1000, 0.001)])
def test_predicts_an_isotropic_paint(count: int, limit: float) -> None:
    train, test = sample_model(PAINT, count, seed=1), sample_model(PAINT, 1500, seed=2)
    assert log_error(train, test, Scattered(train).evaluate(test.wi, test.wo)) < limit


def test_the_root_of_the_half_angle_gives_the_peak_room() -> None:
    plastic = material("cook-torrance-plastic").model
    train, test = sample_model(plastic, 1900, seed=1), sample_model(plastic, 1500, seed=2)
    # Measured .0033, and .0041 over θh itself.
    assert log_error(train, test, Scattered(train).evaluate(test.wi, test.wo)) < 0.0037


def test_predicts_a_brushed_metal_with_its_direction() -> None:
    train, test = sample_model(BRUSHED, 1500, seed=1), sample_model(BRUSHED, 1000, seed=2)
    scattered = Scattered(train)
    assert not scattered.isotropic
    error = log_error(train, test, scattered.evaluate(test.wi, test.wo))
    # Half of what saying the mean everywhere would cost, at the very least.
    assert error < 0.5 * log_error(train, test, test.values.mean(0).expand_as(test.values))


@pytest.mark.parametrize("model", [PAINT, BRUSHED], ids=["isotropic", "anisotropic"])
def test_goes_through_its_samples(model) -> None:
    samples = sample_model(model, 400, seed=3)
    found = Scattered(samples, smoothing=0).evaluate(samples.wi, samples.wo)
    assert torch.allclose(found, samples.values, rtol=1e-3, atol=1e-6)


def test_smoothing_moves_away_from_the_samples() -> None:
    samples = sample_model(PAINT, 400, seed=3)
    errors = [
        log_error(samples, samples, Scattered(samples, smoothing=s).evaluate(samples.wi, samples.wo))
        for s in (0, 0.01, 1)
    ]
    assert errors[0] < errors[1] < errors[2]


@pytest.mark.parametrize("model", [PAINT, BRUSHED], ids=["isotropic", "anisotropic"])
def test_stays_in_the_measured_range(model) -> None:
    samples = sample_model(model, 300, seed=1, radius_squared=0.3)
    wi, wo = draw_uniform(1000, torch.Generator().manual_seed(1))
    found = Scattered(samples).evaluate(wi, wo)
    low, high = samples.values.min(0).values, samples.values.max(0).values
    assert bool(((found >= low * (1 - 1e-9)) & (found <= high * (1 + 1e-9))).all())


def test_zeros_and_a_black_channel_stay_zero() -> None:
    samples = sample_model(Lambert((0.5, 0.0, 0.2)), 100)
    found = Scattered(samples).evaluate(samples.wi, samples.wo)
    assert float(found[:, 1].abs().max()) < 1e-12
    assert found[:, 0].tolist() == pytest.approx(samples.values[:, 0].tolist(), rel=1e-9)


def test_samples_in_one_plane_still_interpolate() -> None:
    # Retroreflection: θd = 0 and φd = 0 for all, which leaves a thin plate without its linear part.
    theta = torch.linspace(0, 1.4, 40, dtype=torch.float64)
    w = from_spherical(theta, torch.zeros_like(theta))
    samples = Samples(w, w, PAINT.evaluate(w, w), channels=PAINT.channels, isotropic=True)
    found = Scattered(samples, smoothing=1e-6).evaluate(w, w)
    assert torch.allclose(found, samples.values, rtol=1e-2)


def test_states_its_cost() -> None:
    few, many = sample_model(PAINT, 300), sample_model(PAINT, GLOBAL_LIMIT + 1)
    assert Scattered(few).channels == ("R", "G", "B")
    assert Scattered(few).fetches == 300
    assert Scattered(many, neighbours=20).fetches == 20
    assert Scattered(few).nbytes == 300 * (3 + 3) * 8
    assert Scattered(sample_model(BRUSHED, 300)).nbytes == 300 * (5 + 3) * 8


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"smoothing": -1.0}, "smoothing: found -1.0, expected 0 or more"),
        ({"epsilon": 0.0}, "epsilon: found 0.0, expected above 0"),
        ({"neighbours": 2}, "2 neighbours, expected at least 5"),
    ],
)
def test_impossible_arguments_are_refused(arguments: dict, message: str) -> None:
    with refused(message):
        Scattered(sample_model(PAINT, 100), **arguments)


def test_too_few_samples_are_refused() -> None:
    with refused(where="interpolation"):
        Scattered(sample_model(PAINT, 4))


def test_a_real_paint_is_predicted_and_drawn_in_seconds(real_data: Path) -> None:
    samples = read_samples(real_data / "cornell" / "garnet_red.brdf")
    train, held = samples.split(0.2, seed=0)
    turned = held.rotated_at_random(0)
    # Measured .1145 here; a tuned thin plate over these samples was at .117 in a prototype.
    assert log_error(train, turned, Scattered(train).evaluate(turned.wi, turned.wo)) < 0.125
    wi, wo = draw_uniform(31_400, torch.Generator().manual_seed(0))
    begun = time.perf_counter()
    values = Scattered(samples).evaluate(wi, wo)
    assert time.perf_counter() - begun < 10
    assert bool(torch.isfinite(values).all())
