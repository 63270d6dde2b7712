"""Bilinear tables and the marginal-conditional warp: laws, then closed forms."""

import math

import pytest
import torch
from torch import Tensor

from homofact.brdf.warp import MarginalConditional, bilinear


def uniform(count: int, seed: int = 0) -> Tensor:
    return torch.rand(count, 2, dtype=torch.float64, generator=torch.Generator().manual_seed(seed))


def densities(*shape: int, seed: int = 1) -> Tensor:
    return 0.1 + torch.rand(*shape, dtype=torch.float64, generator=torch.Generator().manual_seed(seed))


def alone(count: int) -> tuple[Tensor, Tensor]:
    return torch.zeros(count, 1, dtype=torch.long), torch.ones(count, 1, dtype=torch.float64)


def test_what_lies_beyond_the_last_node_is_read_there() -> None:
    table = torch.arange(15).double().reshape(3, 5)
    u = torch.tensor([[-1, 0.5], [0, 0], [1, 1], [2, 0.25], [0.5, 7]]).double()
    assert bilinear(table, u).tolist() == [5, 0, 14, 6.5, 12]


def test_what_is_no_number_reads_no_memory_beside_the_table() -> None:
    table = torch.arange(15).double().reshape(3, 5)
    found = bilinear(table, torch.tensor([[math.nan, 0.5], [0.5, math.nan]]).double())
    assert all(math.isnan(each) or 0 <= each <= 14 for each in found.tolist())


def test_a_table_that_is_bilinear_is_read_exactly() -> None:
    rows, columns = torch.linspace(0, 1, 4).double()[:, None], torch.linspace(0, 1, 7).double()
    table = torch.stack([2 + 3 * columns - rows + 5 * rows * columns, -rows * columns], -1)
    u = uniform(200)
    x, y = u[:, 0], u[:, 1]
    wanted = torch.stack([2 + 3 * x - y + 5 * x * y, -x * y], 1)
    assert torch.allclose(bilinear(table, u), wanted, atol=1e-14)
    chosen = torch.arange(200) % 2
    both = torch.stack([table, 10 * table])
    assert torch.allclose(bilinear(both, u, chosen), wanted * torch.where(chosen > 0, 10, 1)[:, None], atol=1e-13)
    pair, share = torch.tensor([[1, 0]]).expand(200, 2), u[:, :1]
    blended = bilinear(both.float(), u, pair, torch.cat((share, 1 - share), 1))
    assert torch.allclose(blended, wanted * (1 + 9 * share), atol=1e-5)
    assert blended.dtype == torch.float64


def test_equal_shares_of_density_become_equal_areas() -> None:
    # ds/du is the density, whatever the blend: differences across a step within a cell.
    warp = MarginalConditional.of(densities(3, 5, 6) * torch.tensor([1.0, 7.0, 0.2]).double()[:, None, None])
    u, step = uniform(500), 1e-5
    u = 1e-3 + u * (1 - 2e-3)
    slices = torch.tensor([[2, 0]]).expand(500, 2)
    share = uniform(500, seed=3)[:, :1]
    weights = torch.cat((share, 1 - share), 1)
    columns = []
    for axis in (0, 1):
        shift = step * torch.eye(2).double()[axis]
        columns.append((warp.invert(u + shift, slices, weights) - warp.invert(u - shift, slices, weights)) / (2 * step))
    jacobian = torch.stack(columns, -1)
    area = jacobian[:, 0, 0] * jacobian[:, 1, 1] - jacobian[:, 0, 1] * jacobian[:, 1, 0]
    density = sum(weights[:, k] * bilinear(warp.density, u, slices[:, k]) for k in range(2))
    # Steps across a node's kink are off by the step, not by rounding.
    assert float(((area / density - 1).abs() > 1e-4).double().mean()) < 0.01
    assert float((area / density - 1).abs().median()) < 1e-8


def test_every_density_integrates_to_one() -> None:
    warp = MarginalConditional.of(100 * densities(2, 4, 9))
    for k in range(2):
        half = torch.tensor([0.5, *[1.0] * 2, 0.5]).double() / 3, torch.tensor([0.5, *[1.0] * 7, 0.5]).double() / 8
        assert float(half[0] @ warp.density[k] @ half[1]) == pytest.approx(1, abs=1e-14)
    assert torch.allclose(warp.up[:, -1], torch.ones(2).double())


def test_a_linear_density_is_warped_to_squares() -> None:
    # p = 2x: s = (x², y). p = 2y: s = (x, y²).
    ramp = torch.linspace(0, 1, 3).double()
    u = uniform(100)
    across = MarginalConditional.of(ramp.expand(1, 4, 3)).invert(u, *alone(100))
    assert torch.allclose(across, torch.stack([u[:, 0] ** 2, u[:, 1]], 1), atol=1e-14)
    upward = MarginalConditional.of(ramp[:, None].expand(1, 3, 5)).invert(u, *alone(100))
    assert torch.allclose(upward, torch.stack([u[:, 0], u[:, 1] ** 2], 1), atol=1e-14)


def test_corners_stay_and_a_uniform_density_leaves_all_in_place() -> None:
    corners = torch.tensor([[0.0, 0], [1, 0], [0, 1], [1, 1]]).double()
    warp = MarginalConditional.of(densities(1, 6, 5))
    assert torch.allclose(warp.invert(corners, *alone(4)), corners, atol=1e-14)
    u = uniform(50)
    assert torch.allclose(MarginalConditional.of(torch.full((1, 3, 4), 9.0)).invert(u, *alone(50)), u, atol=1e-14)


def test_a_row_without_density_keeps_its_place() -> None:
    density = torch.ones(1, 4, 3).double()
    density[:, :2] = 0
    u = torch.tensor([[0.3, 0.1], [0.9, 0.0], [0.3, 1.0]]).double()
    found = MarginalConditional.of(density).invert(u, *alone(3))
    assert torch.allclose(found, torch.tensor([[0.3, 0.0], [0.9, 0.0], [0.3, 1.0]]).double(), atol=1e-14)
