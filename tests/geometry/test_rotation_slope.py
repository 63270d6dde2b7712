"""Slopes of a rotation's rows by its quaternions, against automatic differentiation."""

import pytest
import torch

from homofact.factor.projection import bound_slopes, row_bounds
from homofact.geometry.rotation import Rotation
from homofact.geometry.rotation_slope import rows_with_slope


@pytest.mark.parametrize("count", [8, 4])
def test_rows_and_slopes_are_those_of_the_rotation(count: int) -> None:
    numbers = torch.randn(count, dtype=torch.float64, generator=torch.Generator().manual_seed(count)) * 1.7
    weights = torch.randn(2, 4 if count == 8 else 3, dtype=torch.float64, generator=torch.Generator().manual_seed(9))
    free = numbers.clone().requires_grad_()
    expected = Rotation.of_numbers(free).matrix().T[:2]
    rows, pulled_back = rows_with_slope(numbers.numpy())
    assert torch.allclose(torch.from_numpy(rows), expected.detach(), atol=1e-14)
    (slope,) = torch.autograd.grad((expected * weights).sum(), free)
    assert torch.allclose(torch.from_numpy(pulled_back(weights.numpy())), slope, atol=1e-13)


@pytest.mark.parametrize(("domain", "bound", "size"), [("discs", "disc", 4), ("discs", "cube", 4), ("box", "disc", 3)])
def test_scaling_to_the_bound_is_differentiated(domain: str, bound: str, size: int) -> None:
    rows = torch.randn(2, size, dtype=torch.float64, generator=torch.Generator().manual_seed(1)).requires_grad_()
    weights = torch.randn(2, size, dtype=torch.float64, generator=torch.Generator().manual_seed(2))
    ((rows / row_bounds(rows, domain, bound)[:, None]) * weights).sum().backward()
    assert rows.grad is not None
    found = bound_slopes(rows.detach().numpy(), weights.numpy(), domain, bound)
    assert torch.allclose(torch.from_numpy(found), rows.grad, atol=1e-13)
