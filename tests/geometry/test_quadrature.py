"""Nodes over the hemisphere: exact for what is smooth, fine where a mirror or the way back is sharp."""

import math

import pytest
import torch
from torch import Tensor

from homofact.geometry.directions import from_spherical
from homofact.geometry.quadrature import disc_nodes, hemisphere_nodes


def direction(degrees: float, azimuth: float = 0.3) -> Tensor:
    theta = torch.tensor([math.radians(degrees)], dtype=torch.float64)
    return from_spherical(theta, torch.full_like(theta, azimuth))


@pytest.mark.parametrize("degrees", [0.0, 5.0, 45.0, 75.0, 89.0])
def test_smooth_integrals(degrees: float) -> None:
    nodes, weights = hemisphere_nodes(direction(degrees))
    x, y, z = nodes.unbind(-1)
    assert float(z.min()) > 0
    assert float((nodes.norm(dim=-1) - 1).abs().max()) < 1e-12
    assert float(weights.sum()) == pytest.approx(2 * math.pi, rel=2e-3)
    assert float((weights * z).sum()) == pytest.approx(math.pi, rel=2e-5)
    assert float((weights * x**2 * z).sum()) == pytest.approx(math.pi / 4, rel=1e-4)
    assert float((weights * (x - y) * z).sum()) == pytest.approx(0, abs=1e-4)


@pytest.mark.parametrize("towards", [1, -1], ids=["back", "mirror"])
@pytest.mark.parametrize("degrees", [5.0, 40.0, 70.0])
@pytest.mark.parametrize("sharpness", [30.0, 1e3, 1e6])
def test_a_peak_round_the_mirror_direction_and_round_the_way_back(
    degrees: float, sharpness: float, towards: int
) -> None:
    # ∫ exp(κ (cosγ − 1)) dω over the sphere is 2π (1 − exp(−2κ))/κ; the peak stays above the horizon.
    fixed = direction(degrees)
    nodes, weights = hemisphere_nodes(fixed)
    centre = fixed * fixed.new_tensor([towards, towards, 1])
    squared = ((nodes - centre[:, None]) ** 2).sum(-1)
    found = float((weights * torch.exp(-sharpness / 2 * squared)).sum())
    if sharpness > 100 or degrees < 10:
        assert found == pytest.approx(2 * math.pi / sharpness, rel=2e-3)


def test_each_direction_has_its_own_nodes() -> None:
    both = torch.cat((direction(20.0), direction(60.0, -2.0)))
    nodes, weights = hemisphere_nodes(both, 8, 6)
    assert nodes.shape == (2, 96, 3)
    for k in range(2):
        alone = hemisphere_nodes(both[k : k + 1], 8, 6)
        assert torch.equal(nodes[k], alone[0][0])
        assert torch.equal(weights[k], alone[1][0])


def test_nodes_of_the_disc() -> None:
    theta, weights = disc_nodes(6)
    assert float(weights.sum()) == pytest.approx(1)
    # The mean of cos²θ over directions by cosine is ½, that of cos⁴θ ⅓.
    assert float((weights * torch.cos(theta) ** 2).sum()) == pytest.approx(1 / 2)
    assert float((weights * torch.cos(theta) ** 4).sum()) == pytest.approx(1 / 3)
