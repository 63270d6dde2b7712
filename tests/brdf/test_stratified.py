"""A stratified subset: no cell is lost, and weights sum to what they stood for."""

from dataclasses import replace

import pytest
import torch
from refusals import refused

from homofact.brdf.analytic import Lambert
from homofact.brdf.quality.coverage import occupied_cells
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model
from homofact.brdf.source import open_source
from homofact.brdf.stratified import GRIDS, stratified_subset
from homofact.evaluation.compare import fit_and_measure
from homofact.geometry.coordinates import coordinate_system
from homofact.methods.mccool import McCool

pytestmark = pytest.mark.usefixtures("unseen")

MODEL = Lambert((0.5,), channels=("Y",))


def dense(count: int = 20_000) -> Samples:
    samples = sample_model(MODEL, count)
    weights = torch.rand(count, dtype=torch.float64, generator=torch.Generator().manual_seed(5))
    # The number of each sample as its value, so that they can be told apart.
    return replace(samples, weights=weights, values=torch.arange(count, dtype=torch.float64)[:, None])


def cells(samples: Samples, grid: tuple[int, ...] = GRIDS[0]) -> torch.Tensor:
    place = (coordinate_system("isotropic-half-diff").evaluate(samples.wi, samples.wo) + 1) / 2
    place[:, 0] = place[:, 0].sqrt()
    return occupied_cells(place, grid)


def sums(samples: Samples, grid: tuple[int, ...] = GRIDS[0]) -> dict[int, float]:
    where = cells(samples, grid)
    return {int(c): float(samples.weights[where == c].sum()) for c in where.unique()}


@pytest.mark.parametrize("count", [700, 3000, 19_999])
def test_every_cell_stays_and_keeps_its_weight(count: int) -> None:
    whole = dense()
    some = stratified_subset(whole, count, 0)
    assert len(some) == count
    assert sums(some) == pytest.approx(sums(whole), rel=1e-9)
    assert len(some.values.unique()) == count
    assert bool((some.values[1:] > some.values[:-1]).all())
    row = some.values[:, 0].long()
    assert torch.equal(some.wi, whole.wi[row])
    assert torch.equal(some.wo, whole.wo[row])


def test_cells_give_alike() -> None:
    whole = dense()
    _, sizes = cells(whole).unique(return_counts=True)
    _, given = cells(stratified_subset(whole, 2000, 0)).unique(return_counts=True)
    level = int(given.max())
    short = given < level - 1
    assert torch.equal(given[short], sizes[short])  # whoever gives less has no more
    assert int(sizes.max()) > 10 * level


def test_the_highlight_keeps_more_than_by_chance() -> None:
    whole = dense()
    near = whole.wi + whole.wo
    peak = near[:, 2] / near.norm(dim=1) > 0.999
    by_cell = stratified_subset(whole, 1000, 0)
    kept = int(torch.isin(by_cell.values[:, 0], whole.values[peak, 0]).sum())
    by_chance = int(torch.isin(whole.subset(1000, 0).values[:, 0], whole.values[peak, 0]).sum())
    assert kept > 3 * by_chance


@pytest.mark.parametrize("count", [1, 2, 7, 40])
def test_few_samples_make_the_grid_coarser(count: int) -> None:
    whole = dense()
    some = stratified_subset(whole, count, 0)
    assert len(some) == count
    assert float(some.weights.sum()) == pytest.approx(float(whole.weights.sum()))
    grid = tuple(some.provenance["subset"]["grid"].values())
    assert sums(some, grid) == pytest.approx(sums(whole, grid))


def test_weightless_samples_carry_their_cell_too() -> None:
    whole = dense(3000)
    weights = torch.zeros(3000, dtype=torch.float64)
    weights[::7] = 1.0
    some = stratified_subset(replace(whole, weights=weights), 500, 0)
    assert float(some.weights.sum()) == pytest.approx(float(weights.sum()))


def test_it_is_seeded_says_what_it_did_and_leaves_small_sets_alone() -> None:
    whole = dense(3000)
    one, two, other = (stratified_subset(whole, 500, seed) for seed in (1, 1, 2))
    assert torch.equal(one.values, two.values)
    assert not torch.equal(one.values, other.values)
    assert one.provenance["subset"]["of"] == 3000
    assert "subset" not in whole.provenance
    assert stratified_subset(whole, 3000, 0) is whole
    with refused(where="subset", found="0"):
        stratified_subset(whole, 0, 0)


def test_a_weighted_mean_is_kept_on_average() -> None:
    whole = replace(dense(), values=dense().wi[:, 2:] ** 2, weights=torch.ones(20_000, dtype=torch.float64))

    def mean(samples: Samples) -> float:
        return float((samples.values[:, 0] * samples.weights).sum() / samples.weights.sum())

    found = [mean(stratified_subset(whole, 1500, seed)) for seed in range(20)]
    assert sum(found) / 20 == pytest.approx(mean(whole), rel=5e-3)


def test_a_fit_to_a_subset_is_judged_by_all_held_out_samples() -> None:
    source = open_source("material:blinn-phong-50", count=3000)
    settings = McCool(size=6, projections=("theta_h-theta_d",))
    whole = fit_and_measure(source, settings)
    some = fit_and_measure(source, settings, subset=800)
    assert whole.record()["subset"] is None
    assert some.record()["subset"]["samples"] == 800
    assert some.record()["subset"]["of"] == 2400
    assert some.samples == whole.samples
    # The same judge, a little more error.
    assert 0.5 * whole.held_out.log_mse < some.held_out.log_mse < 4 * whole.held_out.log_mse
