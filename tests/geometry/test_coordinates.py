"""The named coordinates: domains, the swap law, the invariance of the isotropic ones."""

import math

import pytest
import torch
from refusals import refused
from torch import Tensor

from homofact.geometry.coordinates import (
    COORDINATES,
    CoordinateSystem,
    coordinate_system,
    rusinkiewicz_angles,
)
from homofact.geometry.directions import draw_uniform, from_half_difference, from_spherical

SYSTEMS = pytest.mark.parametrize("system", COORDINATES.values(), ids=list(COORDINATES))
ISOTROPIC = [system for system in COORDINATES.values() if system.isotropic]


def pairs(seed: int = 0) -> tuple[Tensor, Tensor]:
    return draw_uniform(2000, torch.Generator().manual_seed(seed))


def turned(w: Tensor, angle: float, mirrored: bool = False) -> Tensor:
    x, y = w[:, 0], -w[:, 1] if mirrored else w[:, 1]
    cos, sin = math.cos(angle), math.sin(angle)
    return torch.stack((cos * x - sin * y, sin * x + cos * y, w[:, 2]), 1)


@SYSTEMS
def test_swapping_directions_is_the_swap_matrix(system: CoordinateSystem) -> None:
    wi, wo = pairs()
    swap = torch.tensor(system.swap, dtype=torch.float64)
    expected = system.evaluate(wi, wo) @ swap.T
    assert torch.allclose(system.evaluate(wo, wi), expected, atol=1e-9, rtol=0)
    assert torch.allclose(swap @ swap, torch.eye(system.dimension, dtype=torch.float64))


@SYSTEMS
def test_coordinates_stay_in_their_domain(system: CoordinateSystem) -> None:
    x = system.evaluate(*pairs())
    assert x.shape == (2000, system.dimension)
    if system.domain == "discs":
        assert float(x[:, :2].norm(dim=1).max()) <= 1 + 1e-12
        assert float(x[:, 2:].norm(dim=1).max()) <= 1 + 1e-12
    else:
        assert float(x.abs().max()) <= 1 + 1e-12
        # The box is used, not a corner of it.
        assert float((x.max(0).values - x.min(0).values).min()) > 1.8


@pytest.mark.parametrize("system", ISOTROPIC, ids=[system.name for system in ISOTROPIC])
@pytest.mark.parametrize("mirrored", [False, True])
def test_isotropic_coordinates_ignore_turning_and_mirroring(system: CoordinateSystem, mirrored: bool) -> None:
    wi, wo = pairs()
    for angle in (0.3, 2.0, math.pi, -1.1):
        moved = system.evaluate(turned(wi, angle, mirrored), turned(wo, angle, mirrored))
        assert torch.allclose(moved, system.evaluate(wi, wo), atol=1e-7, rtol=0)


@pytest.mark.parametrize("name", ["in-out", "half-diff"])
def test_the_others_do_not_claim_it(name: str) -> None:
    system = coordinate_system(name)
    wi, wo = pairs()
    assert not system.isotropic
    moved = system.evaluate(turned(wi, 0.5), turned(wo, 0.5))
    assert not torch.allclose(moved, system.evaluate(wi, wo), atol=1e-2)


def test_rusinkiewicz_angles_of_a_built_pair() -> None:
    # h at θh = 0.5 and azimuth 0, where the Kautz-McCool frame has r in the plane of n and h: φd = 0.7.
    h = from_spherical(torch.tensor([0.5], dtype=torch.float64), torch.tensor([0.0], dtype=torch.float64))
    d = from_spherical(torch.tensor([0.4], dtype=torch.float64), torch.tensor([0.7], dtype=torch.float64))
    angles = [float(a) for a in rusinkiewicz_angles(*from_half_difference(h, d))]
    assert angles == pytest.approx([0.5, 0.4, 0.7], abs=1e-12)


@pytest.mark.parametrize(("phi", "folded"), [(2.0, math.pi - 2.0), (-0.7, 0.7), (math.pi + 0.2, 0.2)])
def test_phi_d_is_folded_to_a_quarter(phi: float, folded: float) -> None:
    h = from_spherical(torch.tensor([0.5], dtype=torch.float64), torch.tensor([0.0], dtype=torch.float64))
    d = from_spherical(torch.tensor([0.4], dtype=torch.float64), torch.tensor([phi], dtype=torch.float64))
    assert float(rusinkiewicz_angles(*from_half_difference(h, d))[2]) == pytest.approx(folded, abs=1e-12)


@SYSTEMS
def test_degenerate_pairs_are_finite(system: CoordinateSystem) -> None:
    wi = torch.tensor([[0, 0, 1], [1, 0, 0], [1, 0, 0], [0, 1, 0]], dtype=torch.float64)
    wo = torch.tensor([[0, 0, 1], [1, 0, 0], [-1, 0, 0], [0, 1, 0]], dtype=torch.float64)
    assert bool(torch.isfinite(system.evaluate(wi, wo)).all())


def test_unknown_name_lists_the_names() -> None:
    with refused(where="coordinates", found="'polar'"):
        coordinate_system("polar")
