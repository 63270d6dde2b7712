"""A ring of angles that is off its neighbours is named by its angle, and a narrow highlight is no such ring."""

import re
from dataclasses import replace

import pytest
import torch

from homofact.brdf.analytic.ggx import GgxBrdf, GgxLobe
from homofact.brdf.quality.suspicion.ring_steps import ring_numbers_of
from homofact.brdf.quality.suspicion.suspects import suspicions
from homofact.brdf.samples import Samples
from homofact.geometry.directions import from_spherical, to_spherical


def scanned(roughness: float, step: float, noise: float = 0.01) -> Samples:
    """Rings of 10° by 5° by 15°, and a scan in steps across the highlight in the plane of incidence."""
    model = GgxBrdf((0.1, 0.2, 0.3), (GgxLobe((1.0, 1.0, 1.0), roughness, 0.05),))
    lights = range(0, 71, 10)
    rows = [(float(i), float(o), float(p)) for i in lights for o in range(0, 81, 5) for p in range(0, 181, 15)]
    rows += [(float(i), i + k * step, 180.0) for i in lights if i for k in range(-8, 9)]
    i, o, phi = torch.tensor(rows, dtype=torch.float64).deg2rad().T
    wi, wo = from_spherical(i, i * 0), from_spherical(o, phi)
    values = model.evaluate(wi, wo)
    noisy = values * torch.exp(noise * torch.randn(values.shape, generator=torch.Generator().manual_seed(0)).double())
    return Samples(wi, wo, noisy, isotropic=True)


def darkened(samples: Samples, side: str, degrees: float, share: float) -> Samples:
    """The samples of one ring of θi or θo are darker by a share."""
    theta = to_spherical(samples.wi if side == "θi" else samples.wo)[0].rad2deg()
    return replace(samples, values=samples.values * torch.where((theta - degrees).abs() < 0.01, 1 - share, 1)[:, None])


@pytest.mark.parametrize("roughness", [0.03, 0.1, 0.3])
@pytest.mark.parametrize(("step", "noise"), [(0.5, 0.0), (0.5, 0.02), (1.0, 0.0)])
def test_a_clean_highlight_is_no_bad_ring(roughness: float, step: float, noise: float) -> None:
    assert "ring" not in [each.name for each in suspicions(scanned(roughness, step, noise))]


@pytest.mark.parametrize(("side", "degrees"), [("θo", 45.0), ("θo", 20.0), ("θi", 40.0)])
@pytest.mark.parametrize("roughness", [0.1, 0.3])
def test_a_dark_ring_is_named_by_its_angle(roughness: float, side: str, degrees: float) -> None:
    found = {each.name: each for each in suspicions(darkened(scanned(roughness, 0.5), side, degrees, 0.4))}
    words = found["ring"].words
    assert f"{side} = {degrees:g}°" in words
    assert "darker" in words
    assert int(re.findall(r"(\d+)% darker", words)[0]) == pytest.approx(40, abs=4)


def test_only_angles_with_many_samples_are_rings() -> None:
    theta = torch.tensor([10.0] * 20 + [20.0] * 20 + [20.5, 21.0, 21.5], dtype=torch.float64).deg2rad().numpy()
    number, count = ring_numbers_of(theta)
    assert count == 2
    assert number.tolist() == [0] * 20 + [1] * 20 + [-1] * 3


def test_scattered_angles_are_put_into_bins() -> None:
    theta = torch.rand(1000, dtype=torch.float64, generator=torch.Generator().manual_seed(0)).numpy()
    number, count = ring_numbers_of(theta)
    assert count == 18
    assert (number >= 0).all()
