"""The searched fit: kinds it must recognise, its limits, its notes, its refinement."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch
from torch import Tensor

from homofact.brdf.analytic import Ward
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model
from homofact.errors import BadInput, Status
from homofact.evaluation.energy import energy_errors
from homofact.evaluation.metrics import measure
from homofact.factor.fixed_projections import FIXED_PROJECTIONS, KINDS
from homofact.factor.projection import Projection, Warp, fixed_projection
from homofact.geometry.coordinates import rusinkiewicz_angles
from homofact.geometry.directions import draw_in_discs
from homofact.methods import structure_search
from homofact.methods.fitting import FitProgress
from homofact.methods.kinds import is_isotropic, is_searched, loosened, make
from homofact.methods.search import Search
from homofact.methods.search_fit import fit_search
from homofact.methods.search_task import candidates_of


def _draw(function, count: int = 3000, seed: int = 0, isotropic: bool = True) -> Samples:
    wi, wo = draw_in_discs(count, torch.Generator().manual_seed(seed), 0.98)
    return Samples(wi, wo, function(wi, wo), channels=("Y",), isotropic=isotropic, all_azimuths=True)


def _lobe(wi: Tensor, wo: Tensor) -> Tensor:
    theta_h, theta_d, _ = rusinkiewicz_angles(wi, wo)
    return (0.1 + 3 * torch.exp(-((theta_h / 0.3) ** 2)) * (1 + theta_d**2))[:, None]


def _lobe_and_edge(wi: Tensor, wo: Tensor) -> Tensor:
    return _lobe(wi, wo) * torch.exp(-1.5 * (wi[:, 2:] + wo[:, 2:]) + 2 * wi[:, 2:] * wo[:, 2:])


FAST: dict[str, Any] = {"size": 10, "search_samples": 1500, "restarts": 2, "budget": 60.0}


def test_it_recognises_what_the_material_depends_on() -> None:
    settings = Search(textures=2, **FAST)
    fit = fit_search(_draw(_lobe_and_edge), settings)
    test = _draw(_lobe_and_edge, seed=1)
    found = measure(fit.factorization, test, fit.factorization.transform).log_mse
    assert found < 1e-3
    read = {term.projection.coordinates for term in fit.factorization.terms}
    assert "isotropic-half-tilt" in read
    assert read <= {"isotropic-half-tilt", "isotropic-angles"}
    assert fit.report.status is Status.CONVERGED
    assert len(fit.factorization.provenance["smoothing"]) == 2
    assert len(fit.factorization.provenance["kinds"]) == 2


def test_a_texture_that_is_not_needed_is_not_kept_and_that_is_said() -> None:
    """f depends on θi and θo alone, over a bilinear texture: one texture is exact."""

    def ramp(wi: Tensor, wo: Tensor) -> Tensor:
        return torch.exp(torch.acos(wi[:, 2:]) + torch.acos(wo[:, 2:]))

    noise = torch.randn(3000, 1, dtype=torch.float64, generator=torch.Generator().manual_seed(5))
    samples = _draw(lambda wi, wo: ramp(wi, wo) * torch.exp(0.2 * noise))
    fit = fit_search(samples, Search(textures=3, **FAST))
    assert len(fit.factorization.terms) < 3
    assert "more do not lower the validation error" in fit.report.notes[0]


def test_a_pinned_list_gives_every_texture_its_kind() -> None:
    settings = Search(textures=2, projections=("theta_h-theta_d", "theta_i"), **FAST)
    terms = fit_search(_draw(_lobe), settings).factorization.terms
    assert [term.projection.name for term in terms] == ["theta_h-theta_d", "theta_i"]
    assert [term.size for term in terms] == [(10, 10), (1, 10)]


def test_a_pinned_kind_that_knows_the_azimuth_is_fitted_to_copies() -> None:
    """One azimuth measured: a 4D fit must hold on the rotated material all the same."""
    wi, wo = draw_in_discs(1500, torch.Generator().manual_seed(0), 0.9)
    azimuth = torch.atan2(wi[:, 1], wi[:, 0])
    measured = Samples(wi, wo, _lobe(wi, wo), channels=("Y",), isotropic=True).turned(-azimuth)
    settings = Search(textures=1, projections=("half-diff",), **{**FAST, "search_samples": 4000})
    fit = fit_search(measured, settings)
    test = measured.rotated_at_random(1)
    here = measure(fit.factorization, measured, fit.factorization.transform).log_mse
    there = measure(fit.factorization, test, fit.factorization.transform).log_mse
    assert there < 2 * here


def test_equal_seeds_give_equal_bits() -> None:
    samples = _draw(_lobe, 1200)
    settings = Search(textures=2, seed=4, **FAST)
    one, other = (fit_search(samples, settings).factorization for _ in range(2))
    for first, second in zip(one.terms, other.terms, strict=True):
        assert np.array_equal(first.texture, second.texture)
        assert np.array_equal(first.projection.matrix, second.projection.matrix)


def test_a_budget_too_short_for_one_trial_still_gives_a_fit_and_says_so() -> None:
    fit = fit_search(_draw(_lobe), Search(textures=3, **{**FAST, "budget": 1e-6}))
    assert fit.report.status is Status.GUARD
    assert len(fit.factorization.terms) >= 1
    assert fit.factorization.provenance["reproducible"] is False
    assert "guard of 1e-06 s" in fit.report.notes[-1]


def test_an_interrupt_keeps_the_best_mix() -> None:
    def stop(progress: FitProgress) -> None:
        if progress.term == 2:
            raise KeyboardInterrupt

    fit = fit_search(_draw(_lobe), Search(textures=3, **FAST), stop)
    assert fit.report.status is Status.INTERRUPTED
    assert len(fit.factorization.terms) == 1
    assert "the best mix so far has 1 of 3 textures" in fit.report.notes[0]


def test_fewer_samples_than_texels_is_a_fit_of_smoothing() -> None:
    fit = fit_search(_draw(_lobe, 60), Search(textures=1, size=16, budget=20.0))
    assert bool(np.isfinite(fit.factorization.terms[0].texture).all())
    with pytest.raises(BadInput, match="samples: found 7, expected at least 8"):
        fit_search(_draw(_lobe, 7), Search())


def test_the_objective_decides_what_is_small_and_energy_keeps_the_light() -> None:
    gloss = Ward((0.05, 0.05), (0.4, 0.4), alpha_x=0.02, alpha_y=0.02, channels=("R", "G"))
    samples = sample_model(gloss, 4000, "lobe", seed=1)
    common: dict[str, Any] = {"textures": 1, "projections": ("theta_h-theta_d",), "effort": 20.0, "size": 10}
    found = {name: fit_search(samples, Search(**common, objective=name)) for name in ("log", "both", "energy")}
    energy = {name: energy_errors(fit.factorization, gloss, True).energy_overall for name, fit in found.items()}
    assert abs(energy["both"] - 1) < 0.02 < 0.1 < abs(energy["log"] - 1)
    assert abs(energy["energy"] - 1) < 0.02
    logs = {
        name: measure(fit.factorization, samples, fit.factorization.transform).log_mse for name, fit in found.items()
    }
    assert logs["log"] < logs["both"] < logs["energy"]
    assert "light" not in found["log"].report.details
    wi, wo = draw_in_discs(5000, torch.Generator().manual_seed(3))
    assert all(float(fit.factorization.evaluate(wi, wo).min()) >= 0 for fit in found.values())


@pytest.mark.slow
def test_reciprocity_is_given_up_where_the_data_are_not_reciprocal_and_kept_where_they_are() -> None:
    samples = sample_model(
        Ward((0.1, 0.1), (0.2, 0.2), alpha_x=0.3, alpha_y=0.3, channels=("R", "G")), 3000, "lobe", seed=2
    )
    one_way = replace(samples, values=samples.values * (0.2 + samples.wi[:, 2:]))
    common: dict[str, Any] = {"textures": 2, "effort": 60.0, "size": 8}
    kept, free, forced = (
        fit_search(each, Search(**common, reciprocal=reciprocal))
        for each, reciprocal in ((samples, None), (one_way, None), (one_way, True))
    )
    assert [[term.projection.reciprocal for term in fit.factorization.terms] for fit in (kept, forced)] == [
        [True] * len(kept.factorization.terms), [True] * len(forced.factorization.terms)
    ]  # fmt: skip
    assert not any(term.projection.reciprocal for term in free.factorization.terms)
    assert any("the fit is not reciprocal, f(ωi, ωo) is not f(ωo, ωi)" in note for note in free.report.notes)
    assert free.report.details["validation_error"] < 0.5 * forced.report.details["validation_error"]


def test_reciprocity_is_kept_where_giving_it_up_brings_too_little(monkeypatch: pytest.MonkeyPatch) -> None:
    samples = sample_model(Ward((0.1,), (0.2,), alpha_x=0.3, alpha_y=0.3, channels=("R",)), 2000, "lobe", seed=2)
    one_way = replace(samples, values=samples.values * (0.2 + samples.wi[:, 2:]))
    monkeypatch.setattr(structure_search, "FREE_WORTH", 1e-6)
    fit = fit_search(one_way, Search(textures=2, effort=40.0, size=6))
    assert all(term.projection.reciprocal for term in fit.factorization.terms)


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_makes_a_projection_of_its_own_symmetry(kind: str) -> None:
    projection = make(kind, True, Warp(0.1), torch.Generator().manual_seed(0), "disc")
    wi, wo = draw_in_discs(50, torch.Generator().manual_seed(1))
    uv = projection.place(wi, wo)[0]
    assert float(uv.abs().max()) <= 1 + 1e-9
    samples = Samples(wi, wo, torch.ones(50, 1), channels=("Y",), isotropic=True)
    turned = samples.turned(torch.full((50,), 0.7, dtype=torch.float64))
    same = torch.allclose(projection.place(turned.wi, turned.wo)[0], uv, atol=1e-9)
    assert same == is_isotropic(kind)
    assert (projection.rotation is not None) == is_searched(kind)


@pytest.mark.parametrize(
    "name", [n for n in FIXED_PROJECTIONS if n not in ("theta_h", "theta_d", "theta_i", "theta_h-phi_h")]
)
def test_a_loosened_projection_starts_at_the_fixed_one(name: str) -> None:
    fixed = fixed_projection(name, True)
    loose = loosened(fixed)
    assert loose is not None
    assert loose.rotation is not None
    again = Projection.from_rotation(loose.coordinates, loose.rotation, True)
    assert np.allclose(again.matrix, fixed.matrix, atol=1e-12)


def test_candidates_follow_the_symmetry_and_the_pin() -> None:
    isotropic = candidates_of(True, Search())
    assert all(is_isotropic(kind) for kind in isotropic[0])
    anisotropic = candidates_of(False, Search())
    assert "half-diff" in anisotropic[0]
    assert candidates_of(True, Search(projections=("in-out",))) == (("in-out",),)
    with pytest.raises(BadInput, match="projections: found 3 for 2 textures"):
        candidates_of(True, Search(projections=("h", "d", "wi")))
    with pytest.raises(BadInput, match="projections: found 'polar', expected one of wi"):
        candidates_of(True, Search(projections=("polar",)))


def test_a_fit_that_is_reciprocal_by_itself_is_not_called_otherwise(monkeypatch: pytest.MonkeyPatch) -> None:
    """Reciprocity is given up; the one texture that is best is over θh and θd, the same both ways."""
    samples = sample_model(Ward((0.1,), (0.2,), alpha_x=0.3, alpha_y=0.3, channels=("R",)), 2000, "lobe", seed=2)
    monkeypatch.setattr(structure_search, "FREE_WORTH", 1e6)
    fit = fit_search(samples, Search(textures=1, effort=40.0, size=6))
    (term,) = fit.factorization.terms
    assert not term.projection.reciprocal
    assert not term.projection.one_way
    assert not any("not reciprocal" in note for note in fit.report.notes)
