"""Sums of closures: GGX as others write it, leaning normals, tables that are read as they should be."""

import math

import pytest
import torch

from homofact.brdf.analytic.metallic_roughness import MetallicRoughness
from homofact.brdf.symmetry import find_symmetry
from homofact.geometry.directions import draw_uniform, from_spherical
from homofact.geometry.quadrature import hemisphere_nodes
from homofact.rendering.closures import Closures, alphas


def closures(
    lobe: tuple[float, float, float], weights: tuple[float, float] = (0.0, 1.0), turn: float | None = None
) -> Closures:
    """One lobe, the same at every angle."""
    table = torch.tensor(weights, dtype=torch.float64)[None, None, :, None].expand(1, 8, 2, 1)
    return Closures(torch.tensor(lobe, dtype=torch.float64).expand(8, 1, 3), table, turn, ("Y",))


def pairs(count: int = 300) -> tuple[torch.Tensor, torch.Tensor]:
    wi, wo = draw_uniform(count, torch.Generator().manual_seed(2))
    return wi, wo


def test_one_lobe_is_gltfs_metal_without_fresnel() -> None:
    """KHR_materials_anisotropy, base colour 1: the same D and height-correlated G, lengths given otherwise."""
    metal = MetallicRoughness((1.0,), 1.0, 0.5, anisotropy=0.6, rotation=0.7, channels=("Y",))
    along, across = 0.25 + 0.75 * 0.36, 0.25
    ours = closures(((along * across) ** 0.25, math.sqrt(across / along) - 1, 0.0), turn=0.7)
    wi, wo = pairs()
    assert ours.evaluate(wi, wo).numpy() == pytest.approx(metal.evaluate(wi, wo).numpy(), rel=1e-9)
    # Along the other axis, by an anisotropy of the other sign.
    other = closures(((along * across) ** 0.25, 1 - math.sqrt(across / along), 0.0), turn=0.7 + math.pi / 2)
    assert other.evaluate(wi, wo).numpy() == pytest.approx(metal.evaluate(wi, wo).numpy(), rel=1e-9)


def test_the_lambertian_closure_is_a_matte_surface() -> None:
    wi, wo = pairs()
    assert closures((0.3, 0.0, 0.0), (0.6, 0.0)).evaluate(wi, wo).numpy() == pytest.approx(0.6 / math.pi)
    below = wi * wi.new_tensor((1.0, 1.0, -1.0))
    assert not closures((0.3, 0.0, 0.0), (0.6, 1.0)).evaluate(below, wo).any()


def test_the_tangent_follows_the_viewer_unless_it_is_fixed() -> None:
    assert find_symmetry(closures((0.5, 0.5, 0.1))).isotropic
    assert not find_symmetry(closures((0.5, 0.5, 0.1), turn=0.2)).isotropic


@pytest.mark.parametrize(("lean", "towards"), [(0.0, -50.0), (1.0, 50.0)])
def test_a_leaning_lobe_peaks_between_the_mirror_direction_and_the_viewer(lean: float, towards: float) -> None:
    """s = 0 is a mirror's direction, s = 1 the way back."""
    wo = from_spherical(*(torch.tensor([angle], dtype=torch.float64) for angle in (math.radians(50), 0.4)))
    degrees = torch.arange(-89.0, 89.5, 0.5, dtype=torch.float64)
    wi = from_spherical(torch.deg2rad(degrees), torch.full_like(degrees, 0.4))
    values = closures((0.2, 0.0, lean)).evaluate(wi, wo.expand_as(wi))[:, 0] * wi[:, 2]
    assert float(degrees[values.argmax()]) == pytest.approx(towards, abs=1.0)


@pytest.mark.parametrize("lean", [0.0, 0.2, -0.1])
def test_no_lobe_reflects_more_than_it_gets(lean: float) -> None:
    """GGX without Fresnel loses what it would scatter more than once, and little of that where it is narrow."""
    wo = from_spherical(*(torch.tensor([angle], dtype=torch.float64) for angle in (0.7, 0.0)))
    wi, solid = hemisphere_nodes(wo)
    for roughness, least in ((0.2, 0.98), (0.7, 0.6)):
        f = closures((roughness, 0.3, lean)).evaluate(wi[0], wo.expand_as(wi[0]))[:, 0]
        assert least < float((f * wi[0, :, 2] * solid[0]).sum()) < 1.0001


def test_tables_are_read_between_their_entries() -> None:
    """Columns by cosθo, rows by azimuth from −π to π."""
    columns, rows = torch.linspace(0, 1, 5, dtype=torch.float64), torch.linspace(-1, 1, 9, dtype=torch.float64)
    lobes = columns[:, None, None].expand(5, 2, 3)
    weights = (columns + 2 * rows[:, None])[..., None, None].expand(9, 5, 3, 1)
    made = Closures(lobes, weights, 0.0, ("Y",))
    phi = torch.tensor([-3.0, 0.3, 2.9], dtype=torch.float64)
    wo = from_spherical(torch.tensor([0.2, 0.9, 1.5], dtype=torch.float64), phi)
    shapes, found = made.at(wo)
    assert shapes[:, 1, 2].numpy() == pytest.approx(wo[:, 2].numpy())
    assert found[:, 2, 0].numpy() == pytest.approx((wo[:, 2] + 2 * phi / math.pi).numpy())
    assert made.fetches == 5
    assert made.nbytes == 4 * (5 * 2 * 3 + 9 * 5 * 3)


def test_lengths_are_blenders() -> None:
    """svm_node_closure_bsdf: α (1 − a) and α/(1 − a), α/(1 + a) and α (1 + a) of a < 0, at most 1."""
    roughness, anisotropy = torch.tensor([0.5, 0.5, 0.9]), torch.tensor([0.5, -0.5, 0.5])
    along, across = alphas(roughness, anisotropy)
    assert along.tolist() == pytest.approx([0.125, 0.5, 0.405])
    assert across.tolist() == pytest.approx([0.5, 0.125, 1.0])
