"""Work is counted: what levels stand for, what pieces cost, and who may end a search."""

import time

import pytest

from homofact.errors import BadInput
from homofact.methods.effort import LEVELS, FitBudget, cost_of_evaluation, cost_of_solve, units


def test_the_unit_is_one_evaluation_of_two_textures_of_16() -> None:
    assert cost_of_evaluation(8000, 2, 512) == pytest.approx(1)
    assert cost_of_solve(512) < 1
    # Eight times the texels: the cube of them decides.
    assert cost_of_solve(4096) / cost_of_solve(512) > 300
    assert cost_of_evaluation(80_000, 2, 512) > 2


def test_a_level_grants_more_for_more_textures_and_a_number_is_itself() -> None:
    assert LEVELS["quick"] < LEVELS["normal"] < LEVELS["thorough"]
    assert units("normal", 4) == 16 * LEVELS["normal"]
    assert units(37.5, 4) == 37.5


@pytest.mark.parametrize("effort", ["hard", "", 0, -1.0, float("inf"), float("nan")])
def test_an_effort_that_cannot_be_meant_is_named(effort: str | float) -> None:
    with pytest.raises(BadInput, match="effort: found"):
        units(effort, 2)


def test_a_budget_is_over_when_its_units_are_spent() -> None:
    budget = FitBudget(10)
    budget.spend(9.5)
    assert not budget.over
    assert budget.left == pytest.approx(0.5)
    budget.spend(0.5, evaluations=3)
    assert budget.over
    assert budget.evaluations == 4


def test_the_clock_ends_a_budget() -> None:
    budget = FitBudget(10, time.perf_counter() - 1)
    assert budget.over
    assert budget.left == 0


def test_work_side_by_side_is_added_and_limits_nothing_meanwhile() -> None:
    """Of two pieces neither sees what the other spends: their order must decide nothing."""
    budget = FitBudget(5)
    first, second = budget.beside(), budget.beside()
    first.spend(100, 7)
    assert not second.over
    budget.add(first)
    budget.add(second)
    assert budget.spent == 100
    assert budget.evaluations == 7
    assert budget.over
