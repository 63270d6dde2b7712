"""The parabolic map: round trips, the rim, the area element."""

import math

import pytest
import torch

from homofact.geometry.directions import draw_uniform, from_spherical
from homofact.geometry.parabolic import from_disc, to_disc


def test_round_trip_of_directions() -> None:
    wi, wo = draw_uniform(2000, torch.Generator().manual_seed(1))
    for w in (wi, wo):
        assert torch.allclose(from_disc(to_disc(w)), w, atol=1e-14, rtol=0)


def test_round_trip_of_points_and_unit_length() -> None:
    points = torch.rand(2000, 2, dtype=torch.float64, generator=torch.Generator().manual_seed(2)) * 1.4 - 0.7
    directions = from_disc(points)
    assert torch.allclose(directions.norm(dim=1), torch.ones(2000, dtype=torch.float64), atol=1e-15, rtol=0)
    assert torch.allclose(to_disc(directions), points, atol=1e-14, rtol=0)


def test_normal_is_the_centre_and_the_horizon_is_the_rim() -> None:
    assert to_disc(torch.tensor([0.0, 0.0, 1.0])).tolist() == [0, 0]
    phi = torch.linspace(0, 2 * math.pi, 17, dtype=torch.float64)
    rim = to_disc(from_spherical(torch.full_like(phi, math.pi / 2), phi))
    assert torch.allclose(rim.norm(dim=1), torch.ones_like(phi), atol=1e-12, rtol=0)


def test_radius_is_the_tangent_of_half_the_angle() -> None:
    theta = torch.linspace(0, 1.5, 20, dtype=torch.float64)
    disc = to_disc(from_spherical(theta, torch.zeros_like(theta)))
    assert torch.allclose(disc[:, 0], torch.tan(theta / 2), atol=1e-14, rtol=0)


def test_area_element_of_the_inverse_map() -> None:
    """dω = 4/(1 + s)² du dv."""
    point = torch.tensor([0.3, -0.5], dtype=torch.float64)
    jacobian = torch.autograd.functional.jacobian(from_disc, point)
    assert isinstance(jacobian, torch.Tensor)
    area = torch.linalg.cross(jacobian[:, 0], jacobian[:, 1]).norm()
    assert float(area) == pytest.approx(4 / (1 + 0.3**2 + 0.5**2) ** 2, abs=1e-14)
