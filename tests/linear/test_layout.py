"""Texel layouts, and what a periodic and a polar axis change: stencil, gradient, Laplacian, mask, fill."""

import pytest
import torch
from problems import dense
from torch import Tensor

from homofact.linear.bilinear import lookup, stencil
from homofact.linear.laplacian import laplacian
from homofact.linear.layout import CLAMPED, Axes, Axis, TexelLayout, texel_centres
from homofact.linear.mask import covered, filled, grown
from homofact.linear.normal import Lookup, accumulate_compiled, accumulate_torch, gradient, gradient_torch

ROUND: Axes = (Axis.PERIODIC, Axis.CLAMPED)
ACROSS: Axes = (Axis.CLAMPED, Axis.PERIODIC)
TORUS: Axes = (Axis.PERIODIC, Axis.PERIODIC)
POLAR: Axes = (Axis.PERIODIC, Axis.POLAR)


def random(*shape: int, seed: int = 0) -> Tensor:
    return torch.rand(*shape, dtype=torch.float64, generator=torch.Generator().manual_seed(seed)) * 2 - 1


def test_a_layout_splits_joins_and_spreads() -> None:
    layout = TexelLayout(((2, 3), (1, 4), (5, 1)))
    assert (layout.counts, layout.offsets, layout.unknowns) == ((6, 4, 5), (0, 6, 10), 15)
    texels = random(15, 2)
    textures = layout.split(texels)
    assert [tuple(texture.shape) for texture in textures] == [(2, 3, 2), (1, 4, 2), (5, 1, 2)]
    assert torch.equal(textures[1][0, 0], texels[6])
    assert torch.equal(layout.join(textures), texels)
    assert layout.owners().tolist() == [0] * 6 + [1] * 4 + [2] * 5
    assert layout.spread(torch.tensor([0.5, 2.0, 7.0])).tolist() == [0.5] * 6 + [2.0] * 4 + [7.0] * 5
    assert layout.axes == (CLAMPED,) * 3


@pytest.mark.parametrize("axis", list(Axis))
@pytest.mark.parametrize("count", [1, 2, 5])
def test_a_texel_reads_itself_at_its_centre(axis: Axis, count: int) -> None:
    centres = texel_centres(count, axis)
    uv = torch.stack((centres, torch.zeros_like(centres)), 1)
    numbers, weights = stencil(uv, (1, count), axes=(Axis.CLAMPED, axis))
    own = (weights * (numbers == torch.arange(count)[:, None])).sum(1)
    assert torch.allclose(own, torch.ones(count, dtype=torch.float64))


def test_a_periodic_axis_goes_round_and_the_other_is_clamped() -> None:
    texture = torch.tensor([[0.0, 8.0, 4.0, 2.0]], dtype=torch.float64)[..., None]
    u = torch.tensor([-1.0, -0.5, 0.0, 0.5, 1.0, 0.75, 1.25, -1.25, 3.0], dtype=torch.float64)
    found = lookup(texture, torch.stack((u, torch.zeros_like(u)), 1), ACROSS)
    # Texel k is at −1 + 2k/4; halfway from the last to the first lies 0.75, and −1.25 is the same place.
    assert found.flatten().tolist() == [0, 8, 4, 2, 0, 1, 4, 1, 0]
    field = random(5, 4, 1)
    points = random(400, 2, seed=1) * 3
    turned = points + torch.tensor([0.0, 2.0])
    assert torch.allclose(lookup(field, points, ROUND), lookup(field, turned, ROUND))
    assert not torch.allclose(lookup(field, points), lookup(field, turned))
    clamped = points.clone()
    clamped[:, 0].clamp_(-1, 1)
    assert torch.allclose(lookup(field, points, ROUND), lookup(field, clamped, ROUND))


@pytest.mark.parametrize("axes", [ROUND, ACROSS, TORUS])
def test_turning_by_a_texel_rolls_the_texture(axes: Axes) -> None:
    field, points = random(6, 5, 2), random(300, 2, seed=2)
    for dimension, axis in enumerate(axes):
        if axis is Axis.PERIODIC:
            step = torch.zeros(2, dtype=torch.float64)
            step[1 - dimension] = 2 / field.shape[dimension]
            rolled = lookup(field.roll(1, dimension), points + step, axes)
            assert torch.allclose(rolled, lookup(field, points, axes))


@pytest.mark.parametrize("fractions", [0, 8])
@pytest.mark.parametrize("axes", [ROUND, ACROSS, TORUS, POLAR])
def test_the_compiled_path_is_the_torch_path(axes: Axes, fractions: int) -> None:
    x = random(500, 3) * 1.4
    lookups = (
        Lookup(0, torch.eye(2, 3, dtype=torch.float64), (5, 4), 0, fractions, axes),
        Lookup(0, torch.eye(3, dtype=torch.float64)[1:] * 0.9, (3, 6), 20, fractions),
    )
    targets, weights = random(500, 2, seed=3), random(500, seed=4).abs()
    one, other = (each(x, lookups, targets, weights, 38) for each in (accumulate_compiled, accumulate_torch))
    assert torch.allclose(one.matrix, other.matrix, atol=1e-12)
    assert torch.allclose(one.rhs, other.rhs, atol=1e-12)


