"""The six metrics by their definitions, on numbers worked by hand."""

import math

import pytest
import torch

from homofact.brdf.log_transform import LogTransform
from homofact.evaluation.metrics import six_errors


def test_six_errors_by_hand() -> None:
    transform = LogTransform(0.1, torch.tensor([1.0, 2.0], dtype=torch.float64))
    found = torch.tensor([[0.0, 2.0], [0.9, 2.0]], dtype=torch.float64)
    expected = torch.tensor([[0.9, 2.0], [0.9, 3.8]], dtype=torch.float64)
    errors = six_errors(found, expected, transform)
    # Logarithms of f/A + 0.1: 0.1 against 1, and 1.1 against 2. An exact zero counts by ε, and stays finite.
    logs = [math.log(10), math.log(2 / 1.1)]
    assert errors.log_mse == pytest.approx((logs[0] ** 2 + logs[1] ** 2) / 4)
    assert errors.log_mae == pytest.approx(sum(logs) / 4)
    assert errors.log_max == pytest.approx(logs[0])
    assert errors.mse == pytest.approx((0.81 + 3.24) / 4)
    assert errors.mae == pytest.approx((0.9 + 1.8) / 4)
    assert errors.max == pytest.approx(1.8)
