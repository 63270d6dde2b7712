"""What is not every solver's own (`contracts/test_solvers.py`): names, and the way out of a semidefinite system."""

import torch
from problems import CATALOGUE
from refusals import refused

from homofact.errors import Status
from homofact.linear.solvers import solve, solve_definite


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
    with refused(where="solver", found="'gauss'"):
        solve(CATALOGUE[0].problem, "gauss")
