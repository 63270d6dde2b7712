"""Cube maps: where texels look, readings without seams, levels between levels."""

import itertools
import math

import pytest
import torch
from torch import Tensor

from homofact.geometry.directions import normalize
from homofact.rendering.cube import Cube, directions_of


def smooth(d: Tensor) -> Tensor:
    """A function of unit directions (..., 3), three numbers."""
    x, y, z = d.unbind(-1)
    return torch.stack((1 + x + 0.5 * y * z, 2 - z + x * y, torch.exp(y)), -1)


def random(count: int = 500, seed: int = 0) -> Tensor:
    return normalize(torch.randn(count, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(seed)))


def test_faces_and_texels_look_where_the_interfaces_say() -> None:
    """OpenGL ES 3.0, table 3.21: of a face's axis, s to the right, t downwards."""
    d = directions_of(2)
    expected = {
        (0, 0, 0): (1, 0.5, 0.5), (0, 1, 0): (1, -0.5, 0.5), (1, 0, 0): (-1, 0.5, -0.5), (2, 0, 0): (-0.5, 1, -0.5),
        (2, 1, 0): (-0.5, 1, 0.5), (3, 0, 1): (0.5, -1, 0.5), (4, 0, 1): (0.5, 0.5, 1), (5, 0, 0): (0.5, 0.5, -1),
        (5, 1, 1): (-0.5, -0.5, -1),
    }  # fmt: skip
    for place, direction in expected.items():
        whole = torch.tensor(direction, dtype=torch.float64)
        assert d[place].tolist() == pytest.approx((whole / whole.norm()).tolist())
    assert torch.allclose(directions_of(7).norm(dim=-1), torch.ones(1, dtype=torch.float64))


def test_texels_come_back_at_their_centres_whatever_the_length() -> None:
    levels = [torch.rand(6, side, side, 3, dtype=torch.float64) for side in (8, 4)]
    cube = Cube.of(levels)
    for level, texels in enumerate(levels):
        d = directions_of(texels.shape[1]).reshape(-1, 3)
        found = cube.read(
            d * torch.linspace(0.1, 9, len(d), dtype=torch.float64)[:, None], torch.full((len(d),), level)
        )
        assert torch.allclose(found, texels.reshape(-1, 3))


def test_between_levels_it_is_linear_and_beyond_them_the_last() -> None:
    levels = [smooth(directions_of(side)) + side for side in (8, 4, 2)]
    cube, d = Cube.of(levels), random()
    at = [cube.read(d, torch.full((len(d),), float(level))) for level in range(3)]
    for level, expected in (
        (0.25, at[0] * 0.75 + at[1] * 0.25),
        (1.5, (at[1] + at[2]) / 2),
        (-1.0, at[0]),
        (7.0, at[2]),
    ):
        assert torch.allclose(cube.read(d, torch.full((len(d),), level)), expected)


def test_a_smooth_sky_is_read_without_seams() -> None:
    """Beside every edge, and at the corners, the reading is the function, and the same on both sides."""
    cube = Cube.of([smooth(directions_of(32))])
    generator = torch.Generator().manual_seed(1)
    near = []
    for axis, first, second in itertools.product(range(3), (-1.0, 1.0), (-1.0, 1.0)):
        d = torch.rand(50, 3, dtype=torch.float64, generator=generator) * 2 - 1
        d[:, (axis + 1) % 3], d[:, (axis + 2) % 3] = first, second
        near.append(d)
    edge = torch.cat(near)
    zero = torch.zeros(len(edge), dtype=torch.float64)
    push = torch.rand(edge.shape, dtype=torch.float64, generator=generator) * 1e-7
    one, two = (cube.read(edge + sign * push, zero) for sign in (-1, 1))
    assert torch.allclose(one, two, atol=1e-5)
    assert torch.allclose(one, smooth(normalize(edge)), atol=1.5e-2)
    corners = torch.tensor(list(itertools.product((-1.0, 1.0), repeat=3)), dtype=torch.float64)
    assert torch.allclose(cube.read(corners, zero[:8]), smooth(normalize(corners)), atol=4e-2)
    off = (cube.read(random(), zero[:500]) - smooth(random())).abs().amax(1)
    assert float(off.quantile(0.9)) < 2e-3
    assert float(off.max()) < 1.5e-2


def test_beyond_a_corner_stands_the_mean_of_the_three() -> None:
    cube = Cube.of([torch.arange(6.0, dtype=torch.float64).reshape(6, 1, 1, 1).expand(6, 1, 1, 3)])
    corner = torch.tensor([[1.0, 1.0, 1.0]], dtype=torch.float64)
    # Of faces 0, 2 and 4, a quarter each of the face met first, of two edges' faces and of the mean.
    found = float(cube.read(corner, torch.zeros(1))[0, 0])
    assert found == pytest.approx((0 + 2 + 4 + 2) / 4)
    assert math.isfinite(found)
