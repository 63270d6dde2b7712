"""The inner problem's forms against each other: rows and normal equations, penalties, what a mask changes."""

from dataclasses import replace

import pytest
import torch
from problems import CATALOGUE, Problem, dense_rows, planted

from homofact.linear.least_squares import RELATIVE_RIDGE, LeastSquares, solve_penalised


def held(case: Problem) -> LeastSquares:
    """The problem with smoothing, some texels masked, and two directions held as a gauge would."""
    problem = case.problem
    kept = problem.kept.clone()
    kept[2] = False
    gauge = torch.randn(problem.unknowns, 2, dtype=torch.float64, generator=torch.Generator().manual_seed(3))
    gauge, _ = torch.linalg.qr(gauge * kept[:, None])
    return replace(problem, smoothing=0.2, kept=kept, gauge=gauge)


@pytest.mark.parametrize("case", CATALOGUE, ids=lambda case: case.name)
def test_the_rows_squared_are_the_normal_equations(case: Problem) -> None:
    problem = held(case)
    rows, targets = problem.rows()
    matrix, rhs = problem.normal()
    stacked = torch.from_numpy(rows.toarray())
    assert torch.allclose(stacked.T @ stacked, matrix, rtol=1e-9, atol=1e-9)
    assert torch.allclose(stacked.T @ torch.from_numpy(targets), rhs, rtol=1e-9, atol=1e-9)


def test_smoothing_is_counted_in_samples_a_kept_texel() -> None:
    problem = replace(planted("scale").problem, smoothing=0.3)
    weight = float(problem.weights.sum())
    assert problem.penalty_scale.flatten().tolist() == pytest.approx([0.3 * weight / 25] * 25)
    half = problem.kept.clone()
    half[5:] = False
    assert replace(problem, kept=half).penalty_scale.flatten().tolist() == pytest.approx([0.3 * weight / 5] * 25)


@pytest.mark.parametrize("case", CATALOGUE, ids=lambda case: case.name)
def test_the_ridge_is_a_billionth_of_the_mean_diagonal(case: Problem) -> None:
    problem = case.problem
    mean = float(problem.data.matrix.diagonal().mean())
    assert 0.3 < RELATIVE_RIDGE * mean / problem.ridge < 1.5
    # One more lookup is as much more on the diagonal.
    more = replace(problem, lookups=(*problem.lookups, *problem.lookups))
    assert more.ridge == pytest.approx(2 * problem.ridge)
    assert problem.gauge_scale == pytest.approx(problem.ridge / RELATIVE_RIDGE)


def test_the_penalty_is_what_the_normal_matrix_adds() -> None:
    problem = replace(planted("penalty", shapes=((5, 5), (4, 4))).problem, smoothing=0.2)
    texels = torch.randn(problem.unknowns, 2, dtype=torch.float64, generator=torch.Generator().manual_seed(1))
    matrix, _ = problem.normal()
    added = matrix - problem.data.matrix
    assert problem.penalty(texels) == pytest.approx(float((texels * (added @ texels)).sum()), rel=1e-9)
    alone = solve_penalised(problem.data, problem.roughness, 0.2, len(problem.lookups))
    assert torch.allclose(matrix @ alone, problem.data.rhs, atol=1e-9)


def test_left_over_is_what_the_rows_do_not_explain() -> None:
    problem = planted("residuals", shapes=((5, 5), (4, 4)), shared=True).problem
    texels = torch.randn(problem.unknowns, 2, dtype=torch.float64, generator=torch.Generator().manual_seed(1))
    assert torch.allclose(problem.residuals(texels), problem.targets - dense_rows(problem) @ texels, atol=1e-12)


def test_a_problem_within_another_shares_its_equations_as_long_as_the_samples_are_the_same() -> None:
    whole = planted("within", shapes=((5, 5),)).problem
    kept = whole.kept.clone()
    kept[3:] = False
    inner = whole.within(kept, whole.roughness, None)
    assert inner.data is whole.data
    other = replace(inner, targets=2 * whole.targets)
    assert torch.equal(other.data.rhs, 2 * whole.data.rhs)
    lighter = replace(inner, weights=0.5 * whole.weights)
    assert torch.allclose(lighter.data.matrix, 0.5 * whole.data.matrix)
