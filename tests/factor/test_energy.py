"""The objective that keeps the light: its slope, its minimum, and what it does to a highlight narrower than a texel."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.optimize import check_grad

from homofact.brdf.analytic import Ward
from homofact.brdf.log_transform import LogTransform
from homofact.brdf.pair_density import solid_angles
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model
from homofact.factor.energy import SQUARES_SHARE, Flux, _Light, keep_light
from homofact.factor.factorization import Term, sum_of_terms
from homofact.factor.projection import Warp, fixed_projection
from homofact.factor.textures import LogSamples, solve_terms
from homofact.geometry.directions import from_spherical
from homofact.linear import size

GLOSS = Ward((0.05, 0.1), (0.3, 0.1), alpha_x=0.03, alpha_y=0.03, channels=("R", "G"))
PROJECTIONS = (fixed_projection("theta_h-theta_d", True, Warp(0.3)), fixed_projection("theta_i", True))
SHAPES = ((6, 6), (1, 6))


@pytest.fixture(scope="module")
def solved() -> tuple[Samples, LogSamples, Flux, tuple[Term, ...]]:
    samples = sample_model(GLOSS, 3000, "lobe", seed=1)
    transform = LogTransform.of(samples, 1e-2)
    logs = LogSamples.of(samples, transform)
    return (
        samples,
        logs,
        Flux.of(samples, transform, "both"),
        solve_terms(logs, PROJECTIONS, SHAPES, 1e-3, "cholesky").terms,
    )


def light_of(samples: LogSamples, flux: Flux, terms: tuple[Term, ...]) -> np.ndarray:
    """Σ p (ĝ − g)/Σ p g of each channel."""
    found = torch.exp(sum_of_terms(terms, samples.wi, samples.wo))
    given = torch.exp(samples.logs)
    return ((flux.per_value * (found - given)).sum(0) / (flux.per_value * given).sum(0)).numpy()


def test_flux_is_normalised_channel_by_channel(solved) -> None:
    samples, logs, flux, _ = solved
    transform = LogTransform.of(samples, 1e-2)
    sums = (flux.per_value * samples.values / transform.mean_like(samples.values)).sum(0)
    assert torch.allclose(sums, logs.weights.new_full((2,), 3000.0))
    assert float(flux.weights_of(logs).sum()) == pytest.approx(float(logs.weights.sum()))


def test_incidence_of_a_mirror_like_lobe_counts_between_its_flux_and_its_angle() -> None:
    """Mirror pairs at one solid angle each: flux cos²θ, a like share for every angle flux/(sinθ cosθ)."""
    theta = torch.tensor([10.0, 30, 50, 70, 80], dtype=torch.float64).deg2rad().repeat(40)
    azimuth = torch.arange(200, dtype=torch.float64) * 0.1
    wi, wo = from_spherical(theta, azimuth), from_spherical(theta, azimuth + torch.pi)
    samples = Samples(wi, wo, torch.ones(200, 1), channels=("Y",), isotropic=True)
    flux = Flux.of(samples, LogTransform.of(samples, 1e-2), "both").per_value[:, 0] / solid_angles(samples)
    cos, sin = torch.cos(theta), torch.sin(theta)
    both = torch.sqrt((cos**2 / sin) * (cos**2 / (sin * cos)))  # the geometric mean of the two
    assert torch.allclose(flux / both, (flux / both)[:1].expand(200), rtol=1e-6)


def test_logs_hold_more_of_a_measurement(solved) -> None:
    """Its flux is in few bright samples, each with its noise."""
    samples, _, flux, _ = solved
    measured = replace(samples, provenance={})
    transform = LogTransform.of(samples, 1e-2)
    assert Flux.of(measured, transform, "both").log_share > flux.log_share
    assert Flux.of(measured, transform, "energy").log_share == Flux.of(samples, transform, "energy").log_share


def test_squares_are_those_of_the_rms_with_cosines_and_none_of_a_measurement(solved) -> None:
    samples, _, flux, _ = solved
    transform = LogTransform.of(samples, 1e-2)
    values = samples.values / transform.mean_like(samples.values)
    assert torch.allclose((flux.squares * values**2).sum(0), flux.squares.new_full((2,), SQUARES_SHARE * 3000.0))
    cosines = (samples.wi[:, 2] * samples.wo[:, 2]) ** 2 * solid_angles(samples)
    share = flux.squares[:, 0] / cosines
    assert torch.allclose(share, share[:1].expand(3000))
    assert not Flux.of(replace(samples, provenance={}), transform, "both").squares.any()
    assert flux.with_none(2).squares.shape == (3002, 2)


def test_squares_lower_the_rms_with_cosines(solved) -> None:
    samples, logs, flux, terms = solved
    without = replace(flux, squares=torch.zeros_like(flux.squares))

    def missed(flux_: Flux) -> float:
        found = torch.exp(sum_of_terms(keep_light(logs, terms, 1e-3, flux_)[0], samples.wi, samples.wo))
        return float((flux.squares * (found - torch.exp(logs.logs)) ** 2).sum())

    assert missed(flux) < 0.95 * missed(without)


def test_the_slope_is_that_of_the_value(solved) -> None:
    _, logs, flux, terms = solved
    light = _Light(logs, terms, 1e-3, flux)
    start = light.start() + 0.1 * np.random.default_rng(0).normal(size=len(light.start()))
    error = check_grad(lambda z: light.evaluate(z)[0], lambda z: light.evaluate(z)[1], start, epsilon=1e-6)
    assert error < 1e-4 * np.linalg.norm(light.evaluate(start)[1])


def test_the_light_that_logs_lose_comes_back(solved) -> None:
    _, logs, flux, terms = solved
    kept, account = keep_light(logs, terms, 1e-3, flux)
    assert account["after"] < 0.8 * account["before"]
    assert np.abs(light_of(logs, flux, terms)).max() > 0.05
    assert np.abs(light_of(logs, flux, kept)).max() < 0.05
    # The divergence alone keeps all of it; squares trade some of it for the shape of a highlight narrower than a texel.
    alone, _ = keep_light(logs, terms, 1e-3, replace(flux, squares=torch.zeros_like(flux.squares)))
    assert np.abs(light_of(logs, flux, alone)).max() < 0.01
    # At the minimum neither a step further nor a step back is better.
    light = _Light(logs, kept, 1e-3, flux)
    value, slope = light.evaluate(light.start())
    assert light.evaluate(light.start() - 1e-3 * slope)[0] > value - 1e-3 * account["after"]


def test_an_exact_fit_stays(solved) -> None:
    _, logs, flux, terms = solved
    exact = LogSamples(logs.wi, logs.wo, sum_of_terms(terms, logs.wi, logs.wo), logs.weights)
    again, _ = keep_light(exact, terms, 0.0, flux)
    moved = sum_of_terms(again, logs.wi, logs.wo) - exact.logs
    assert float(moved.abs().max()) < 0.02


def test_only_values_under_a_clipped_one_cost(solved) -> None:
    _, logs, flux, terms = solved
    found = sum_of_terms(terms, logs.wi, logs.wo)
    clipped = torch.ones_like(found, dtype=torch.bool)
    for offset, costs in ((-1.0, False), (1.0, True)):
        light = _Light(LogSamples(logs.wi, logs.wo, found + offset, logs.weights, clipped), terms, 0.0, flux)
        value, slope = light.evaluate(light.start())
        assert (value > 0.1) == (np.abs(slope).max() > 1e-3) == costs


def test_filler_texels_stay(solved) -> None:
    _, logs, flux, terms = solved
    half = tuple(Term(t.projection, t.texture, t.mask & (torch.arange(t.mask.shape[1]) < 4)) for t in terms)
    kept, _ = keep_light(logs, half, 1e-3, flux)
    for one, other in zip(half, kept, strict=True):
        off = (other.texture - one.texture)[~one.mask]
        # The gauge may move a whole texture by a constant.
        assert float((off - off.mean(0)).abs().max()) < 1e-9


@pytest.mark.parametrize("smoothing", [1e-3, 1e-1])
def test_the_factor_of_the_solved_system_leads_to_the_same_minimum(solved, smoothing: float) -> None:
    """From `solve_terms` with the weights near the data, and scaled as the weights of its own would be: those of J."""
    _, logs, flux, terms = solved
    flux = Flux(9 * flux.per_value, 9 * flux.log_share, 9 * flux.squares)
    projections = tuple(term.projection for term in terms)
    shapes = tuple(tuple(term.texture.shape[:2]) for term in terms)
    near = replace(logs, weights=flux.weights_of(logs))
    system = solve_terms(near, projections, shapes, smoothing, "cholesky")
    assert system.factor is not None
    _, own = keep_light(logs, system.terms, smoothing, flux)
    _, given = keep_light(logs, system.terms, smoothing, flux, system.factor)
    assert given["before"] == pytest.approx(own["before"], rel=1e-9)
    assert given["after"] == pytest.approx(own["after"], rel=1e-3)
    assert given["evaluations"] <= own["evaluations"] + 2
    step = np.random.default_rng(0).normal(size=(int(sum(term.mask.sum() for term in terms)), 2))
    scale = [
        np.linalg.norm(_Light(logs, system.terms, smoothing, flux, factor)._factor.times(step))
        for factor in (None, system.factor)
    ]
    assert 0.5 < scale[1] / scale[0] < 1.05


def test_blocks_of_textures_lead_to_the_same_minimum(solved, monkeypatch: pytest.MonkeyPatch) -> None:
    _, logs, flux, terms = solved
    _, dense = keep_light(logs, terms, 1e-3, flux)
    monkeypatch.setattr(size, "MOST_DENSE", 0)
    _, blocks = keep_light(logs, terms, 1e-3, flux)
    assert blocks["before"] == pytest.approx(dense["before"], rel=1e-13)
    assert blocks["after"] == pytest.approx(dense["after"], rel=2e-2)
    light = _Light(logs, terms, 1e-3, flux)
    start = light.start() + 0.1 * np.random.default_rng(0).normal(size=len(light.start()))
    error = check_grad(lambda z: light.evaluate(z)[0], lambda z: light.evaluate(z)[1], start, epsilon=1e-6)
    assert error < 1e-4 * np.linalg.norm(light.evaluate(start)[1])
