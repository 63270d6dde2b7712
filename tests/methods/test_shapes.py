"""A byte budget: never more than it, spent where it lowers the left-out error, and bad ones refused."""

import math
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
import torch
from hypothesis import example, given
from hypothesis import strategies as st
from torch import Tensor

from homofact.brdf.analytic import CookTorrance
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import draw_in_discs
from homofact.cli.main import main
from homofact.errors import BadInput
from homofact.evaluation.metrics import measure
from homofact.evaluation.wording import shapes as words
from homofact.factor.projection import fixed_projection
from homofact.linear.laplacian import laplacian
from homofact.methods import shapes
from homofact.methods.effort import FitBudget
from homofact.methods.mix import Mix
from homofact.methods.search import Search
from homofact.methods.search_fit import fit_search
from homofact.methods.shapes import Layout, SmoothingFor, best_within, stored, texels_in

FAST: dict[str, Any] = {"effort": 40.0, "epsilon": 1e-3}
NAMES = ("theta_h-theta_d", "theta_h", "theta_h-phi_h", "theta_i-theta_o")


def drawn(function, count: int = 4000, seed: int = 0) -> Samples:
    wi, wo = draw_in_discs(count, torch.Generator().manual_seed(seed))
    return Samples(wi, wo, function(wi, wo), channels=("Y",), isotropic=True)


def along_one_angle(wi: Tensor, wo: Tensor) -> Tensor:
    """Much happens along θh, next to nothing along θd."""
    h = wi + wo
    h = h / h.norm(dim=1, keepdim=True)
    theta = torch.acos(h[:, 2:].clamp(-1, 1))
    return torch.exp(torch.sin(9 * theta) + 0.1 * (h * wi).sum(1, keepdim=True))


@example(texels=117, shares=[1.0] * 4, aspects=[1.0] * 4, names=["theta_h"])  # one texture of one row takes them all
@given(
    texels=st.integers(60, 5000),
    shares=st.lists(st.floats(0.5, 4), min_size=4, max_size=4),
    aspects=st.lists(st.floats(1 / 16, 16), min_size=4, max_size=4),
    names=st.lists(st.sampled_from(NAMES), min_size=1, max_size=4),
)
def test_no_layout_stores_more_than_it_may_and_none_wastes_a_line_of_every_texture(
    texels: int, shares: list[float], aspects: list[float], names: list[str]
) -> None:
    projections = tuple(fixed_projection(name, True) for name in names)
    shapes = Layout(tuple(shares[: len(names)]), tuple(aspects[: len(names)])).shapes(projections, texels)
    smallest = all(min(shape) <= 2 for shape in shapes)
    assert stored(projections, shapes) <= texels or smallest
    grown = tuple((rows + (rows > 1), columns + 1) for rows, columns in shapes)
    assert stored(projections, grown) > texels


def test_smoothing_is_the_same_penalty_on_the_function_at_every_size() -> None:
    """λ · samples per texel · Σ (second differences)² of one smooth function, on textures of 24² to 96²."""
    mix = Mix(("theta_h-theta_d",), (fixed_projection("theta_h-theta_d", True),), (1e-3,))
    smoothing_for = SmoothingFor(24, 1.0, None)

    def penalty(side: int) -> float:
        x = np.linspace(0, 1, side)
        bump = (np.sin(np.pi * x) ** 2)[:, None] * (np.sin(np.pi * x) ** 2)
        rows = laplacian(torch.ones(side, side, dtype=torch.bool)) @ bump.reshape(-1)
        (smoothing,) = smoothing_for(mix, ((side, side),))
        return smoothing / side**2 * float((rows**2).sum())

    assert penalty(48) == pytest.approx(penalty(24), rel=0.15)
    assert penalty(96) == pytest.approx(penalty(48), rel=0.07)


def test_smoothing_that_was_found_counts_the_samples_that_were_left_out_and_a_given_one_does_not() -> None:
    mix = Mix(("theta_h", "theta_d"), (fixed_projection("theta_h", True),) * 2, (1e-3, 2e-3))
    shapes = ((1, 8), (4, 16))
    assert SmoothingFor(8, 0.5, None)(mix, shapes) == pytest.approx((5e-4, 1e-3))
    assert SmoothingFor(8, 0.5, 1e-3)(mix, shapes) == pytest.approx((1e-3, 2e-3))


def test_a_layout_keeps_its_aspect_and_its_shares() -> None:
    projections = tuple(fixed_projection(name, True) for name in ("theta_h-theta_d", "theta_i-theta_o"))
    assert Layout.even(2).shapes(projections, 512) == ((16, 16), (16, 16))
    assert Layout((1.0, 1.0), (4.0, 0.25)).shapes(projections, 512) == ((8, 32), (32, 8))
    assert Layout((3.0, 1.0), (1.0, 1.0)).shapes(projections, 400) == ((17, 17), (10, 10))
    round_one = (fixed_projection("theta_h-phi_h", True),)
    ((rows, columns),) = Layout.even(1).shapes(round_one, 272)
    # φh goes round, so that one line more is stored.
    assert stored(round_one, ((rows, columns),)) == rows * columns + columns <= 272


