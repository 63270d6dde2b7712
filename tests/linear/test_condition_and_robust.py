"""Condition estimates against the singular values, and Huber's weights against their definition."""

import math

import pytest
import torch

from homofact.linear.condition import condition_estimate, determined_share
from homofact.linear.robust import TUNING, huber_weights, scale_of


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


def test_huber_weights_by_their_definition() -> None:
    residuals = torch.tensor([[1.0], [-1.0], [1.0], [-1.0], [100.0]], dtype=torch.float64)
    weights = huber_weights(residuals)
    limit = TUNING * scale_of(residuals[:, 0])
    assert scale_of(residuals[:, 0]) == pytest.approx(1.4826)
    assert weights.tolist() == pytest.approx([1, 1, 1, 1, limit / 100])


def test_residuals_that_are_mostly_zero_change_nothing() -> None:
    assert huber_weights(torch.tensor([[0.0], [0.0], [0.0], [9.0]], dtype=torch.float64)).tolist() == [1, 1, 1, 1]
