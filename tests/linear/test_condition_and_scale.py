"""Condition estimates against the singular values, and the robust scale against the Gaussian's."""

import math

import pytest
import torch
from scipy.stats import norm

from homofact.linear.condition import condition_estimate, condition_of_factor, determined_share
from homofact.linear.definite import solve_lower
from homofact.linear.robust import scale_of


@pytest.mark.parametrize("decades", [0, 3, 8, 12])
def test_the_estimate_is_within_the_size_of_the_exact_condition(decades: int) -> None:
    generator = torch.Generator().manual_seed(decades)
    basis, _ = torch.linalg.qr(torch.randn(30, 30, dtype=torch.float64, generator=generator))
    matrix = basis @ torch.diag(torch.logspace(0, -decades, 30, dtype=torch.float64)) @ basis.T
    matrix = (matrix + matrix.T) / 2
    exact = float(torch.linalg.cond(matrix, 1))
    # LAPACK's estimate of the inverse's norm is from below, mostly exact.
    assert exact / 3 <= condition_estimate(matrix) <= exact * 1.1


def test_a_matrix_that_is_not_positive_definite_has_none() -> None:
    assert condition_estimate(torch.diag(torch.tensor([1.0, 1.0, -1e-3], dtype=torch.float64))) == math.inf
    assert condition_estimate(torch.zeros(3, 3, dtype=torch.float64)) == math.inf


def test_determined_counts_what_a_sample_in_the_middle_of_four_texels_gives_twice() -> None:
    diagonal = torch.tensor([0.0, 0.1, 0.13, 5.0], dtype=torch.float64)
    assert determined_share(diagonal, 1.0) == 0.5
    assert determined_share(diagonal * 7, 7.0) == 0.5


def gaussian(count: int, deviation: float) -> torch.Tensor:
    """Residuals (count, 1) that are distributed as a Gaussian as well as so many can be."""
    quantiles = norm.ppf((torch.arange(count).double() + 0.5).numpy() / count)
    return deviation * torch.from_numpy(quantiles)[:, None]


def test_the_scale_of_gaussian_residuals_is_their_deviation() -> None:
    assert scale_of(gaussian(20_001, 0.7)[:, 0]) == pytest.approx(0.7, rel=1e-3)


def test_a_factor_at_hand_gives_the_same_condition() -> None:
    rows = torch.randn(40, 30, dtype=torch.float64, generator=torch.Generator().manual_seed(3))
    matrix = rows.T @ rows
    factor = matrix.numpy().copy()
    assert solve_lower(factor, torch.ones(30, 1, dtype=torch.float64).numpy()) is not None
    found = condition_of_factor(factor, float(matrix.abs().sum(0).max()))
    assert found == pytest.approx(condition_estimate(matrix), rel=1e-9)
