"""Bilinear stencils: partition of unity, exactness on ramps, the texel convention."""

import torch
from hypothesis import given
from hypothesis import strategies as st

from homofact.linear.bilinear import lookup, stencil


@given(st.integers(1, 9), st.integers(1, 9), st.integers(0, 1000))
def test_weights_are_a_partition_of_unity_inside_the_texture(rows: int, columns: int, seed: int) -> None:
    uv = torch.rand(64, 2, dtype=torch.float64, generator=torch.Generator().manual_seed(seed)) * 3 - 1.5
    numbers, weights = stencil(uv, (rows, columns))
    assert torch.allclose(weights.sum(1), torch.ones(64, dtype=torch.float64))
    assert float(weights.min()) >= 0
    assert int(numbers.min()) >= 0
    assert int(numbers.max()) < rows * columns


def test_ramps_are_exact() -> None:
    v, u = torch.meshgrid(*[torch.linspace(-1, 1, n, dtype=torch.float64) for n in (5, 7)], indexing="ij")
    texture = torch.stack((2 * u - v + 0.5, u * v), -1)
    points = torch.rand(500, 2, dtype=torch.float64, generator=torch.Generator().manual_seed(1)) * 2 - 1
    found = lookup(texture, points)
    assert torch.allclose(found[:, 0], 2 * points[:, 0] - points[:, 1] + 0.5)
    assert torch.allclose(found[:, 1], points[:, 0] * points[:, 1])


def test_corners_are_texel_centres_and_outside_is_clamped() -> None:
    texture = torch.arange(12, dtype=torch.float64).reshape(3, 4, 1)
    points = torch.tensor([[-1, -1], [1, -1], [-1, 1], [1, 1], [5, 5], [-7, 0]], dtype=torch.float64)
    assert lookup(texture, points).flatten().tolist() == [0, 3, 8, 11, 11, 4]
