"""Texels of whole numbers: on their grid, and the best there is on it."""

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

import homofact
from homofact.brdf.pair_density import draw_lobe
from homofact.brdf.source import Source, open_source
from homofact.errors import BadInput
from homofact.evaluation.metrics import measure
from homofact.factor.factorization import Factorization
from homofact.factor.quantize import _Closest, quantize, rounded
from homofact.geometry.directions import draw_cosine_weighted
from homofact.linear.bilinear import stencil
from homofact.linear.normal import Lookup, accumulate_compiled, accumulate_torch

pytestmark = pytest.mark.usefixtures("unseen")

SYNTHETIC = Path(__file__).resolve().parents[2] / "data_synthetic" / "synthetic_cornell.brdf"


def steps_of(factorization: Factorization) -> list[torch.Tensor]:
    numbers = []
    for term in factorization.terms:
        assert term.grid is not None
        numbers.append(torch.from_numpy((term.texture - term.grid.low) / term.grid.step))
    return numbers


@pytest.fixture(scope="module")
def paint() -> tuple[Source, Factorization]:
    source = open_source("material:lafortune-blue-paint", count=6000, scheme="discs")
    fitted = homofact.fit(source, homofact.McCool(size=12)).factorization
    assert isinstance(fitted, Factorization)
    return source, fitted


def test_texels_are_whole_numbers_of_their_grid_and_stay_so_in_a_file(paint, tmp_path) -> None:
    source, fitted = paint
    found = quantize(fitted, source.samples, "png8")
    for numbers in steps_of(found):
        assert torch.allclose(numbers, numbers.round(), atol=1e-6)
        assert float(numbers.min()) >= 0
        assert float(numbers.max()) <= 255 + 1e-6
    found.save(tmp_path / "fit.npz")
    again = Factorization.load(tmp_path / "fit.npz")
    for term, same in zip(found.terms, again.terms, strict=True):
        assert term.grid is not None
        assert same.grid is not None
        assert np.array_equal(term.grid.low, same.grid.low)
        assert np.array_equal(term.grid.step, same.grid.step)
        assert same.grid.levels == 255


def test_rounding_that_knows_the_samples_moves_the_values_half_as_far_as_naive_rounding(paint) -> None:
    source, fitted = paint
    wi, wo = source.samples.wi, source.samples.wo

    def moved(other: Factorization) -> float:
        return float((other.evaluate_log(wi, wo) - fitted.evaluate_log(wi, wo)).square().mean().sqrt())

    plain = rounded(fitted, "png8")
    assert moved(quantize(fitted, source.samples, "png8")) < 0.5 * moved(plain)


def test_on_a_close_fit_most_of_what_naive_rounding_adds_to_the_error_goes(paint) -> None:
    source, _ = paint
    fitted = homofact.fit(
        source, homofact.McCool(size=16, projections=("theta_h-theta_d", "theta_i-theta_o"))
    ).factorization
    assert isinstance(fitted, Factorization)
    aware, plain = quantize(fitted, source.samples, "png8"), rounded(fitted, "png8")
    before, after, worse = (measure(each, source.samples, fitted.transform).log_mse for each in (fitted, aware, plain))
    assert after - before < 0.7 * (worse - before)


def test_sixteen_bits_lose_next_to_nothing(paint) -> None:
    source, fitted = paint
    after = measure(quantize(fitted, source.samples, "png16"), source.samples, fitted.transform).log_mse
    assert after == pytest.approx(measure(fitted, source.samples, fitted.transform).log_mse, rel=1e-3)


def test_it_is_near_the_exhaustive_optimum() -> None:
    generator = np.random.default_rng(0)
    ratios = []
    for _ in range(30):
        rows = generator.normal(size=(12, 6))
        matrix, best = rows.T @ rows, generator.uniform(-1, 1, 6)
        owner, lows, steps = np.array([0, 0, 0, 1, 1, 1]), np.array([-1.0, -1.0]), np.array([0.5, 0.6])
        closest = _Closest(matrix, owner, 3)

        def objective(numbers: np.ndarray, owner=owner, lows=lows, steps=steps, best=best, matrix=matrix) -> float:
            off = lows[owner] + steps[owner] * numbers - best
            return float(off @ matrix @ off)

        found = objective(closest.numbers(best, lows, steps))
        ratios.append(found / min(objective(np.array(each)) for each in itertools.product(range(4), repeat=6)))
    assert np.median(ratios) == pytest.approx(1)
    assert max(ratios) < 2


