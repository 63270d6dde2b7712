"""Places of pairs of directions: what a material reflects alike lies close."""

import pytest
import torch
from goniometer import steel_rings

from homofact.brdf.materials import material
from homofact.brdf.places import half_places
from homofact.brdf.samples import Samples
from homofact.brdf.scattered import Scattered
from homofact.geometry.directions import draw_in_discs, from_spherical

WI, WO = draw_in_discs(200, torch.Generator().manual_seed(3), 0.95)


@pytest.mark.parametrize("isotropic", [True, False])
def test_swapped_directions_have_one_place(isotropic: bool) -> None:
    assert half_places(WI, WO, isotropic).allclose(half_places(WO, WI, isotropic), atol=1e-12)


def test_a_turn_of_the_sample_moves_anisotropic_places_alone() -> None:
    angle = torch.tensor(0.7, dtype=torch.float64)
    turn = torch.tensor([[angle.cos(), -angle.sin(), 0], [angle.sin(), angle.cos(), 0], [0, 0, 1]])
    wi, wo = (w.double() @ turn.double().T for w in (WI, WO))
    assert half_places(wi, wo, True).allclose(half_places(WI, WO, True), atol=1e-9)
    assert float((half_places(wi, wo, False) - half_places(WI, WO, False)).norm(dim=1).min()) > 0.05


def test_isotropic_places_are_continuous_where_the_azimuth_means_nothing() -> None:
    # φd at θh = 0, and at θd = 0, is whatever rounding makes of it.
    theta, phi = torch.deg2rad(torch.tensor([[40.0], [0.0]], dtype=torch.float64)).expand(2, 3)
    for off in (0.0, 1e-4, -1e-4):
        around = torch.tensor([[off, 0.0, 0.0], [0.0, off, 0.0], [0.0, 0.0, off]], dtype=torch.float64)
        wi = from_spherical(theta, phi)
        wo = from_spherical(theta + around[:, 0], phi + torch.pi + around[:, 1])
        at_mirror = half_places(wi, wo, True)
        assert torch.cdist(at_mirror, at_mirror).max() < 0.02
        looking_back = half_places(wi, from_spherical(theta + around[:, 0], phi + around[:, 1]), True)
        assert torch.cdist(looking_back, looking_back).max() < 0.02


def test_an_interpolated_highlight_has_no_spike_beside_its_sample() -> None:
    # A goniometer's plane of incidence in steps of half a degree, and every fifth degree beside it.
    model = material("phong-30").model
    rows = [(t, t + 0.5 * k, 180.0) for t in (10.0, 25.0, 40.0, 55.0) for k in range(-8, 9)]
    rows += [(t, float(o), float(p)) for t in (10, 25, 40, 55) for o in range(0, 81, 10) for p in range(0, 180, 30)]
    degrees = torch.tensor(rows, dtype=torch.float64)
    one, two, turn = torch.deg2rad(degrees).T
    wi, wo = from_spherical(one, torch.zeros_like(one)), from_spherical(two, turn)
    found = Scattered(Samples(wi, wo, model.evaluate(wi, wo), isotropic=True))
    off = torch.deg2rad(torch.tensor([-0.2, -0.05, -0.01, 0.01, 0.05, 0.2], dtype=torch.float64))
    light = from_spherical(torch.full_like(off, 0.6981317), torch.zeros_like(off))
    view = from_spherical(0.6981317 + off, torch.full_like(off, torch.pi))
    ratio = found.evaluate(light, view) / model.evaluate(light, view)
    assert float((ratio - 1).abs().max()) < 0.02


def test_mirror_directions_are_neighbours_whatever_their_azimuth() -> None:
    # θi = 60° from four sides, each with its mirror direction: one half vector, places apart by the azimuth alone.
    phi = torch.arange(4, dtype=torch.float64)
    theta = torch.full_like(phi, 1.0472)
    mirrored = half_places(from_spherical(theta, phi), from_spherical(theta, phi + torch.pi), False)
    assert mirrored[:, :2].abs().max() < 1e-4
    assert mirrored[:, 2].tolist() == pytest.approx([1 / 3] * 4, abs=1e-4)
    assert torch.cdist(mirrored, mirrored).max() < 0.15


def test_highlights_between_the_lights_of_a_goniometer_keep_their_light() -> None:
    found, tests = Scattered(steel_rings(steps=(5, 15))), steel_rings((12.0, 42.0), (15.0, 75.0), (4, 9))
    weight = tests.wo[:, 2:] * torch.hypot(tests.wo[:, 0], tests.wo[:, 1])[:, None]
    values = found.evaluate(tests.wi, tests.wo)
    for angle in (12.0, 42.0):
        own = weight * (torch.rad2deg(torch.acos(tests.wi[:, 2:])) - angle).abs().lt(0.1)
        assert float((own * values).sum() / (own * tests.values).sum()) == pytest.approx(1, abs=0.1)
    off = (weight * (values - tests.values).abs()).sum() / (weight * tests.values).sum()
    assert float(off) < 0.15  # over coordinates of both directions 0.56
