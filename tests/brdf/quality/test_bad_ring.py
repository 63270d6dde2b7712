"""A ring of angles that is off its neighbours is named by its angle, and a narrow highlight is no such ring."""

import re
from dataclasses import replace

import pytest
import torch

from homofact.brdf.analytic.ggx import GgxBrdf, GgxLobe
from homofact.brdf.quality.gains import calibrated
from homofact.brdf.quality.suspicion.dismissal import dismissed
from homofact.brdf.quality.suspicion.evidence import Evidence
from homofact.brdf.quality.suspicion.ring_steps import largest_step, ring_numbers_of
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


def few_lights(lights: tuple[int, ...] = (0, 20, 35, 50, 65), noise: float = 0.02) -> Samples:
    """A goniometer with few angles of the light, on a grid of θo that has them too."""
    model = GgxBrdf((0.1, 0.2, 0.3), (GgxLobe((1.0, 1.0, 1.0), 0.2, 0.05),))
    rows = [(float(i), float(o), float(p)) for i in lights for o in range(0, 81, 5) for p in range(0, 181, 20)]
    i, o, phi = torch.tensor(rows, dtype=torch.float64).deg2rad().T
    wi, wo = from_spherical(i, i * 0), from_spherical(o, phi)
    values = model.evaluate(wi, wo)
    noisy = values * torch.exp(noise * torch.randn(values.shape, generator=torch.Generator().manual_seed(0)).double())
    return Samples(wi, wo, noisy, isotropic=True)


@pytest.mark.parametrize("degrees", [0.0, 20.0, 35.0, 65.0])
@pytest.mark.parametrize("share", [0.4, -0.5])
def test_a_bad_ring_among_few_is_named_and_divided_out_alone(degrees: float, share: float) -> None:
    clean = few_lights()
    bad = darkened(clean, "θi", degrees, share)
    found = {each.name: each.words for each in suspicions(bad)}
    # With the ring divided out, nothing else looks wrong: such a ring can look like a wrong direction.
    assert list(found) == ["ring"]
    words = found["ring"]
    assert f"θi = {degrees:g}°" in words
    assert ("darker" if share > 0 else "brighter") in words
    assert int(re.findall(r"(\d+)%", words)[0]) == pytest.approx(100 * abs(share), abs=5)
    mended = calibrated(bad, ["rings"])
    theta = to_spherical(clean.wi)[0].rad2deg()
    there = (theta - degrees).abs() < 0.01
    assert torch.equal(mended.values[~there], clean.values[~there])
    assert mended.values[there] == pytest.approx(clean.values[there], rel=0.05)


@pytest.mark.parametrize("lights", [(0, 20, 35, 50, 65), (10, 30, 50, 70), (0, 15, 30, 45, 60, 75)])
def test_few_clean_rings_are_not_accused(lights: tuple[int, ...]) -> None:
    for noise in (0.0, 0.03):
        samples = few_lights(lights, noise)
        assert "ring" not in [each.name for each in suspicions(samples)]
        # A smooth loss of light over the angle is no ring.
        theta = to_spherical(samples.wi)[0]
        drift = replace(samples, values=samples.values * torch.exp(-0.5 * theta)[:, None])
        assert "ring" not in [each.name for each in suspicions(drift)]


def test_a_ring_that_somebody_checked_is_not_divided_out_of_the_evidence() -> None:
    bad = darkened(few_lights(), "θi", 35.0, 0.4)
    checked = dismissed(bad, ["ring"])
    assert "ring" in [each.name for each in suspicions(bad)]
    found = [each.name for each in suspicions(checked)]
    assert "ring" not in found
    # Without the ring's gain, the smooth tests see uneven data.
    assert found == [each.name for each in suspicions(replace(checked, values=checked.values * 2)) if each.name != "pi"]


def test_rings_without_swapped_pairs_cannot_be_judged() -> None:
    clean = few_lights((7, 18, 33, 52))
    found = largest_step(Evidence.of(darkened(clean, "θi", 33.0, 0.5)))
    assert found is None or found.of == "theta_o"
