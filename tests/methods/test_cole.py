"""The fits against BRDFs that they can represent exactly, and the published order of methods."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch
from torch import Tensor

from homofact.brdf.materials import material
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model
from homofact.errors import BadInput, Status
from homofact.evaluation.metrics import measure
from homofact.factor.projection import Projection
from homofact.factor.textures import LogSamples, inner_problem, residual
from homofact.geometry.directions import draw_in_discs, half_difference
from homofact.geometry.parabolic import to_disc
from homofact.geometry.rotation import Rotation
from homofact.linear.solvers import solve
from homofact.methods.cole import Cole
from homofact.methods.cole_fit import fit_cole
from homofact.methods.fitting import FitProgress
from homofact.methods.mccool import McCool
from homofact.methods.mccool_fit import fit_mccool


def _draw(function, count: int = 6000, seed: int = 0) -> Samples:
    wi, wo = draw_in_discs(count, torch.Generator().manual_seed(seed), 0.98)
    return Samples(wi, wo, function(wi, wo), channels=("Y",), isotropic=False)


def _product_of_ramps(wi: Tensor, wo: Tensor) -> Tensor:
    """exp of linear ramps in ωi, ωo (alike) and h: exact for bilinear McCool textures at any size."""
    h, _ = half_difference(wi, wo)
    across = to_disc(wi)[:, :1] + to_disc(wo)[:, :1]
    return torch.exp(0.8 * across - 1.5 * to_disc(h)[:, 1:2])


def test_mccool_is_exact_on_a_product_of_its_own_kind() -> None:
    samples = _draw(_product_of_ramps)
    fit = fit_mccool(samples, McCool(size=8, smoothing=1e-6))
    test = _draw(_product_of_ramps, seed=1)
    # ε = 1e-5 bends the logarithm by at most ε/f.
    assert measure(fit.factorization, test, fit.factorization.transform).log_mse < 1e-7
    assert fit.report.status is Status.DIRECT


@pytest.mark.slow
@pytest.mark.parametrize("coordinates", ["in-out", "half-diff"])
def test_cole_finds_a_planted_projection(coordinates: str) -> None:
    """One texture over a projection that no fixed list holds: the search must find its plane."""
    planted = Projection.from_rotation(coordinates, Rotation.random(torch.Generator().manual_seed(11)), False)

    def brdf(wi: Tensor, wo: Tensor) -> Tensor:
        u, v = planted.place(wi, wo)[0].unbind(1)
        return torch.exp(1.5 * torch.cos(3 * u + 1) + torch.sin(4 * v) - 0.8 * u * v)[:, None]

    samples, test = _draw(brdf), _draw(brdf, seed=1)
    settings = Cole(textures=1, size=12, coordinates=coordinates, reciprocal=False, search_samples=2000, seed=3)
    fit = fit_cole(samples, settings)
    found = measure(fit.factorization, test, fit.factorization.transform).log_mse
    spread = float(fit.factorization.transform.forward(test.values).var())
    assert found < 0.01 * spread


@pytest.mark.slow
def test_more_textures_never_hurt_and_reciprocity_holds() -> None:
    samples = _draw(_product_of_ramps, 3000)
    errors = []
    for textures in (1, 2, 3):
        settings = Cole(textures=textures, size=8, search_size=6, search_samples=1000, restarts=1)
        fit = fit_cole(samples, settings)
        errors.append(fit.report.residual)
        values = fit.factorization.evaluate(samples.wi, samples.wo)
        swapped = fit.factorization.evaluate(samples.wo, samples.wi)
        assert torch.allclose(values, swapped, rtol=1e-8)
    assert errors[0] > errors[1] > errors[2]


@pytest.mark.slow
def test_solving_all_terms_together_is_no_worse_than_the_last_two() -> None:
    samples = _draw(_product_of_ramps, 3000)
    common: dict[str, Any] = {"textures": 3, "size": 8, "search_size": 6, "search_samples": 1000, "restarts": 1}
    last_two = fit_cole(samples, Cole(**common, joint_terms=2)).report.residual
    everything = fit_cole(samples, Cole(**common, joint_terms=0)).report.residual
    assert everything <= last_two * 1.05


def test_equal_seeds_give_equal_fits_and_others_do_not() -> None:
    samples = _draw(_product_of_ramps, 2000)
    common: dict[str, Any] = {"textures": 1, "size": 6, "restarts": 1, "search_samples": 500}
    one, same, other = (fit_cole(samples, Cole(**common, seed=seed)).factorization for seed in (1, 1, 2))
    assert np.allclose(one.terms[0].texture, same.terms[0].texture, atol=1e-9)
    assert not np.allclose(one.terms[0].projection.matrix, other.terms[0].projection.matrix)


def test_textures_but_the_first_have_zero_mean_and_the_mean_error_is_reported() -> None:
    samples = _draw(_product_of_ramps, 3000)
    fit = fit_mccool(samples, McCool(size=8, grid="plain"))
    data = LogSamples.of(samples, fit.factorization.transform)
    for term in fit.factorization.terms[1:]:
        assert float(abs(term.texture[term.mask].mean(0)).max()) < 1e-12
    assert float((residual(data, tuple(fit.factorization.terms)) ** 2).mean()) == pytest.approx(fit.report.residual)


def test_moving_constants_does_not_change_the_sum() -> None:
    samples = _draw(_product_of_ramps, 3000)
    fit = fit_mccool(samples, McCool(size=8, smoothing=1e-3, grid="plain"))
    projections = tuple(term.projection for term in fit.factorization.terms)
    data = LogSamples.of(samples, fit.factorization.transform)
    masks = tuple(term.tensors().mask for term in fit.factorization.terms)
    problem = inner_problem(data, projections, ((8, 8), (8, 8)), 1e-3, masks)
    assert problem.mean_error(solve(problem).texels) == pytest.approx(fit.report.residual, rel=1e-9)


@pytest.mark.slow
def test_progress_tells_term_restart_and_a_best_that_falls() -> None:
    seen: list[FitProgress] = []
    settings = Cole(textures=2, size=6, restarts=2, search_samples=500)
    report = fit_cole(_draw(_product_of_ramps, 1000), settings, seen.append).report
    assert {(p.term, p.restart) for p in seen} == {(1, 1), (1, 2), (2, 1), (2, 2)}
    assert len(seen) == report.evaluations
    for term in (1, 2):
        best = [p.best for p in seen if p.term == term]
        assert best == sorted(best, reverse=True)


def test_an_interrupted_search_keeps_the_terms_it_has() -> None:
    def stop(progress: FitProgress) -> None:
        if progress.term == 2:
            raise KeyboardInterrupt

    settings = Cole(textures=3, size=6, restarts=1, search_samples=500)
    fit = fit_cole(_draw(_product_of_ramps, 1000), settings, stop)
    assert fit.report.status is Status.INTERRUPTED
    assert len(fit.factorization.terms) == 1


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"textures": 0}, "textures: found 0, expected a whole number of at least 1"),
        ({"size": 1}, "size: found 1, expected a whole number of at least 2"),
        ({"epsilon": 0.0}, "epsilon: found 0.0, expected a number above 0"),
        ({"smoothing": -1.0}, "smoothing: found -1.0, expected a number of at least 0"),
        ({"smoothing": float("nan")}, "smoothing: found nan"),
        ({"solver": "lu"}, "solver: found 'lu', expected one of cholesky"),
        ({"bound": "ball"}, "bound: found 'ball', expected one of disc, cube"),
        ({"seed": -1}, "seed: found -1"),
    ],
)
def test_settings_that_cannot_be_meant_are_refused(wrong: dict, message: str) -> None:
    with pytest.raises(BadInput, match=message):
        Cole(**wrong)


def test_cole_knows_the_two_coordinates_of_the_thesis() -> None:
    with pytest.raises(BadInput, match="coordinates: found 'theta_h-theta_d', expected one of in-out, half-diff"):
        Cole(coordinates="theta_h-theta_d")


def test_the_guard_keeps_what_is_found_by_then_and_says_so() -> None:
    samples = sample_model(material("phong-10").model, 400)
    method = Cole(textures=4, size=6, search_samples=200, search_size=6, epsilon=1e-5, budget=0.2)
    found = method.fit(samples)
    assert found.report.status is Status.GUARD
    assert 1 <= len(found.factorization.terms) < 4
    assert "guard of 0.2 s" in found.report.notes[0]
    assert found.report.details["reproducible"] is False
    assert found.factorization.provenance["reproducible"] is False


def test_a_guard_that_does_not_strike_changes_no_bit() -> None:
    samples = sample_model(material("phong-10").model, 200)
    method = Cole(textures=1, size=4, search_samples=50, restarts=1, epsilon=1e-5)
    free, guarded = (replace(method, budget=budget).fit(samples) for budget in (None, 1e6))
    assert guarded.report.status is free.report.status is not Status.GUARD
    assert guarded.report.details["reproducible"] is True
    assert guarded.report.notes == ()
    wi, wo = samples.wi, samples.wo
    assert torch.equal(guarded.evaluate(wi, wo), free.evaluate(wi, wo))
