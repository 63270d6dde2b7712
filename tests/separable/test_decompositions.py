"""Decompositions: planted matrices come back, nothing beats them, three ways give one answer, NMF only descends."""

import pytest
import torch
from torch import Tensor

from homofact.errors import BadInput
from homofact.separable.decompositions import DENSE_ROWS, eigen, imputed, normalized, power, svd
from homofact.separable.nmf import nmf


def random(*shape: int, seed: int = 0) -> Tensor:
    return torch.rand(*shape, dtype=torch.float64, generator=torch.Generator().manual_seed(seed))


def symmetric(n: int, seed: int = 0) -> Tensor:
    """A symmetric matrix with eigenvalues of both signs, well apart."""
    basis = torch.linalg.qr(random(n, n, seed=seed) - 0.5).Q
    values = torch.tensor([(-1.0) ** (k % 3) * 0.7**k for k in range(n)], dtype=torch.float64)
    matrix = (basis * values) @ basis.T
    return (matrix + matrix.T) / 2


def apart(found: Tensor, expected: Tensor) -> float:
    return float((found - expected).norm() / expected.norm())


def test_a_planted_rank_comes_back_exactly() -> None:
    plain = random(30, 3) @ random(20, 3, seed=1).T
    assert apart(svd(plain, 3).product(), plain) < 1e-12
    assert apart(svd(plain, 2).product(), plain) > 1e-3
    signed = random(30, 3) @ torch.diag(torch.tensor([1.0, -0.5, 0.2]).double()) @ random(30, 3).T
    signed = (signed + signed.T) / 2
    found = eigen(signed, 3)
    assert apart(found.product(), signed) < 1e-12
    assert found.right is None
    assert float(found.signs.min()) == -1
    assert apart(power(signed, 3, torch.Generator().manual_seed(2)).product(), signed) < 1e-7


@pytest.mark.parametrize("terms", [1, 2, 5])
def test_nothing_of_the_rank_is_nearer_than_the_svd(terms: int) -> None:
    matrix = symmetric(25) + 0.3
    best = torch.linalg.svdvals(matrix)[terms:].norm()
    for found in (svd(matrix, terms), eigen(matrix, terms)):
        error = (found.product() - matrix).norm()
        assert float(error) == pytest.approx(float(best), rel=1e-10)
        for seed in range(3):
            moved = found.left + 1e-2 * (random(*found.left.shape, seed=seed) - 0.5)
            other = moved if found.right is None else found.right
            assert float(((moved * found.signs) @ other.T - matrix).norm()) > float(error)


def test_power_iteration_equals_the_eigen_decomposition() -> None:
    matrix = symmetric(60)
    best, found = eigen(matrix, 8), power(matrix, 8, torch.Generator().manual_seed(0))
    assert found.converged
    assert found.iterations > 8
    assert torch.equal(found.signs, best.signs)
    assert apart(found.product(), best.product()) < 1e-6
    assert float(((found.left**2).sum(0) - (best.left**2).sum(0)).abs().max()) < 1e-6


def test_power_iteration_parts_eigenvalues_of_one_size_and_opposite_sign() -> None:
    basis = torch.linalg.qr(random(30, 30) - 0.5).Q
    values = torch.cat((torch.tensor([2.0, -2.0, 1.0, -1.0]), torch.linspace(-0.5, 0.5, 26))).double()
    matrix = (basis * values) @ basis.T
    found = power((matrix + matrix.T) / 2, 4, torch.Generator().manual_seed(0))
    assert found.converged
    assert sorted((found.signs * (found.left**2).sum(0)).tolist()) == pytest.approx([-2, -1, 1, 2], abs=1e-9)


def test_power_iteration_says_when_it_does_not_end() -> None:
    assert not power(symmetric(60), 3, torch.Generator().manual_seed(0), tolerance=1e-30, most=40).converged


def test_missing_entries_take_no_term_for_themselves() -> None:
    whole = random(40, 2) @ random(30, 2, seed=1).T
    valid = random(40, 30, seed=2) > 0.4
    spoiled = torch.where(valid, whole, 0.0)
    found = imputed(spoiled, valid, 2, rounds=300)
    assert torch.equal(found[valid], whole[valid])
    # Up to the largest valid entry, beyond which nothing is imputed.
    assert apart(found, whole) < 0.02
    assert apart(svd(spoiled, 2).product()[valid], whole[valid]) > 0.1
    assert imputed(whole, torch.ones(40, 30).bool(), 2) is whole


