"""The compiled and the torch accumulation against each other and against the dense product."""

from dataclasses import replace

import numba
import pytest
import torch
from problems import CATALOGUE, Problem, dense_rows, planted

from homofact.linear import normal
from homofact.linear.normal import accumulate_compiled, accumulate_torch, gradient, warm_up


@pytest.mark.parametrize("case", CATALOGUE, ids=lambda case: case.name)
@pytest.mark.parametrize("path", [accumulate_compiled, accumulate_torch])
def test_both_paths_equal_the_dense_product(case: Problem, path) -> None:
    problem = case.problem
    rows = dense_rows(problem)
    weighted = rows * problem.weights[:, None]
    found = path(problem.coordinates, problem.lookups, problem.targets, problem.weights, problem.unknowns)
    assert torch.allclose(found.matrix, weighted.T @ rows, rtol=1e-10, atol=1e-10)
    assert torch.allclose(found.rhs, weighted.T @ problem.targets, rtol=1e-10, atol=1e-10)
    assert torch.allclose(found.energy, (problem.weights[:, None] * problem.targets**2).sum(0), rtol=1e-12)


@pytest.mark.parametrize("order", [(0, 1, 2, 3, 4, 5), (4, 5, 0, 1, 2, 3), (5, 0, 3, 1, 4, 2)])
def test_lookups_of_several_textures_may_come_in_any_order(order: tuple[int, ...]) -> None:
    problem = planted("three", samples=300, shapes=((3, 4), (2, 2), (4, 3)), shared=True).problem
    assert len(problem.lookups) == 6
    problem = replace(problem, lookups=tuple(problem.lookups[k] for k in order))
    rows = dense_rows(problem)
    arguments = (problem.coordinates, problem.lookups, problem.targets, problem.weights, problem.unknowns)
    found = accumulate_compiled(*arguments)
    assert torch.allclose(found.matrix, (rows * problem.weights[:, None]).T @ rows, rtol=1e-10, atol=1e-10)


def test_paths_agree_to_1e_10_over_threads_and_chunks() -> None:
    problem = planted("large", samples=20_000, shapes=((8, 8), (6, 6)), shared=True).problem
    arguments = (problem.coordinates, problem.lookups, problem.targets, problem.weights, problem.unknowns)
    threaded = accumulate_compiled(*arguments)
    chunked = accumulate_torch(*arguments, chunk=777)
    threads = numba.get_num_threads()
    try:
        numba.set_num_threads(1)
        alone = accumulate_compiled(*arguments)
        again = accumulate_compiled(*arguments)
    finally:
        numba.set_num_threads(threads)
    scale = float(alone.matrix.abs().max())
    for other in (threaded, chunked):
        assert float((alone.matrix - other.matrix).abs().max()) <= 1e-10 * scale
        assert float((alone.rhs - other.rhs).abs().max()) <= 1e-10 * float(alone.rhs.abs().max())
    assert torch.equal(alone.matrix, again.matrix)


def test_the_quadratic_form_gives_the_mean_error() -> None:
    problem = planted("error", shapes=((5, 5), (4, 4))).problem
    texels = torch.randn(problem.unknowns, 2, dtype=torch.float64, generator=torch.Generator().manual_seed(2))
    difference = problem.targets - dense_rows(problem) @ texels
    expected = float((problem.weights[:, None] * difference**2).sum() / problem.weights.sum()) / 2
    assert problem.data.error(texels) == pytest.approx(expected, rel=1e-11)
    assert problem.mean_error(texels) == pytest.approx(expected, rel=1e-12)


def test_warming_up_compiles_what_a_fit_calls() -> None:
    warm_up()
    compiled = [len(kernel.signatures) for kernel in (normal._accumulate, normal._gradient)]
    problem = planted("after", samples=50).problem
    accumulate_compiled(problem.coordinates, problem.lookups, problem.targets, problem.weights, problem.unknowns)
    gradient(
        problem.coordinates,
        problem.lookups,
        problem.targets,
        problem.weights,
        torch.zeros(problem.unknowns, 2).double(),
    )
    assert [len(kernel.signatures) for kernel in (normal._accumulate, normal._gradient)] == compiled