def test_a_texel_that_ran_away_does_not_widen_the_steps_of_the_others() -> None:
    matrix = np.diag([1.0] * 20 + [1e-9])
    best = np.concatenate([np.random.default_rng(0).uniform(0, 1, 20), [100.0]])
    _, steps = _Closest(matrix, np.zeros(21, dtype=int), 255).ranges(best)
    assert steps[0] * 255 < 2


def test_a_fit_may_ask_for_it_by_its_settings(paint) -> None:
    source, _ = paint
    fitted = homofact.fit(source, homofact.McCool(size=8, quantize="png8")).factorization
    assert fitted.provenance["quantize"] == "png8"
    assert isinstance(fitted, Factorization)
    assert all(float((n - n.round()).abs().max()) < 1e-6 for n in steps_of(fitted))


def test_a_refined_fit_keeps_its_own_texels_as_the_target(paint) -> None:
    source, fitted = paint
    moved = replace(fitted, terms=tuple(replace(t, texture=t.texture + 0.3) for t in fitted.terms))
    moved = replace(moved, provenance=moved.provenance | {"settings": {"objective": "both"}})
    wi, wo = source.samples.wi, source.samples.wo
    off = quantize(moved, source.samples, "png16").evaluate_log(wi, wo) - moved.evaluate_log(wi, wo)
    assert float(off.abs().max()) < 0.01


def test_unknown_storages_are_refused(paint) -> None:
    with pytest.raises(BadInput, match=r"quantize: found 'png4', expected one of png8, png16"):
        quantize(paint[1], paint[0].samples, "png4")
    with pytest.raises(BadInput, match=r"quantize: found 'png4', expected one of none, png8, png16"):
        homofact.fit(paint[0], quantize="png4")


def test_a_samplers_steps_are_in_the_stencil_and_in_both_accumulations() -> None:
    uv = torch.tensor([[0.123, -0.7]], dtype=torch.float64)
    _, weights = stencil(uv, (5, 5), 4)
    position = (uv[0] + 1) * 2
    u, v = torch.floor((position - position.floor()) * 4 + 0.5) / 4
    assert torch.allclose(weights[0], torch.stack(((1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v)))
    x = torch.rand(200, 2, generator=torch.Generator().manual_seed(1), dtype=torch.float64) * 2 - 1
    lookups = (Lookup(0, torch.eye(2, dtype=torch.float64), (5, 6), 0, 8),)
    f, w = torch.ones(200, 1, dtype=torch.float64), torch.ones(200, dtype=torch.float64)
    compiled, plain = accumulate_compiled(x, lookups, f, w, 30), accumulate_torch(x, lookups, f, w, 30)
    exact = accumulate_torch(x, (replace(lookups[0], fractions=0),), f, w, 30)
    assert torch.allclose(compiled.matrix, plain.matrix)
    assert not torch.allclose(exact.matrix, plain.matrix)


def test_where_samples_are_few_values_elsewhere_do_not_drift() -> None:
    source = homofact.read(str(SYNTHETIC))
    few = source.samples.subset(120, 0)
    projections = ("theta_h-theta_d", "theta_i-delta_phi")
    fitted = homofact.fit(few, homofact.McCool(size=16, projections=projections, epsilon=1e-2)).factorization
    assert isinstance(fitted, Factorization)
    wi, wo = draw_cosine_weighted(5000, torch.Generator().manual_seed(9))

    def moved(other: Factorization) -> float:
        return float((other.evaluate_log(wi, wo) - fitted.evaluate_log(wi, wo)).square().mean().sqrt())

    plain = rounded(fitted, "png8")
    assert moved(quantize(fitted, few, "png8")) < moved(plain)


def test_the_tip_of_a_highlight_without_samples_is_not_drawn_in() -> None:
    samples = open_source("material:car-paint-red", count=4000).samples
    half = samples.wi + samples.wo
    tip = half[:, 2] / half.norm(dim=1) > np.cos(np.radians(1.5))
    beside = samples.select(~tip)
    fitted = homofact.McCool(size=24).fit(beside).factorization
    assert isinstance(fitted, Factorization)
    wi, wo = draw_lobe(20_000, torch.Generator().manual_seed(5))
    bisector = wi + wo
    near = bisector[:, 2] / bisector.norm(dim=1) > np.cos(np.radians(1.5))
    moved = quantize(fitted, beside, "png8").evaluate_log(wi, wo) - fitted.evaluate_log(wi, wo)
    assert float(moved[near].square().mean().sqrt()) < 0.01