@pytest.mark.slow
def test_texels_lie_along_the_angle_on_which_something_happens() -> None:
    samples, test = drawn(along_one_angle), drawn(along_one_angle, seed=1)
    spent = fit_search(samples, Search(bytes=4 * 144, **FAST))
    square = fit_search(samples, Search(textures=1, size=12, **FAST))
    assert spent.factorization.nbytes <= 4 * 144
    errors = [measure(fit.factorization, test, fit.factorization.transform).log_mse for fit in (spent, square)]
    assert errors[0] < 0.5 * errors[1]
    name = spent.factorization.terms[0].projection.name
    rows, columns = spent.report.details["shapes"][0]
    assert name != "theta_h-theta_d" or columns >= 2 * rows


@pytest.mark.slow
def test_a_texture_that_earns_nothing_is_not_stored() -> None:
    fit = fit_search(drawn(along_one_angle), Search(bytes=4 * 200, **FAST))
    assert len(fit.factorization.terms) < 3
    # The note counts the textures of this fit, not those that one size would have kept.
    told = [note for note in fit.report.notes if "the search kept" in note]
    kept = len(fit.factorization.terms)
    assert len(told) == 1
    assert f"kept {kept} of " in told[0]
    assert (
        fit_search(drawn(along_one_angle), Search(bytes=4 * 200, **FAST)).report.details["shapes"]
        == (fit.report.details["shapes"])
    )


@pytest.mark.parametrize(
    ("measured", "error", "taken"), [(1000, 0.96, 2), (1000, 0.98, 1), (999, 0.74, 2), (999, 0.76, 1)]
)
def test_one_more_texture_has_to_be_worth_its_fetch(
    monkeypatch: pytest.MonkeyPatch, measured: int, error: float, taken: int
) -> None:
    """Error of the second mix over the first's: 3% less is the least that counts, 25% of fewer than 1,000 samples."""
    first = Mix(("theta_h",), (fixed_projection("theta_h", True),), (1e-3,))
    second = first.with_one_more("theta_d", fixed_projection("theta_d", True))
    monkeypatch.setattr(shapes._Judge, "error", lambda self, mix, _: 1.0 if mix is first else error)
    for_mix, budget = SmoothingFor(8, 1.0, None), FitBudget(math.inf, math.inf)
    spent = best_within(64, (first, second), Mock(), for_mix, budget, measured)
    assert len(spent.mix.kinds) == taken
    assert spent.errors == (1.0, error)


@pytest.mark.parametrize(("measured", "folds"), [(999, None), (1000, 1)])
def test_every_fold_of_few_samples_is_left_out(measured: int, folds: int | None) -> None:
    mix = Mix(("theta_h",), (fixed_projection("theta_h", True),), (1e-3,))
    materials = Mock()
    materials.cost.return_value = 0.0
    equations = materials.folded.return_value
    equations.solves.return_value, equations.unknowns, equations.error.return_value = 1, 8, 1.0
    budget = FitBudget(math.inf, math.inf)
    best_within(64, (mix,), materials, SmoothingFor(8, 1.0, None), budget, measured)
    asked = [call.args[-1] for call in (*materials.folded.call_args_list, *equations.error.call_args_list)]
    assert asked
    assert set(asked) == {folds}


@pytest.mark.slow
def test_bytes_do_not_overfit_few_samples() -> None:
    """A material of one texture, from 600 samples without noise: as good where nothing was measured as one texture."""
    generator = torch.Generator().manual_seed(7)
    model = CookTorrance((0.1, 0.37, 0.09), (1.0, 1.0, 1.0), 0.12, 0.05)
    wi, wo = draw_in_discs(600, generator, 0.93)
    train = Samples(wi, wo, model.evaluate(wi, wo), isotropic=True)
    wi, wo = draw_in_discs(4000, generator, 0.93)
    test = Samples(wi, wo, model.evaluate(wi, wo), isotropic=True)
    chosen = {"epsilon": 1e-3, "effort": "quick"}
    spent, one = (
        fit_search(train, Search(**size, **chosen)).factorization
        for size in ({"bytes": 6144}, {"textures": 1, "size": 16})
    )
    errors = [measure(fit, test, fit.transform).log_mse for fit in (spent, one)]
    assert errors[0] < 1.5 * errors[1]


def test_bad_budgets(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(BadInput, match="bytes: found 47, expected at least 48: a 2 × 2 texture of 3 channels"):
        texels_in(47, 3)
    with pytest.raises(BadInput, match="bytes: found 0"):
        Search(bytes=0)
    with pytest.raises(BadInput, match="bytes: found it beside projections, expected one of them"):
        Search(bytes=6144, textures=1, projections=("h",))
    assert main(["factorize", "material:phong-10", "--bytes", "10", "--count", "200", "--out", "/nowhere/x"]) == 2
    assert main(["factorize", "material:phong-10", "--bytes", "6144", "--method", "mccool"]) == 2
    assert "bytes" in capsys.readouterr().err


def test_shapes_in_words() -> None:
    assert words([[16, 16], [16, 16]]) == "2 × 16²"
    assert words([[1, 16], [16, 16]]) == "2 × 16²"
    assert words([[8, 32], [16, 16]]) == "8×32 + 16×16"
    assert Search(bytes=6144).most_textures == 3
    assert Search(bytes=6144, textures=4).most_textures == 4
    assert Search().most_textures == 2
    assert math.isclose(texels_in(6144, 3), 512)
