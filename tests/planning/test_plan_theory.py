"""The planner's theory: what lighting leaves of a lobe, and how many terms that is."""

import math

import pytest
import torch
from plan_cases import PAINT, QUICK, WHITE, fits_of, stage_of

from homofact.brdf.analytic import BlinnPhong
from homofact.brdf.analytic.lambert import Lambert
from homofact.brdf.sampling import Drawable
from homofact.errors import BadInput
from homofact.planning.ladder import (
    CONSTANT,
    LAMBERT,
    Candidate,
)
from homofact.planning.measure import RepresentationEvaluator, best_colour
from homofact.planning.theory import Lobes, colour_error, lost_above, mean_square, order_needed, terms_needed
from homofact.rendering.light import DirectionalLight, EnvironmentMap
from homofact.scene.lighting import NAMED, ORDER, Lighting, named_lighting
from homofact.theory.harmonics import harmonics, quadrature

# Lighting


def test_spectra_of_the_named_lightings() -> None:
    sun, overcast, uniform = (named_lighting(name) for name in ("sun", "overcast", "uniform"))
    degree = torch.arange(ORDER + 1).double()
    # (3.13): Σ_m Y_lm² = (2l+1)/4π, here of irradiance π.
    torch.testing.assert_close(sun.energies, math.pi**2 * (2 * degree + 1) / (4 * math.pi), rtol=1e-10, atol=0)
    assert (sun.last_excited, overcast.last_excited, uniform.last_excited) == (None, 2, 0)
    # (3.19): L_00 = √4π of radiance 1.
    assert float(uniform.coefficients[0, 0]) == pytest.approx(math.sqrt(4 * math.pi), rel=1e-4)
    # The CIE sky's mean over the hemisphere: L_00 is ∫ L/√4π, its irradiance π.
    up = torch.tensor([[0.0, 1.0, 0.0]], dtype=torch.float64)
    assert float(overcast.irradiance(up, None)) == pytest.approx(math.pi, rel=0.003)


def test_nine_terms_hold_the_irradiance_of_any_light_within_the_bound() -> None:
    w, weights = quadrature(20)
    for name, (make, _) in NAMED.items():
        light = Lighting(name, make())
        whole, cut = light.irradiance(w, None), light.irradiance(w, 2)
        error = float((weights[:, None] * (whole - cut) ** 2).sum() / (weights[:, None] * whole**2).sum()) ** 0.5
        # One source: √(1 − .992) = 9% (Ramamoorthi and Hanrahan 2001); smooth skies far less.
        assert error < (0.095 if name == "sun" else 0.06 if name == "studio" else 0.012)


def test_light_that_is_none_is_refused() -> None:
    with pytest.raises(BadInput, match="lighting: found no lights"):
        Lighting("dark", ())
    with pytest.raises(BadInput, match="only lights of radiance 0"):
        Lighting("dark", (DirectionalLight((0, 0, 1), 0.0), DirectionalLight((0, 1, 0), (0.0, 0.0, 0.0))))
    with pytest.raises(BadInput, match="named: found 'moon', expected one of sun, overcast"):
        named_lighting("moon")


# Theory


@pytest.mark.slow
def test_the_spectra_predict_the_mean_square_over_all_turnings() -> None:
    """Σ_l E_l e_l/(2l+1) against integrals of f cosθi under the lighting turned at random 2000 times."""
    light = named_lighting("studio")
    lobes = Lobes.of(BlinnPhong((0.2, 0.2, 0.2), (0.5, 0.5, 0.5), exponent=20))
    wi, weights = quadrature(24)
    generator = torch.Generator().manual_seed(3)
    view = 2
    lobe = harmonics(ORDER, wi) @ lobes.coefficients[view, :, 0]
    environment = light.lights[0]
    assert isinstance(environment, EnvironmentMap)
    lit = []
    for _ in range(2000):
        turn, triangle = torch.linalg.qr(torch.randn(3, 3, dtype=torch.float64, generator=generator))
        turn = turn * triangle.diagonal().sign()  # uniform on O(3) only so
        lit.append((weights * lobe * environment.look_up(wi @ turn)[0][:, 0]).sum())
    by_order = mean_square(lobes.coefficients[view : view + 1, :, :1], light)
    # Order 0 is the mean over the turnings, the others what varies.
    assert float(by_order[0]) == pytest.approx(float(torch.stack(lit).mean()) ** 2, rel=0.05)
    assert float(by_order[1:].sum()) == pytest.approx(float(torch.stack(lit).var()), rel=0.12)


def pooled_error(judge: RepresentationEvaluator, model: Drawable, colour: Lambert, method: str) -> float:
    """√(Σ |B − B̂|²/Σ |B|²) over all views together, as theory has it over all turnings."""
    drawn = judge.stage.draw(colour)
    pairs = zip(judge.stage.draw(model), drawn if method == CONSTANT else judge.cut(colour, drawn), strict=True)
    lost = whole = 0.0
    for (own, other), view in zip(pairs, judge.stage.views, strict=True):
        lost += float((view.weights[:, None] * (own - other) ** 2).sum())
        whole += float((view.weights[:, None] * own**2).sum())
    return math.sqrt(lost / whole)


@pytest.mark.slow
def test_theory_of_one_colour_agrees_with_the_measured_error() -> None:
    model = BlinnPhong((0.15, 0.35, 0.15), (0.4, 0.4, 0.4), exponent=50)
    fits = fits_of(model)
    for name in ("sun", "overcast", "studio", "uniform"):
        light = named_lighting(name)
        judge = RepresentationEvaluator(fits.source, stage_of(name), QUICK)
        colour = best_colour((judge,), True)
        for method in (CONSTANT, LAMBERT):
            measured = pooled_error(judge, model, colour, method)
            assert colour_error(Candidate(method), fits.lobes, light) == pytest.approx(measured, rel=0.2)


def test_nine_terms_of_the_sun_cost_a_white_sphere_some_percent() -> None:
    fits, sun = fits_of(WHITE), named_lighting("sun")
    judge = RepresentationEvaluator(fits.source, stage_of("sun"), QUICK)
    # √(1 − .992) over the whole sphere; in pictures what the 9 terms have below 0 is cut, which mends some.
    assert colour_error(Candidate(LAMBERT), fits.lobes, sun) == pytest.approx(0.0883, abs=0.001)
    assert 0.07 < pooled_error(judge, WHITE, best_colour((judge,), True), LAMBERT) < 0.0883


def test_a_map_with_a_small_sun_excites_every_order_looked_at() -> None:
    pixels = torch.full((64, 128, 1), 0.01, dtype=torch.float64)
    pixels[20, 30] = 1000.0
    assert Lighting("sky", (EnvironmentMap(pixels),)).last_excited is None


def test_low_orders_are_needed_where_only_they_are_lit() -> None:
    lobes = Lobes.of(PAINT)
    orders = [order_needed(lobes, named_lighting(name), 0.05) for name in ("uniform", "overcast", "studio", "sun")]
    assert orders == sorted(orders)
    assert orders[0] == 0
    assert orders[1] <= 3 < orders[2] < orders[3]
    lost = lost_above(lobes, named_lighting("sun"))
    assert bool((lost[1:] <= lost[:-1]).all())
    assert float(lost[-1]) < 1e-6
    assert [terms_needed(order) for order in (0, 1, 3)] == [1, 2, 8]
