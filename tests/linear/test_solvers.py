"""Every solver against every planted problem, and against the dense answer on noisy ones."""

from dataclasses import replace

import pytest
import torch
from problems import CATALOGUE, Problem, dense_rows, planted

from homofact.errors import BadInput, Status
from homofact.linear.least_squares import Roughness
from homofact.linear.solvers import SOLVERS, solve, solve_definite


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("case", CATALOGUE, ids=lambda case: case.name)
def test_solvers_recover_planted_values(case: Problem, solver: str) -> None:
    solution = solve(case.problem, solver)
    found = dense_rows(case.problem) @ solution.texels
    # The ridge moves texels that few samples read by this much.
    assert float((found - case.values).abs().max()) < 1e-4
    assert solution.status in (Status.DIRECT, Status.CONVERGED)


@pytest.mark.parametrize("solver", SOLVERS)
def test_solvers_agree_with_the_dense_minimum(solver: str) -> None:
    case = planted("noisy", shapes=((5, 5), (4, 4)), smoothing=0.3).problem
    noise = torch.randn(case.targets.shape, dtype=torch.float64, generator=torch.Generator().manual_seed(5))
    problem = replace(case, targets=case.targets + noise)
    rows = dense_rows(problem) * problem.weights.sqrt()[:, None]
    stacked = torch.cat(
        (
            rows,
            problem.roughness.rows * problem.penalty_scale**0.5,
            torch.eye(problem.unknowns, dtype=torch.float64) * problem.ridge**0.5,
        )
    )
    right = torch.zeros(stacked.shape[0], 2, dtype=torch.float64)
    right[: len(rows)] = problem.targets * problem.weights.sqrt()[:, None]
    expected = torch.linalg.lstsq(stacked, right, driver="gelsd").solution
    found = solve(problem, solver).texels
    # The gauge (ridge) directions are the ill-conditioned part: compare what can be seen of the texels.
    assert float((dense_rows(problem) @ (found - expected)).abs().max()) < 1e-6


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_masked_texel_stays_zero(solver: str) -> None:
    case = planted("masked").problem
    kept = case.kept.clone()
    kept[3] = False
    problem = replace(case, kept=kept, smoothing=0.1)
    texels = solve(problem, solver).texels
    assert torch.equal(texels[3], torch.zeros(2, dtype=torch.float64))
    assert float(texels[kept].abs().min()) > 0


def test_the_gauge_is_the_smallest_texels() -> None:
    """Two textures under one projection differ only by the gauge: the ridge shares the sum evenly."""
    case = planted("one", shapes=((4, 4),))
    lookup = case.problem.lookups[0]
    twice = replace(
        case.problem,
        lookups=(lookup, replace(lookup, offset=16)),
        kept=torch.ones(32, dtype=torch.bool),
        roughness=Roughness(torch.block_diag(case.problem.roughness.rows, case.problem.roughness.rows)),
    )
    texels = solve(twice, "cholesky").texels
    assert torch.allclose(texels[:16], texels[16:], atol=1e-4)
    assert torch.allclose(dense_rows(twice) @ texels, case.values, atol=1e-5)


def test_a_semidefinite_system_gets_the_minimum_norm_answer_and_says_so() -> None:
    generator = torch.Generator().manual_seed(0)
    factor = torch.randn(8, 5, dtype=torch.float64, generator=generator)
    matrix = factor @ factor.T
    rhs = matrix @ torch.randn(8, 2, dtype=torch.float64, generator=generator)
    matrix.diagonal().sub_(1e-15)
    solution, status = solve_definite(matrix, rhs)
    assert status is Status.FALLBACK
    assert torch.allclose(solution, torch.linalg.pinv(matrix, rcond=1e-10) @ rhs, atol=1e-8)
    assert solve_definite(matrix + torch.eye(8), rhs)[1] is Status.DIRECT


def test_an_unknown_solver_is_named() -> None:
    with pytest.raises(BadInput, match="solver: found 'gauss', expected one of cholesky, qr, lsmr, cg, qmr"):
        solve(CATALOGUE[0].problem, "gauss")
