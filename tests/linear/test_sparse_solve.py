"""Systems too large for a dense matrix: the sparse solve against the dense one, its parts, what is refused first."""

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse
import torch
from problems import CATALOGUE

from homofact.errors import BadInput, SolverFailure, Status
from homofact.linear import size, solvers, sparse_solve
from homofact.linear.banded import BlockBanded
from homofact.linear.laplacian import laplacian
from homofact.linear.layout import CLAMPED, Axes, Axis, TexelLayout
from homofact.linear.least_squares import LeastSquares, Roughness
from homofact.linear.normal import Lookup

SOUND = [each for each in CATALOGUE if not each.singular and each.problem.unknowns > 20]


def sharing(side: int, axes: Axes = CLAMPED) -> LeastSquares:
    """Three textures on planes of one 3D space, two by two with a direction in common: what the search ends in."""
    generator = torch.Generator().manual_seed(4)
    x = torch.rand(6000, 3, dtype=torch.float64, generator=generator) * 2 - 1
    planes = [[[1.0, 0, 0], [0, 1, 0]], [[0, 1.0, 0], [0, 0, 1]], [[1.0, 0, 0], [0, 0.3, 0.7]]]
    kinds = (axes, CLAMPED, CLAMPED)
    lookups = tuple(
        Lookup(0, torch.tensor(rows, dtype=torch.float64), (side, side), j * side * side, axes=kinds[j])
        for j, rows in enumerate(planes)
    )
    targets = torch.stack((torch.sin(3 * x[:, 0]) * x[:, 1] + x[:, 2] ** 2, torch.exp(x[:, 0] * x[:, 2])), 1)
    layout = TexelLayout(((side, side),) * 3, kinds)
    weights = torch.rand(6000, dtype=torch.float64, generator=generator)
    kept = torch.ones(layout.unknowns, dtype=torch.bool)
    kept[5:9] = False
    masks = layout.split(kept)
    gauge = torch.linalg.qr(torch.stack([(layout.owners() == j) * kept.double() for j in (1, 2)], 1)).Q
    return LeastSquares(x, lookups, targets, weights, kept, Roughness.of(layout, masks), 1e-3, gauge)


