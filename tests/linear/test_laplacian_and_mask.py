"""Null space of the smoothing rows, and masks that hold every reachable texel."""

import pytest
import torch
from problems import dense

from homofact.linear.bilinear import stencil
from homofact.linear.laplacian import laplacian
from homofact.linear.mask import covered


@pytest.mark.parametrize(("rows", "columns"), [(3, 3), (5, 8), (16, 16)])
def test_the_null_space_of_a_rectangle_is_1_x_y_xy(rows: int, columns: int) -> None:
    matrix = dense(laplacian(torch.ones(rows, columns, dtype=torch.bool)))
    y, x = torch.meshgrid(torch.arange(rows).double(), torch.arange(columns).double(), indexing="ij")
    for field in (torch.ones_like(x), x, y, x * y):
        assert float((matrix @ field.reshape(-1)).abs().max()) < 1e-12
    assert int(torch.linalg.matrix_rank(matrix)) == rows * columns - 4


def test_an_interior_row_is_the_5_point_stencil() -> None:
    row = dense(laplacian(torch.ones(3, 3, dtype=torch.bool)))[4].reshape(3, 3)
    assert row.tolist() == [[0, -1, 0], [-1, 4, -1], [0, -1, 0]]


def test_masked_texels_are_in_no_row_and_every_kept_texel_is_tied() -> None:
    mask = torch.tensor([[1, 1, 0, 0], [1, 1, 0, 1], [0, 0, 0, 1]], dtype=torch.bool)
    matrix = dense(laplacian(mask))
    outside = ~mask.reshape(-1)
    assert float(matrix[outside].abs().sum()) == 0
    assert float(matrix[:, outside].abs().sum()) == 0
    assert bool((matrix.abs().sum(0)[mask.reshape(-1)] > 0).all())


@pytest.mark.parametrize("seed", range(5))
def test_every_texel_that_a_point_inside_the_hull_reads_is_covered(seed: int) -> None:
    generator = torch.Generator().manual_seed(seed)
    corners = torch.rand(5, 2, dtype=torch.float64, generator=generator) * 2 - 1
    mask = covered(corners, (9, 12))
    shares = torch.rand(2000, 5, dtype=torch.float64, generator=generator).log()
    shares = shares / shares.sum(1, keepdim=True)
    numbers, weights = stencil(shares @ corners, (9, 12))
    assert bool(mask.reshape(-1)[numbers[weights > 0]].all())


def test_a_disc_leaves_the_corners_out_and_a_segment_is_covered() -> None:
    angle = torch.linspace(0, 6.2832, 60, dtype=torch.float64)
    mask = covered(torch.stack((angle.cos(), angle.sin()), 1), (16, 16))
    assert not bool(mask[0, 0] | mask[0, 15] | mask[15, 0] | mask[15, 15])
    assert bool(mask[8, 8])
    line = covered(torch.tensor([[-1.0, 0.0], [1.0, 0.0]], dtype=torch.float64), (1, 6))
    assert bool(line.all())


@pytest.mark.parametrize("seed", range(3))
def test_a_point_up_to_a_texel_beside_the_hull_reads_covered_texels(seed: int) -> None:
    """Rounding, or a sampler's own fractions, may put a point of the rim into the next cell."""
    generator = torch.Generator().manual_seed(seed)
    corners = torch.rand(4, 2, dtype=torch.float64, generator=generator) - 0.5
    shape = (16, 16)
    mask = covered(corners, shape).reshape(-1)
    shares = torch.rand(2000, 4, dtype=torch.float64, generator=generator).log()
    inside = (shares / shares.sum(1, keepdim=True)) @ corners
    aside = (torch.rand(2000, 2, dtype=torch.float64, generator=generator) * 2 - 1) * (2 / 15)
    numbers, _ = stencil(inside + aside, shape)
    assert bool(mask[numbers].all())
    # And not everything is covered.
    assert float(mask.double().mean()) < 0.7


def test_a_texel_without_a_row_is_tied_to_the_mean_of_its_neighbours() -> None:
    """A 2 x 2 texture has no three texels in a row: all are tied, and a constant costs nothing."""
    matrix = dense(laplacian(torch.ones(2, 2, dtype=torch.bool)))
    assert torch.equal(matrix.sum(1), torch.zeros(4, dtype=torch.float64))
    assert matrix[0].tolist() == [2, -1, -1, 0]
    assert int(torch.linalg.matrix_rank(matrix)) == 3
