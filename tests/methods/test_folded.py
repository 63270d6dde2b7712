"""Many mixes from one accumulation, and folds that add up."""

import pytest
import torch

from homofact.factor.projection import Warp, fixed_projection
from homofact.factor.textures import LogSamples, inner_problem, texture_shape
from homofact.geometry.directions import draw_in_discs
from homofact.methods.effort import FitBudget, cost_of_solve
from homofact.methods.folded import FixedBank, Folded
from homofact.methods.validation import Partition, random_folds

NAMES = ("theta_h-theta_d", "theta_i-theta_o", "theta_d-phi_d", "theta_i")


def _samples(count: int = 700) -> LogSamples:
    generator = torch.Generator().manual_seed(0)
    wi, wo = draw_in_discs(count, generator, 0.98)
    logs = torch.stack((3 * wi[:, 2] * wo[:, 2], wi[:, 0] + wo[:, 1]), 1)
    logs = logs + 0.1 * torch.randn(count, 2, dtype=torch.float64, generator=generator)
    return LogSamples(wi, wo, logs, torch.rand(count, dtype=torch.float64, generator=generator) + 0.5)


@pytest.mark.parametrize("chosen", [(0,), (3,), (0, 1), (2, 0), (3, 1, 0)])
def test_a_mix_of_the_bank_is_the_mix_accumulated_by_itself(chosen: tuple[int, ...]) -> None:
    samples = _samples()
    never = random_folds(700, 4, 0)
    never[:50] = -1
    partitions = (Partition(never, 0.25), Partition(random_folds(700, 3, 1), 0.75))
    projections = tuple(
        fixed_projection(name, True, Warp(0.1) if name.startswith("theta_h") else None) for name in NAMES
    )
    shapes = tuple(texture_shape(projection, 6) for projection in projections)
    mix = FixedBank.of(samples, partitions, projections, shapes).mix(chosen)
    alone = Folded.of(samples, partitions, tuple(projections[j] for j in chosen), tuple(shapes[j] for j in chosen))
    smoothing = tuple(10.0 ** -(1 + j) for j in range(len(chosen)))
    assert mix.error(smoothing) == pytest.approx(alone.error(smoothing), rel=1e-9)
    assert mix.error(smoothing, 1) == pytest.approx(alone.error(smoothing, 1), rel=1e-9)
    assert mix.error(smoothing, 1) != mix.error(smoothing)
    assert mix.layout == alone.layout
    assert mix.lookups == alone.lookups


def test_the_whole_is_all_samples_whatever_the_folds_leave_out() -> None:
    samples = _samples()
    folds = random_folds(700, 4, 0)
    folds[::3] = -1
    projections = (fixed_projection("h", True),)
    found = Folded.of(samples, (Partition(folds, 1.0),), projections, ((5, 5),))
    data = inner_problem(samples, projections, ((5, 5),), 0.0).data
    assert torch.allclose(found.whole.matrix, data.matrix, atol=1e-12)
    assert torch.allclose(found.whole.rhs, data.rhs, atol=1e-12)
    assert found.whole.weight == pytest.approx(data.weight)
    assert [len(parts) for parts in found.parts] == [4]


def test_every_question_about_smoothing_is_paid_for_and_a_spent_budget_asks_no_more() -> None:
    projections = (fixed_projection("h", True), fixed_projection("wi", True))
    folded = Folded.of(_samples(), (Partition(random_folds(700, 4, 0), 1.0),), projections, ((6, 6), (5, 5)))
    budget = FitBudget()
    folded.best_each((1e-3, 1e-3), budget)
    asked = budget.spent / (4 * cost_of_solve(61))
    assert asked == pytest.approx(round(asked))
    assert asked >= 5  # the start, and both directions of both textures unless one helps
    assert budget.evaluations == round(asked)
    spent = FitBudget(0)
    assert folded.best_each((1e-3, 1e-3), spent)[0] == (1e-3, 1e-3)
    assert spent.evaluations == 1