def test_power_iteration_stops_at_the_matrixs_own_rank() -> None:
    one = torch.outer(random(12), random(12))
    assert power(one, 4, torch.Generator().manual_seed(1)).left.shape[1] <= 2


def test_a_large_matrix_has_the_same_eigenvectors_as_a_small_one() -> None:
    n = DENSE_ROWS + 20
    small = random(n, 6) - 0.4
    matrix = (small * torch.tensor([9.0, -6.0, 4.0, 2.0, -1.0, 0.5]).double()) @ small.T
    matrix = (matrix + matrix.T) / 2
    found = eigen(matrix, 4)
    values = torch.linalg.eigvalsh(matrix)
    expected = values[values.abs().argsort(descending=True)[:4]]
    assert (found.signs * (found.left**2).sum(0)).tolist() == pytest.approx(expected.tolist(), rel=1e-9)


def test_the_normalized_term_is_exact_for_one_product_and_keeps_every_rows_sum() -> None:
    product = torch.outer(random(9), random(7, seed=1))
    assert apart(normalized(product).product(), product) < 1e-12
    matrix = random(9, 7)
    matrix[4] = 0
    found = normalized(matrix)
    assert torch.allclose(found.product().sum(1), matrix.sum(1))
    assert float(found.product().min()) >= 0
    assert float(normalized(torch.zeros(3, 3).double()).product().abs().max()) == 0


@pytest.mark.parametrize("weighted", [False, True])
def test_nmf_never_climbs_and_is_never_negative(weighted: bool) -> None:
    matrix = random(40, 30) ** 3
    weights = random(40, 30, seed=5) if weighted else None
    found = nmf(matrix, 4, weights, most=120, tolerance=0)
    assert all(b <= a * (1 + 1e-9) for a, b in zip(found.objectives, found.objectives[1:], strict=False))
    assert found.objectives[-1] < 0.9 * found.objectives[0]
    assert float(found.left.min()) >= 0
    assert float(found.right.min()) >= 0
    left = ((found.product() - matrix) ** 2 * (1 if weights is None else weights)).sum()
    assert float(left) == pytest.approx(found.objectives[-1], rel=1e-6)


def test_nmf_finds_planted_factors_and_does_not_look_where_the_weight_is_zero() -> None:
    matrix = random(30, 3) @ random(25, 3, seed=1).T
    assert apart(nmf(matrix, 3, most=5000, tolerance=1e-12).product(), matrix) < 1e-2
    weights = (random(30, 25, seed=2) > 0.2).double()
    spoiled = torch.where(weights > 0, matrix, 50.0)
    found = nmf(spoiled, 3, weights, most=5000, tolerance=1e-12)
    assert apart(found.product() * weights, matrix * weights) < 1e-2


@pytest.mark.filterwarnings("ignore:Maximum number of iterations")
def test_nmf_is_as_good_as_scikit_learns() -> None:
    decomposition = pytest.importorskip("sklearn.decomposition", reason="scikit-learn is not installed")
    matrix = random(60, 50) ** 2 + torch.outer(random(60), random(50, seed=3))
    theirs = decomposition.NMF(5, init="nndsvda", solver="mu", max_iter=2000, tol=1e-6, random_state=0)
    factor = torch.from_numpy(theirs.fit_transform(matrix.numpy()))
    objective = float(((factor @ torch.from_numpy(theirs.components_) - matrix) ** 2).sum())
    assert nmf(matrix, 5, most=2000, tolerance=1e-9).objectives[-1] == pytest.approx(objective, rel=0.01)


def test_bad_matrices_are_refused() -> None:
    with pytest.raises(BadInput, match=r"matrix: found .*not finite"):
        svd(torch.full((2, 2), float("nan")).double(), 1)
    for way in (eigen, lambda m, k: power(m, k, torch.Generator())):
        with pytest.raises(BadInput, match="not symmetric"):
            way(random(4, 4), 1)
        with pytest.raises(BadInput, match="not symmetric"):
            way(random(4, 3), 1)
    with pytest.raises(BadInput, match="no negative entry"):
        normalized(-random(3, 3))
    with pytest.raises(BadInput, match="matrix: found a negative entry"):
        nmf(-random(3, 3), 1)
    with pytest.raises(BadInput, match="weights: found a negative entry"):
        nmf(random(3, 3), 1, -random(3, 3))
    with pytest.raises(BadInput, match="weights: found shape"):
        nmf(random(3, 3), 1, random(3, 2))
    with pytest.raises(BadInput, match="terms: found 0"):
        nmf(random(3, 3), 0)
