"""Tables over angles: multilinear between nodes, held at the ends, round the circle; their weights."""

import math

import pytest
import torch
from refusals import refused

from homofact.brdf.table import AngleTable, TableAxis, ring_weights
from homofact.geometry.directions import from_spherical

T = torch.tensor([0.2, 0.6, 1.2], dtype=torch.float64)
P = torch.arange(8, dtype=torch.float64) * (math.pi / 4)


def directions(theta: list[float], phi: list[float]) -> torch.Tensor:
    return from_spherical(torch.tensor(theta, dtype=torch.float64), torch.tensor(phi, dtype=torch.float64))


def isotropic() -> AngleTable:
    delta = torch.tensor([0.5, 2.5], dtype=torch.float64)
    values = 1 + T[:, None, None] * 2 + T[:2, None] * 3 + delta * 5
    return AngleTable(
        (TableAxis(T), TableAxis(T[:2]), TableAxis(delta)), values[..., None].expand(3, 2, 2, 2), ("a", "b")
    )


def test_linear_functions_are_met_exactly() -> None:
    wi, wo = directions([0.3, 1.0], [1.0, -0.4]), directions([0.5, 0.25], [1.0 - 0.7, 1.6])
    found = isotropic().evaluate(wi, wo)
    assert found[:, 1].tolist() == pytest.approx([1 + 0.6 + 1.5 + 3.5, 1 + 2 + 0.75 + 10])


def test_ends_are_held() -> None:
    wi, wo = directions([0.0, 1.5], [0.0, 0.0]), directions([1.4, 0.1], [0.0, math.pi])
    assert isotropic().evaluate(wi, wo)[:, 0].tolist() == pytest.approx([1 + 0.4 + 1.8 + 2.5, 1 + 2.4 + 0.6 + 12.5])


def test_azimuth_closes_its_circle() -> None:
    values = torch.cos(P)[None, :, None, None, None] + 2 * torch.sin(P)[:, None]
    table = AngleTable(
        (TableAxis(T[:1]), TableAxis(P, True), TableAxis(T[:1]), TableAxis(P, True)),
        values[..., None].squeeze(-1),
        ("Y",),
    )
    wi = directions([0.3, 0.3, 0.3], [math.pi / 4, -math.pi / 4, 2 * math.pi - math.pi / 8])
    wo = directions([0.3, 0.3, 0.3], [0.0, -math.pi / 2, -3 * math.pi / 8])
    mean = (1 + math.sqrt(0.5)) / 2
    expected = [math.sqrt(0.5), math.sqrt(0.5) - 2, mean - 2 * mean]
    assert table.evaluate(wi, wo)[:, 0].tolist() == pytest.approx(expected)
    assert not table.isotropic


def test_states_its_cost() -> None:
    table = isotropic()
    assert (table.nbytes, table.fetches, table.isotropic) == (8 * 24, 8, True)


def test_shapes_are_checked() -> None:
    with refused(where="table"):
        AngleTable((TableAxis(T), TableAxis(T)), torch.zeros(2, 2), ("Y",))
    with refused(where="table"):
        TableAxis(T.flip(0))


def test_rings_fill_the_hemisphere() -> None:
    theta = (torch.arange(30, dtype=torch.float64) + 0.5) * (math.pi / 60)
    assert float(ring_weights(theta).sum()) == pytest.approx(1)
    nodes = torch.arange(6, dtype=torch.float64) * math.radians(15)
    weights = ring_weights(nodes)
    assert float(weights[0]) == pytest.approx(1 - math.cos(math.radians(7.5)))
    assert float(weights.sum()) == pytest.approx(1 - math.cos(math.radians(82.5)))
