"""What every linear solver of `linear.solvers.SOLVERS` must do, on every problem of `problems`.

A new solver is held to all of this by its name in the table, a new problem by its place in the catalogue.
"""

from dataclasses import replace

import pytest
import torch
from problems import CATALOGUE, SINGULAR, Problem, dense, dense_rows, planted
from torch import Tensor

from homofact.errors import Status
from homofact.linear.least_squares import LeastSquares
from homofact.linear.solvers import SOLVERS, solve

EVERY = pytest.mark.parametrize("solver", SOLVERS)
ALL_PROBLEMS = pytest.mark.parametrize("case", [*CATALOGUE, *SINGULAR], ids=lambda case: case.name)


def noisy(case: Problem, smoothing: float = 0.3) -> LeastSquares:
    """Targets that no texels meet, and smoothing."""
    noise = torch.randn(case.problem.targets.shape, dtype=torch.float64, generator=torch.Generator().manual_seed(5))
    return replace(case.problem, targets=case.problem.targets + noise, smoothing=smoothing)


def dense_minimum(problem: LeastSquares) -> Tensor:
    """Texels (T, C) by the definition: all rows written out, the shortest of the least squares."""
    rows = dense_rows(problem) * problem.weights.sqrt()[:, None]
    ridge = torch.eye(problem.unknowns, dtype=torch.float64) * problem.ridge**0.5
    stacked = torch.cat((rows, dense(problem.roughness.rows) * problem.penalty_scale**0.5, ridge))[:, problem.kept]
    right = torch.zeros(len(stacked), problem.targets.shape[1], dtype=torch.float64)
    right[: len(rows)] = problem.targets * problem.weights.sqrt()[:, None]
    result = torch.zeros(problem.unknowns, right.shape[1], dtype=torch.float64)
    result[problem.kept] = torch.linalg.lstsq(stacked, right, driver="gelsd").solution
    return result


@EVERY
@ALL_PROBLEMS
def test_planted_values_are_recovered(case: Problem, solver: str) -> None:
    solution = solve(case.problem, solver)
    counted = case.problem.weights > 0
    found = dense_rows(case.problem) @ solution.texels
    # The ridge moves texels that few samples read by this much.
    assert float((found - case.values)[counted].abs().max()) < 1e-4
    assert bool(torch.isfinite(solution.texels).all())
    assert solution.texels.shape == (case.problem.unknowns, case.values.shape[1])
    assert solution.iterations >= 0
    if not case.singular:
        assert solution.status in (Status.DIRECT, Status.CONVERGED)


@EVERY
@ALL_PROBLEMS
def test_what_no_sample_holds_stays_small(case: Problem, solver: str) -> None:
    """The ridge picks the smallest texels: none is far above what the samples ask for, and unread ones are 0."""
    texels = solve(case.problem, solver).texels
    shortest = dense_minimum(case.problem)
    assert float(texels.norm()) <= 1.001 * float(shortest.norm())
    unread = (dense_rows(case.problem)[case.problem.weights > 0] == 0).all(0)
    assert unread.any() or not case.singular or case.name == "the same texture twice"
    assert float(texels[unread].abs().sum()) < 1e-6


@EVERY
@pytest.mark.parametrize(
    "case", [planted("two textures", shapes=((5, 5), (4, 4))), *CATALOGUE[3:5], SINGULAR[0]], ids=lambda c: c.name
)
def test_it_finds_the_dense_minimum(case: Problem, solver: str) -> None:
    problem = noisy(case)
    found = solve(problem, solver).texels
    # The gauge (ridge) directions are the ill-conditioned part: compare what can be seen of the texels.
    assert float((dense_rows(problem) @ (found - dense_minimum(problem))).abs().max()) < 1e-6


@EVERY
def test_a_masked_texel_stays_zero(solver: str) -> None:
    case = planted("masked", smoothing=0.1)
    kept = case.problem.kept.clone()
    kept[3] = False
    texels = solve(replace(case.problem, kept=kept), solver).texels
    assert torch.equal(texels[3], torch.zeros(2, dtype=torch.float64))
    assert float(texels[kept].abs().min()) > 0


@EVERY
def test_channels_do_not_see_each_other_and_texels_scale_with_the_targets(solver: str) -> None:
    problem = noisy(planted("three channels", channels=3))
    whole = solve(problem, solver).texels
    for channel in range(3):
        alone = solve(replace(problem, targets=problem.targets[:, channel : channel + 1]), solver).texels
        assert torch.allclose(alone[:, 0], whole[:, channel], rtol=1e-6, atol=1e-9)
    assert torch.allclose(solve(replace(problem, targets=-3 * problem.targets), solver).texels, -3 * whole, rtol=1e-6)


@EVERY
def test_a_weight_of_two_is_a_sample_twice(solver: str) -> None:
    problem = noisy(planted("weights"))
    index = torch.cat((torch.arange(600), torch.arange(50)))
    repeated = replace(
        problem,
        coordinates=problem.coordinates[index],
        targets=problem.targets[index],
        weights=problem.weights[index],
    )
    weights = problem.weights.clone()
    weights[:50] *= 2
    one, other = solve(repeated, solver).texels, solve(replace(problem, weights=weights), solver).texels
    assert torch.allclose(one, other, rtol=1e-6, atol=1e-9)


@EVERY
def test_a_factor_on_the_weights_changes_nothing(solver: str) -> None:
    problem = noisy(planted("weights"))
    scaled = replace(problem, weights=problem.weights * 1e4)
    assert torch.allclose(solve(problem, solver).texels, solve(scaled, solver).texels, rtol=1e-6, atol=1e-8)


@EVERY
def test_the_gauge_is_the_smallest_texels(solver: str) -> None:
    """Two textures under one projection differ only by the gauge: the ridge shares the sum evenly."""
    case = SINGULAR[0]
    texels = solve(case.problem, solver).texels
    half = case.problem.unknowns // 2
    assert torch.allclose(texels[:half], texels[half:], atol=1e-4)
    assert torch.allclose(dense_rows(case.problem) @ texels, case.values, atol=1e-5)


@EVERY
def test_the_problem_is_left_alone_and_the_answer_is_the_same_again(solver: str) -> None:
    problem = noisy(planted("twice"))
    before = [x.clone() for x in (problem.coordinates, problem.targets, problem.weights, dense(problem.roughness.rows))]
    first, second = solve(problem, solver), solve(replace(problem), solver)
    assert torch.equal(first.texels, second.texels)
    assert (first.status, first.iterations) == (second.status, second.iterations)
    after = (problem.coordinates, problem.targets, problem.weights, dense(problem.roughness.rows))
    assert all(torch.equal(one, other) for one, other in zip(before, after, strict=True))
