"""Angles, the half/difference frame, and the densities of the drawn directions."""

import math

import pytest
import torch
from torch import Tensor

from homofact.geometry.directions import (
    draw_cosine_weighted,
    draw_in_discs,
    draw_uniform,
    from_half_difference,
    from_spherical,
    grid_of_pairs,
    half_difference,
    normalize,
    to_spherical,
)
from homofact.geometry.parabolic import to_disc

N = 20_000


def pairs(seed: int = 0, count: int = 2000) -> tuple[Tensor, Tensor]:
    return draw_uniform(count, torch.Generator().manual_seed(seed))


def test_spherical_round_trip() -> None:
    wi, _ = pairs()
    assert torch.allclose(from_spherical(*to_spherical(wi)), wi, atol=1e-15, rtol=0)


@pytest.mark.parametrize("theta", [0.0, 1e-12, 1e-9, 1e-5])
def test_small_angles_keep_their_digits(theta: float) -> None:
    w = from_spherical(torch.tensor(theta, dtype=torch.float64), torch.tensor(1.0, dtype=torch.float64))
    assert float(to_spherical(w)[0]) == pytest.approx(theta, rel=1e-14)


def test_the_zero_vector_becomes_the_normal() -> None:
    assert normalize(torch.zeros(2, 3)).tolist() == [[0, 0, 1], [0, 0, 1]]
    # A short vector still has its direction.
    short = torch.tensor([[3e-9, 0.0, 4e-9]], dtype=torch.float64)
    assert normalize(short)[0].tolist() == pytest.approx([0.6, 0, 0.8], abs=1e-15)


def test_half_difference_round_trip() -> None:
    wi, wo = pairs()
    back_i, back_o = from_half_difference(*half_difference(wi, wo))
    assert torch.allclose(back_i, wi, atol=1e-12, rtol=0)
    assert torch.allclose(back_o, wo, atol=1e-12, rtol=0)


def test_half_and_difference_are_unit_and_share_the_angle() -> None:
    wi, wo = pairs()
    h, d = half_difference(wi, wo)
    one = torch.ones(len(wi), dtype=torch.float64)
    assert torch.allclose(h.norm(dim=1), one, atol=1e-14, rtol=0)
    assert torch.allclose(d.norm(dim=1), one, atol=1e-12, rtol=0)
    assert torch.allclose(d[:, 2], (h * wo).sum(1), atol=1e-13, rtol=0)


def test_swapping_mirrors_the_difference() -> None:
    wi, wo = pairs()
    h, d = half_difference(wi, wo)
    swapped_h, swapped_d = half_difference(wo, wi)
    assert torch.allclose(swapped_h, h, atol=1e-15, rtol=0)
    assert torch.allclose(swapped_d, d * torch.tensor([-1.0, -1.0, 1.0]), atol=1e-12, rtol=0)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_half_vector_along_the_tangent_stays_finite_and_invertible(side: float) -> None:
    wi = torch.tensor([[side, 0, 0], [side * 0.8, 0.6, 0]], dtype=torch.float64)
    wo = torch.tensor([[side, 0, 0], [side * 0.8, -0.6, 0]], dtype=torch.float64)
    h, d = half_difference(wi, wo)
    assert torch.allclose(h, torch.tensor([side, 0, 0], dtype=torch.float64).expand(2, 3))
    back_i, back_o = from_half_difference(h, d)
    assert torch.allclose(back_i, wi, atol=1e-12, rtol=0)
    assert torch.allclose(back_o, wo, atol=1e-12, rtol=0)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_difference_is_continuous_as_the_half_vector_sinks_to_the_tangent(side: float) -> None:
    d = from_spherical(torch.tensor([0.8], dtype=torch.float64), torch.tensor([2.5], dtype=torch.float64))
    flat = torch.tensor([[side, 0.0, 0.0]], dtype=torch.float64)
    raised = torch.tensor([[side * math.cos(1e-7), 0.0, math.sin(1e-7)]], dtype=torch.float64)
    for there, near in zip(from_half_difference(flat, d), from_half_difference(raised, d), strict=True):
        assert torch.allclose(there, near, atol=1e-6, rtol=0)


def test_difference_at_the_normal_is_the_incident_direction() -> None:
    # With h = n the frame is the surface's own.
    wi = from_spherical(torch.tensor([0.7], dtype=torch.float64), torch.tensor([0.4], dtype=torch.float64))
    wo = wi * torch.tensor([-1.0, -1.0, 1.0])
    h, d = half_difference(wi, wo)
    assert torch.allclose(h, torch.tensor([[0.0, 0.0, 1.0]], dtype=torch.float64), atol=1e-15)
    assert torch.allclose(d, wi, atol=1e-15, rtol=0)


def test_discs_are_filled_uniformly_up_to_the_radius() -> None:
    for w in draw_in_discs(N, torch.Generator().manual_seed(3), 0.5):
        squared = (to_disc(w) ** 2).sum(1)
        assert float(squared.max()) < 0.5
        # Uniform in area: r² is uniform, mean 0.25 with a standard error of 0.001.
        assert abs(float(squared.mean()) - 0.25) < 0.005
        assert float(to_disc(w).mean(0).abs().max()) < 0.01


@pytest.mark.parametrize(("draw", "mean"), [(draw_cosine_weighted, 2 / 3), (draw_uniform, 1 / 2)])
def test_mean_cosine_of_the_densities(draw, mean: float) -> None:
    wi, wo = draw(N, torch.Generator().manual_seed(4))
    for w in (wi, wo):
        assert abs(float(w[:, 2].mean()) - mean) < 0.01
        assert torch.allclose(w.norm(dim=1), torch.ones(N, dtype=torch.float64), atol=1e-12, rtol=0)
    assert not torch.equal(wi, wo)
    assert torch.equal(draw(N, torch.Generator().manual_seed(4))[0], wi)


def test_grid_is_all_pairs_of_the_cells_in_the_disc() -> None:
    wi, wo = grid_of_pairs(4)
    # Of 16 cells the four corners, at (¾, ¾), lie outside.
    assert len(wi) == 144
    assert len(torch.unique(torch.cat((wi, wo), 1), dim=0)) == 144
    assert float(torch.minimum(wi[:, 2], wo[:, 2]).min()) > 0
    assert math.isclose(float(to_disc(wi).sum()), 0, abs_tol=1e-10)