@pytest.fixture
def all_sparse(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(size, "MOST_DENSE", 0)


@pytest.mark.parametrize("case", SOUND, ids=lambda case: case.name)
def test_the_sparse_answer_fits_as_the_dense_one_does(case, all_sparse: None, monkeypatch) -> None:
    monkeypatch.setattr(sparse_solve, "COARSE", case.problem.unknowns // 4)
    found = solvers.solve(case.problem)
    assert found.status is Status.CONVERGED
    assert found.iterations > 0
    difference = case.problem.residuals(found.texels) - (case.problem.targets - case.values)
    assert float(difference.abs().max()) < 1e-3 * float(case.values.abs().max())


@pytest.mark.parametrize("axes", [CLAMPED, (Axis.POLAR, Axis.PERIODIC), (Axis.PERIODIC, Axis.CLAMPED)])
def test_textures_that_take_over_from_each_other_end_where_the_dense_solve_does(axes: Axes, monkeypatch) -> None:
    problem = sharing(20, axes)
    exact = solvers.solve(problem)
    assert exact.status is Status.DIRECT
    monkeypatch.setattr(size, "MOST_DENSE", 0)
    monkeypatch.setattr(sparse_solve, "COARSE", 300)
    found, again = solvers.solve(problem), solvers.solve(problem)
    assert found.status is Status.CONVERGED
    assert float((found.texels - exact.texels).norm() / exact.texels.norm()) < 1e-2
    assert float((problem.residuals(found.texels) - problem.residuals(exact.texels)).abs().max()) < 3e-4
    assert bool((found.texels[~problem.kept] == 0).all())
    assert torch.equal(found.texels, again.texels)
    # Of the same order; the estimate is from below, up to what lies between the 1-norm and the 2-norm.
    assert exact.condition is not None
    assert found.condition is not None
    assert 0.02 * exact.condition < found.condition < 3 * exact.condition


def test_steps_that_run_out_are_said(all_sparse: None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sparse_solve, "MOST_STEPS", 3)
    found = solvers.solve(sharing(12))
    assert found.status is Status.BUDGET
    assert found.iterations == 3


def test_the_diagonal_needs_no_dense_matrix(monkeypatch: pytest.MonkeyPatch) -> None:
    for case in SOUND:
        dense = case.problem.diagonal
        monkeypatch.setattr(size, "MOST_DENSE", 0)
        assert torch.allclose(case.problem.diagonal, dense, rtol=1e-12)
        monkeypatch.undo()


def matrix_of(axes: Axes, side: int) -> scipy.sparse.csr_matrix:
    rows = laplacian(torch.ones(side, side, dtype=torch.bool), axes)
    return scipy.sparse.csr_matrix(rows.T @ rows + scipy.sparse.identity(side * side))


def test_a_block_within_its_band_is_factored_exactly() -> None:
    matrix = scipy.sparse.csr_matrix(scipy.sparse.block_diag([matrix_of(CLAMPED, 9), matrix_of(CLAMPED, 7)]))
    blocks, count = BlockBanded(matrix, [0, 81, 81, 130]), 130
    x = np.random.default_rng(0).normal(size=(count, 2))
    upper = scipy.linalg.cholesky(matrix.toarray())
    np.testing.assert_allclose(blocks.times(x), upper @ x, atol=1e-12)
    np.testing.assert_allclose(blocks.back(upper @ x), x, atol=1e-10)
    np.testing.assert_allclose(blocks.forth(upper.T @ x), x, atol=1e-10)
    np.testing.assert_allclose(blocks.solve(matrix @ x), x, atol=1e-10)


@pytest.mark.parametrize("axes", [(Axis.PERIODIC, Axis.CLAMPED), (Axis.PERIODIC, Axis.POLAR)])
def test_what_goes_round_is_near_the_block_and_definite(axes: Axes) -> None:
    matrix = matrix_of(axes, 16)
    blocks = BlockBanded(matrix, [0, 256])
    whole = np.linalg.eigvals(blocks.solve(matrix.toarray())).real
    # A diagonal that is larger by what is left out: never more than the block itself, and not by orders less.
    assert whole.max() < 1 + 1e-9
    assert whole.min() > 0.001


def test_a_block_that_is_not_definite_is_refused() -> None:
    with pytest.raises(SolverFailure, match="not positive definite: more smoothing or more samples"):
        BlockBanded(scipy.sparse.csr_matrix(-np.eye(3)), [0, 3])


def test_what_does_not_fit_is_refused_with_need_and_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(size, "memory_of_machine", lambda: 4 * 2**30)
    size.refuse_beyond_memory("size: found 16 it", 3 * 2**30, "expected smaller")
    with pytest.raises(BadInput, match=r"size: found 999 it needs about 5\.6 GB of memory, and 4\.0 GB are there; exp"):
        size.refuse_beyond_memory("size: found 999 it", 5 * 2**30, "expected smaller")
    monkeypatch.setattr(size, "memory_of_machine", lambda: None)
    size.refuse_beyond_memory("size: found 999 it", 1e18, "expected smaller")


def test_the_memory_of_this_machine_is_known_and_limits_count(monkeypatch, tmp_path) -> None:
    resource = pytest.importorskip("resource")
    whole = size.memory_of_machine()
    assert whole is not None
    assert whole > 2**28
    monkeypatch.setattr(size, "_CGROUP", tmp_path / "memory.max")
    (tmp_path / "memory.max").write_text("123456789\n")
    assert size.memory_of_machine() == 123456789
    (tmp_path / "memory.max").write_text("max\n")
    monkeypatch.setattr(resource, "getrlimit", lambda _: (2**29, 2**40))
    assert size.memory_of_machine() == 2**29