@pytest.mark.parametrize("axes", [ROUND, ACROSS, TORUS])
def test_the_gradient_is_the_slope(axes: Axes) -> None:
    x, texels = random(400, 2) * 1.3, random(20, 2, seed=5)
    targets, weights = random(400, 2, seed=3), random(400, seed=4).abs()
    matrix = random(2, 2, seed=9)

    def lookups(moved: Tensor) -> tuple[Lookup, ...]:
        return (Lookup(0, moved, (5, 4), 0, axes=axes),)

    found, squares = gradient(x, lookups(matrix), targets, weights, texels)
    by_torch, same = gradient_torch(x, lookups(matrix), targets, weights, texels)
    assert squares == pytest.approx(same, rel=1e-12)
    assert torch.allclose(found, by_torch, atol=1e-9)
    step = 1e-7 * random(2, 2, seed=11)
    ends = [gradient(x, lookups(matrix + sign * step), targets, weights, texels)[1] for sign in (1, -1)]
    assert ends[0] - ends[1] == pytest.approx(2 * float((found[0, :, :2] * step).sum()), rel=1e-4)


@pytest.mark.parametrize(
    ("axes", "free"),
    [(CLAMPED, "1xyw"), (ROUND, "1x"), (ACROSS, "1y"), (TORUS, "1"), (POLAR, "1x")],
)
def test_what_smoothing_does_not_see(axes: Axes, free: str) -> None:
    rows, columns = 6, 5
    y, x = torch.meshgrid(torch.arange(rows).double(), torch.arange(columns).double(), indexing="ij")
    fields = {"1": torch.ones_like(x), "x": x, "y": y, "w": x * y}
    matrix = dense(laplacian(torch.ones(rows, columns, dtype=torch.bool), axes))
    for name, field in fields.items():
        assert (float((matrix @ field.reshape(-1)).abs().max()) < 1e-12) == (name in free)
    assert int(torch.linalg.matrix_rank(matrix)) == rows * columns - len(free)


def test_a_periodic_laplacian_turns_with_the_texture() -> None:
    mask = torch.ones(4, 5, dtype=torch.bool)
    matrix, field = dense(laplacian(mask, TORUS)), random(4, 5)
    for dimension in (0, 1):
        smoothed = (matrix @ field.reshape(-1)).reshape(4, 5)
        rolled = (matrix @ field.roll(2, dimension).reshape(-1)).reshape(4, 5)
        assert torch.allclose(rolled, smoothed.roll(2, dimension))


def test_a_pole_is_one_place() -> None:
    matrix = dense(laplacian(torch.ones(6, 5, dtype=torch.bool), POLAR))
    line = torch.arange(6) * 5
    own = matrix[line][:, line]
    assert torch.equal(own, 6 * torch.eye(6, dtype=torch.float64) - 1)
    assert float(matrix[line].sum(1).abs().max()) == 0


def test_masks_grow_round_and_across_a_pole() -> None:
    mask = torch.zeros(6, 7, dtype=torch.bool)
    mask[0, 4] = True
    assert int(grown(mask, 1).sum()) == 6
    turned = grown(mask, 1, ROUND)
    assert int(turned.sum()) == 9
    assert bool(turned[5, 3:6].all())
    near = torch.zeros(6, 7, dtype=torch.bool)
    near[2, 1] = True
    assert bool(grown(near, 1, POLAR)[:, 0].all())
    assert not bool(grown(near, 1, ROUND)[:, 0].all())
    assert torch.equal(grown(mask, 2, ROUND).roll(3, 0), grown(mask.roll(3, 0), 2, ROUND))


def test_texels_are_filled_from_the_nearest_round_the_circle() -> None:
    texture = torch.arange(8, dtype=torch.float64).reshape(8, 1, 1)
    mask = torch.zeros(8, 1, dtype=torch.bool)
    mask[1] = mask[4] = True
    assert filled(texture, mask).flatten().tolist() == [1, 1, 1, 4, 4, 4, 4, 4]
    assert filled(texture, mask, ROUND).flatten().tolist() == [1, 1, 1, 4, 4, 4, 4, 1]


@pytest.mark.parametrize("axes", [ROUND, ACROSS, POLAR])
def test_every_texel_that_a_point_of_the_hull_reads_is_covered_round_the_circle(axes: Axes) -> None:
    corners = torch.tensor([[0.4, 0.2], [1.0, 0.3], [0.9, 1.0], [0.5, 0.8]], dtype=torch.float64)
    mask = covered(corners, (9, 12), axes)
    shares = random(2000, 4).abs()
    points = (shares / shares.sum(1, keepdim=True)) @ corners
    numbers, weights = stencil(points, (9, 12), axes=axes)
    assert bool(mask.reshape(-1)[numbers[weights > 0]].all())
    assert not bool(mask.all())
