"""Closures fitted to materials: their albedo, weights of one sign, materials that are such sums found again."""

import math

import numpy as np
import pytest
import torch
from refusals import refused
from skies import LAMBERT, Planted

from homofact.brdf.analytic.metallic_roughness import MetallicRoughness
from homofact.brdf.reflectance import Reflectance
from homofact.errors import BadInput
from homofact.geometry.directions import draw_uniform, from_spherical
from homofact.geometry.quadrature import hemisphere_nodes
from homofact.rendering import closure_fit as module
from homofact.rendering.closure_fit import closures_of
from homofact.rendering.closures import Closures

PHONG = Planted(
    lambda wi, wo: 0.1 + 2 * (wi * wo * wi.new_tensor((-1, -1, 1))).sum(1).clamp_min(0) ** 20 / (wi[:, 2] + 0.1)
)


@pytest.fixture(autouse=True)
def coarse(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fewer angles and nodes: enough for lobes this wide."""
    monkeypatch.setattr(module, "_EVERY", 9)
    monkeypatch.setattr(module, "_NODES", {True: (32, 16), False: (16, 12)})
    monkeypatch.setattr(module, "AZIMUTHS", 4)
    monkeypatch.setattr(module, "_STEPS", 15)
    monkeypatch.setattr(module, "_FIRST_STEPS", 40)
    monkeypatch.setitem(module._STARTS, 1, ((0.1,),))
    monkeypatch.setitem(module._STARTS, 2, ((0.1, 0.4),))


def planted(lobe: tuple[float, float, float], weights: tuple[float, float]) -> Closures:
    table = torch.tensor(weights, dtype=torch.float64)[None, None, :, None].expand(1, 8, 2, 1)
    return Closures(torch.tensor(lobe, dtype=torch.float64).expand(8, 1, 3), table, None, ("Y",))


def albedo(reflectance: Reflectance, theta: float, phi: float = 0.0) -> np.ndarray:
    wo = from_spherical(*(torch.tensor([angle], dtype=torch.float64) for angle in (theta, phi)))
    wi, solid = (each[0] for each in hemisphere_nodes(wo))
    return ((wi[:, 2] * solid) @ reflectance.evaluate(wi, wo.expand_as(wi))).numpy()


@pytest.mark.parametrize("lobes", [1, 2])
def test_uniform_light_is_exact_and_no_weight_is_negative(lobes: int) -> None:
    found = closures_of(PHONG, lobes)
    assert found.lobes.shape == (64, lobes, 3)
    assert found.weights.shape == (1, 64, 1 + lobes, 1)
    assert float(found.weights.min()) >= 0
    for theta in (0.05, 0.6, 1.0, 1.3):
        assert albedo(found, theta) == pytest.approx(albedo(PHONG, theta), rel=0.01)


@pytest.mark.parametrize(
    "lobe", [(0.4, 0.0, 0.0), (0.25, 0.0, 0.0), (0.4, 0.0, 1.0)], ids=["lobe", "narrow", "on the way back"]
)
def test_a_matte_part_and_one_lobe_are_found_again(lobe: tuple[float, float, float]) -> None:
    found = closures_of(planted(lobe, (0.3, 0.6)), 1)
    middle = slice(8, 60)
    assert found.lobes[middle, 0].numpy() == pytest.approx(np.broadcast_to(lobe, (52, 3)), abs=0.02)
    assert found.weights[0, middle, 0, 0].numpy() == pytest.approx(0.3, abs=0.02)
    assert found.weights[0, middle, 1, 0].numpy() == pytest.approx(0.6, abs=0.02)


def test_what_is_matte_stays_matte() -> None:
    found = closures_of(LAMBERT, 1)
    wi, wo = draw_uniform(200, torch.Generator().manual_seed(3))
    assert np.median(np.abs(found.evaluate(wi, wo).numpy() * math.pi - 0.6)) < 0.02


def test_a_stretched_lobe_is_stretched_the_same_way() -> None:
    metal = MetallicRoughness((0.9, 0.7, 0.5), 1.0, 0.4, anisotropy=0.7, rotation=0.5)
    found = closures_of(metal, 1)
    assert found.weights.shape == (5, 64, 2, 3)
    assert torch.equal(found.weights[0], found.weights[-1])
    assert found.turn == pytest.approx(0.5, abs=0.1)
    # Longer along the tangent: α along is r²/(1 + a), α across r² (1 + a).
    along, across = 0.16 + 0.84 * 0.49, 0.16
    roughness, anisotropy, _ = found.lobes[45, 0].tolist()
    assert roughness == pytest.approx((along * across) ** 0.25, rel=0.1)
    assert anisotropy == pytest.approx(math.sqrt(across / along) - 1, abs=0.1)
    for phi in (-math.pi, -math.pi / 2):
        assert albedo(found, 0.8, phi) == pytest.approx(albedo(metal, 0.8, phi), rel=0.03)


def test_the_kernel_is_the_closure() -> None:
    wo = from_spherical(*(torch.tensor([angle], dtype=torch.float64) for angle in (0.9, 0.0)))
    wi, solid = (each[0] for each in hemisphere_nodes(wo, 16, 8))
    for shape in ((0.5, 0.3, 0.1), (0.3, -0.4, -0.05), (0.9, 0.5, 0.9)):
        flux = module._flux(np.array(shape), 1.0, 0.0, wo[0].numpy(), wi.numpy(), solid.numpy())
        f = planted(shape, (0.0, 1.0)).evaluate(wi, wo.expand_as(wi))[:, 0]
        assert flux == pytest.approx((f * wi[:, 2] * solid).numpy(), rel=1e-9, abs=1e-15)


def test_no_lobe_is_mirrored_below_the_horizon() -> None:
    """There Blender would turn the normal."""
    found = closures_of(PHONG, 2)
    for column in range(0, 64, module._EVERY):
        theta = min(math.acos(column / 63), module.GRAZING)
        wo = np.array((math.sin(theta), 0.0, math.cos(theta)))
        assert module._mirrored(found.lobes[column].numpy(), wo).min() > 0.005


def test_black_and_odd_channels_are_refused() -> None:
    with refused(where="Blender's closures", found="the values are all 0"):
        closures_of(Planted(lambda wi, wo: torch.zeros_like(wi[:, 0])))
    two = MetallicRoughness((0.5, 0.5), 0.0, 0.5, channels=("a", "b"))
    with refused(where="reflectance", found="2 channels"):
        closures_of(two)
    with pytest.raises(BadInput, match="not finite"):
        closures_of(Planted(lambda wi, wo: torch.full_like(wi[:, 0], math.nan)))
