"""The interpolated measurement: it goes through its samples, follows a model between, invents nothing, is quick."""

import time
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from refusals import refused
from torch import Tensor

from homofact.brdf.analytic import Lambert
from homofact.brdf.analytic.ggx import GgxBrdf, GgxLobe
from homofact.brdf.analytic.ggx_fit import fit_ggx
from homofact.brdf.formats import read_samples
from homofact.brdf.materials import material
from homofact.brdf.reflectance import Reflectance
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


@pytest.mark.parametrize(("count", "limit"), [(600, 0.0045), (GLOBAL_LIMIT + 1000, 0.0025)])
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
    found = Scattered(samples, lobes=0).evaluate(wi, wo)
    low, high = samples.values.min(0).values, samples.values.max(0).values
    assert bool(((found >= low * (1 - 1e-9)) & (found <= high * (1 + 1e-9))).all())


def test_zeros_and_a_black_channel_stay_zero() -> None:
    samples = sample_model(Lambert((0.5, 0.0, 0.2)), 100)
    found = Scattered(samples).evaluate(samples.wi, samples.wo)
    assert float(found[:, 1].abs().max()) < 1e-7
    assert found[:, 0].tolist() == pytest.approx(samples.values[:, 0].tolist(), rel=1e-5)


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
        ({"lobes": -1}, "lobes: found -1, expected 0 or more"),
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


LACQUER = GgxBrdf((0.02, 0.08, 0.29), (GgxLobe((1.0, 1.0, 1.0), 0.06, 0.045),))
# Neither GGX nor a sum of its lobes: cosines of the half angle to a power.
BLINN = material("blinn-phong-50").model


def rings(model: Reflectance, lights: tuple[float, ...], steps: tuple[int, int] = (5, 15)) -> Samples:
    """Samples of a goniometer with coarse rings, the light at φ = 0."""
    angles = [(x, y, z) for x in lights for y in range(0, 81, steps[0]) for z in range(0, 181, steps[1])]
    theta_i, theta_o, turn = torch.deg2rad(torch.tensor(angles, dtype=torch.float64)).T
    wi, wo = from_spherical(theta_i, 0 * theta_i), from_spherical(theta_o, turn)
    return Samples(wi, wo, model.evaluate(wi, wo), channels=model.channels, isotropic=True)


def misplaced(found: Tensor, tests: Samples) -> float:
    """Σ|found − true| cosθo over Σ true cosθo."""
    cosine = tests.wo[:, 2:]
    return float((cosine * (found - tests.values).abs()).sum() / (cosine * tests.values).sum())


def test_a_highlight_between_two_rings_is_that_of_the_model() -> None:
    train, tests = rings(LACQUER, (0, 20, 40, 60)), rings(LACQUER, (10, 30, 50), (2, 7))
    # A surface through the samples alone misplaces 17%.
    assert misplaced(Scattered(train).evaluate(tests.wi, tests.wo), tests) < 0.02


def test_where_the_model_is_wrong_its_difference_from_the_samples_corrects_it() -> None:
    train, tests = rings(BLINN, (0, 15, 30, 45, 60)), rings(BLINN, (7, 22, 37, 52), (3, 10))
    alone = fit_ggx(train, 2, 0)[0].evaluate(tests.wi, tests.wo)
    found = Scattered(train).evaluate(tests.wi, tests.wo)
    assert misplaced(found, tests) < 0.6 * misplaced(alone, tests)


def test_many_channels_share_one_model() -> None:
    names = tuple(f"{wavelength}nm" for wavelength in range(400, 700, 25))
    factors = torch.linspace(0.5, 2.0, len(names), dtype=torch.float64)

    def tinted(lights: tuple[float, ...], steps: tuple[int, int] = (5, 15)) -> Samples:
        own = rings(LACQUER, lights, steps)
        return replace(own, values=own.values[:, :1] * factors, channels=names)

    train, tests = tinted((0, 20, 40, 60)), tinted((10, 30, 50), (2, 7))
    model = Scattered(train)._model
    assert model is not None
    assert len(model.channels) == 1
    assert misplaced(Scattered(train).evaluate(tests.wi, tests.wo), tests) < 0.02


@pytest.mark.parametrize(("count", "isotropic"), [(60, True), (600, False)])
def test_few_or_anisotropic_samples_have_no_model(count: int, isotropic: bool) -> None:
    samples = replace(sample_model(PAINT, count, seed=3), isotropic=isotropic)
    scattered = Scattered(samples)
    assert scattered._model is None
    found = scattered.evaluate(samples.wi, samples.wo)
    assert log_error(samples, samples, found) < 1e-3
