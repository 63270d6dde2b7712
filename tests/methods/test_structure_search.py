"""The search over mixes: what it must find on planted products, what it must not do."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
import torch
from torch import Tensor

from homofact.errors import Status
from homofact.factor.projection import fixed_projection
from homofact.factor.search.gradient import Gradient
from homofact.factor.textures import LogSamples, texture_shape
from homofact.geometry.coordinates import rusinkiewicz_angles
from homofact.geometry.directions import draw_in_discs
from homofact.methods import structure_search
from homofact.methods.effort import FitBudget
from homofact.methods.folded import Folded
from homofact.methods.kinds import ISOTROPIC_CANDIDATES, is_searched
from homofact.methods.materials import Materials, TrainingMaterial
from homofact.methods.mix import Mix
from homofact.methods.structure_search import ENOUGH, StructureSearch
from homofact.methods.trials import StructureSettings, rounded
from homofact.methods.validation import Partition, random_folds

SETTINGS = StructureSettings(8, True, "disc", 2, Gradient(), None, 0)
FIXED = tuple(kind for kind in ISOTROPIC_CANDIDATES if not is_searched(kind))


def _logs(wi: Tensor, wo: Tensor) -> Tensor:
    theta_h, theta_d, phi_d = rusinkiewicz_angles(wi, wo)
    slanted = 0.8 * theta_h + 0.6 * phi_d
    return (torch.sin(2 * slanted) + torch.exp(-4 * theta_h) * theta_d + wi[:, 2] * wo[:, 2])[:, None]


def _samples(count: int = 1200) -> LogSamples:
    generator = torch.Generator().manual_seed(0)
    wi, wo = draw_in_discs(count, generator, 0.98)
    noise = 0.01 * torch.randn(count, 1, dtype=torch.float64, generator=generator)
    return LogSamples(wi, wo, _logs(wi, wo) + noise, torch.ones(count, dtype=torch.float64))


PARTITIONS = (Partition(random_folds(1200, 4, 0), 1.0),)


def _search(budget: FitBudget, settings: StructureSettings = SETTINGS) -> StructureSearch:
    return StructureSearch(Materials((TrainingMaterial(_samples(), PARTITIONS),)), settings, budget)


@pytest.mark.parametrize("count", [1, 2])
def test_the_best_fixed_mix_is_the_best_of_all_of_them(count: int) -> None:
    """Against every mix accumulated and judged one by one, λ given so that nothing else is chosen."""
    settings = replace(SETTINGS, smoothing=1e-2)
    outcome = _search(FitBudget(), settings).run(count, (FIXED,))
    samples, best = _samples(), {}
    warps = [None, *(structure_search.Warp(width) for width in structure_search.WARP_WIDTHS)]
    for number in range(1, count + 1):
        for kinds in combinations(FIXED, number):
            for warp in warps:
                projections = tuple(
                    fixed_projection(kind, True, warp if structure_search.takes_warp(kind) else None) for kind in kinds
                )
                shapes = tuple(texture_shape(projection, 8) for projection in projections)
                error = Folded.of(samples, PARTITIONS, projections, shapes).error((1e-2,) * number)
                best[kinds] = min(error, best.get(kinds, error))
    assert outcome.mix.error == pytest.approx(min(best.values()), rel=1e-6)
    assert sorted(outcome.mix.kinds) == sorted(min(best, key=lambda kinds: best[kinds]))


@pytest.mark.slow
def test_more_textures_are_never_worse_and_only_taken_where_they_help() -> None:
    errors = [_search(FitBudget(60.0 * count**2)).run(count, (ISOTROPIC_CANDIDATES,)).mix for count in (1, 2, 3)]
    assert errors[1].error < ENOUGH * errors[0].error
    assert errors[2].error <= errors[1].error * 1.02


@pytest.mark.parametrize(("textures", "worth"), [(1, ENOUGH), (2, ENOUGH), (3, ENOUGH**2), (4, ENOUGH**3)])
def test_every_texture_more_has_to_earn_itself(textures: int, worth: float) -> None:
    """Beside a best mix of one texture and error 1: one of more is taken below `worth`, not above it."""
    kinds = FIXED[:textures]
    projections = tuple(fixed_projection(kind, True) for kind in kinds)
    for error, taken in ((worth * 1.0005, False), (worth * 0.9995, True)):
        search = _search(FitBudget())
        search._best = Mix(kinds[:1], projections[:1], (1e-3,), 1.0)
        search._offer(Mix(kinds, projections, (1e-3,) * textures, error))
        assert (search._best.error == error) is taken


@pytest.mark.slow
def test_searched_projections_find_what_fixed_ones_cannot() -> None:
    """The product has a factor on a slanted line through (θh, φd): no pair of axes is that."""
    fixed = _search(FitBudget(200)).run(2, (FIXED,)).mix
    found = _search(FitBudget(200)).run(2, (ISOTROPIC_CANDIDATES,)).mix
    assert found.error < 0.8 * fixed.error
    assert any(projection.rotation is not None for projection in found.projections)


@pytest.mark.slow
def test_the_budget_decides_what_is_tried_and_equal_budgets_buy_equal_mixes() -> None:
    small, again, large = FitBudget(80), FitBudget(80), FitBudget(700)
    mixes = [_search(budget).run(2, (ISOTROPIC_CANDIDATES,)).mix for budget in (small, again, large)]
    assert small.spent == again.spent < large.spent
    assert mixes[0].kinds == mixes[1].kinds
    assert mixes[0].smoothing == mixes[1].smoothing
    assert all(
        np.array_equal(a.matrix, b.matrix) for a, b in zip(mixes[0].projections, mixes[1].projections, strict=True)
    )
    assert mixes[2].error <= mixes[0].error


def test_the_clock_is_only_a_guard_and_says_so() -> None:
    outcome = _search(FitBudget(1e6, deadline=0.0)).run(3, (ISOTROPIC_CANDIDATES,))
    assert outcome.status is Status.GUARD
    assert outcome.mix.kinds


def test_pinned_kinds_are_all_used_in_their_order() -> None:
    outcome = _search(FitBudget(100)).run(3, (("theta_i",), ("isotropic-half-diff",), ("theta_d",)))
    assert outcome.mix.kinds == ("theta_i", "isotropic-half-diff", "theta_d")
    assert outcome.notes == ()


def test_rounding_is_far_under_what_a_projection_needs_and_hides_the_last_bits() -> None:
    generator = torch.Generator().manual_seed(1)
    vector = torch.randn(8, dtype=torch.float64, generator=generator)
    found = rounded(vector)
    unit = torch.cat([part / part.norm() for part in vector.split(4)])
    assert float((found - unit).abs().max()) < 4e-5
    assert torch.equal(found, rounded(vector * (1 + 1e-15)))
    assert torch.equal(found, rounded(3 * vector))


def test_an_interrupt_keeps_the_best_mix_so_far(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    search = _search(FitBudget(200))
    monkeypatch.setattr(structure_search, "tournament", interrupted)
    outcome = search.run(2, (ISOTROPIC_CANDIDATES,))
    assert outcome.status is Status.INTERRUPTED
    assert len(outcome.mix.kinds) == 1
    assert "interrupted" in outcome.notes[0]


def test_no_smoothing_at_all_is_searched_like_any() -> None:
    """λ = 0 has no decade: every step that carries λ on has to bear it."""
    settings = replace(SETTINGS, smoothing=0.0, reciprocal=None)
    outcome = _search(FitBudget(60), settings).run(2, (ISOTROPIC_CANDIDATES,))
    assert set(outcome.mix.smoothing) == {0.0}
    assert outcome.mix.error < 1
