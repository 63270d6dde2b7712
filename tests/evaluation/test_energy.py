"""Albedo, energy and highlight of fits against sources: closed forms, brute force, and faults put in on purpose."""

import json
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest
import torch
from torch import Tensor

from homofact.brdf.analytic import AshikhminShirley, Lambert, Ward
from homofact.brdf.analytic.common import AnalyticModel
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.source import open_source
from homofact.errors import BadInput
from homofact.evaluation import energy
from homofact.evaluation.energy import ALBEDO_DEGREES, EnergyErrors, energy_errors
from homofact.geometry.directions import from_spherical, normalize

GREY = ("Y",)


def ward(specular: float, x: float, y: float | None = None, diffuse: float = 0.1) -> Ward:
    return Ward((diffuse,), (specular,), x, x if y is None else y, channels=GREY)


@dataclass(frozen=True)
class Altered:
    """`base` with its values changed by `how`, a function of (values, wi, wo)."""

    base: Reflectance
    how: Callable[[Tensor, Tensor, Tensor], Tensor]

    nbytes: int = 0
    fetches: int = 0

    @property
    def channels(self) -> tuple[str, ...]:
        return self.base.channels

    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        return self.how(self.base.evaluate(wi, wo), wi, wo)


def brute_force(model: AnalyticModel, degrees: float, azimuth: float, reach: tuple[float, float], side: int) -> float:
    """The albedo over a grid of the half vector's slopes (hx/hz, hy/hz), dωh = hz³ dp dq, within ±`reach`."""
    ticks = [(torch.arange(side, dtype=torch.float64) + 0.5) * (2 * r / side) - r for r in reach]
    p, q = (each.reshape(-1) for each in torch.meshgrid(*ticks, indexing="ij"))
    h = normalize(torch.stack((p, q, torch.ones_like(p)), 1))
    theta = torch.tensor([math.radians(degrees)], dtype=torch.float64)
    wi = from_spherical(theta, torch.full_like(theta, azimuth)).expand_as(h)
    towards = (wi * h).sum(1, keepdim=True)
    wo = 2 * towards * h - wi
    area = h[:, 2] ** 3 * (4 * reach[0] * reach[1] / side**2)
    weight = 4 * towards[:, 0] * wo[:, 2].clamp_min(0) * area
    return float((model.evaluate(wi, wo)[:, 0] * weight)[towards[:, 0] > 0].sum())


def test_lambert_is_exact() -> None:
    found = energy_errors(Lambert((0.2, 0.3, 0.8)), Lambert((0.4, 0.3, 0.8)), isotropic=True)
    assert found.degrees == ALBEDO_DEGREES
    for own, mine, ratio in zip(found.source_albedo, found.fit_albedo, found.albedo_ratio, strict=True):
        assert own == pytest.approx((0.4, 0.3, 0.8), rel=1e-4)
        assert mine == pytest.approx((0.2, 0.3, 0.8), rel=1e-4)
        assert ratio == pytest.approx((0.5, 1.0, 1.0))
    assert found.albedo_worst == pytest.approx(0.5)
    assert found.albedo_mean == pytest.approx((1.3 / 1.5,) * len(ALBEDO_DEGREES))
    assert found.energy == pytest.approx((0.5, 1.0, 1.0))
    assert (found.energy_overall, found.highlight, found.bright_half) == pytest.approx((1.3 / 1.5,) * 3)
    assert found.rms == pytest.approx(0.2 / math.sqrt(0.16 + 0.09 + 0.64))
    assert found.floor == 0


@pytest.mark.parametrize("slope", [0.001, 0.01, 0.1])
def test_albedo_of_narrow_peaks_by_brute_force(slope: float) -> None:
    model = ward(0.5, slope, diffuse=0.0)
    found = energy_errors(model, model, isotropic=True).source_albedo
    for degrees, (albedo,) in zip(ALBEDO_DEGREES[:4], found, strict=False):
        expected = brute_force(model, degrees, 0.0, (6 * slope, 6 * slope), 500)
        assert albedo == pytest.approx(expected, rel=2e-3)


def test_albedo_of_a_sharp_phong_by_brute_force() -> None:
    model = AshikhminShirley((0.0,), (0.3,), 20_000, 20_000, channels=GREY)
    found = energy_errors(model, model, isotropic=True).source_albedo
    for degrees, (albedo,) in zip(ALBEDO_DEGREES, found, strict=True):
        assert albedo == pytest.approx(brute_force(model, degrees, 0.0, (0.06, 0.06), 500), rel=2e-3)


def test_brushed_materials_are_the_mean_over_azimuths() -> None:
    model = ward(0.5, 0.05, 0.2, diffuse=0.0)
    found = energy_errors(model, model, isotropic=False).source_albedo
    for degrees, (albedo,) in zip(ALBEDO_DEGREES[:3], found, strict=False):
        along, across = (brute_force(model, degrees, a, (0.3, 1.2), 600) for a in (0.0, math.pi / 2))
        assert albedo == pytest.approx((along + across) / 2, rel=2e-3)
        if degrees == 40:
            assert abs(along / across - 1) > 5e-3  # one azimuth alone would not have done


def test_a_scaled_fit_has_that_scale_everywhere() -> None:
    source = ward(0.4, 0.01)
    found = energy_errors(Altered(source, lambda f, *_: 0.7 * f), source, isotropic=True)
    for value in (found.albedo_worst, *found.energy, found.energy_overall, found.highlight, found.bright_half):
        assert value == pytest.approx(0.7)
    assert found.rms == pytest.approx(0.3)


def test_a_peak_that_lost_half_its_light() -> None:
    found = energy_errors(ward(0.25, 0.002), ward(0.5, 0.002), isotropic=True)
    assert found.highlight == pytest.approx(0.5, rel=1e-3)
    assert found.bright_half == pytest.approx(0.5, rel=5e-3)
    assert found.albedo_ratio[0][0] == pytest.approx((0.1 + 0.25) / (0.1 + 0.5), rel=5e-3)
    assert found.rms == pytest.approx(0.5, rel=1e-2)


def test_a_blunt_peak_keeps_energy_and_loses_the_highlight() -> None:
    source, fit = ward(0.5, 0.02), ward(0.5, 0.04)
    found = energy_errors(fit, source, isotropic=True)
    assert found.energy_overall == pytest.approx(1, abs=0.01)
    assert found.albedo_ratio[1][0] == pytest.approx(1, abs=0.01)
    # At its top a lobe twice as wide is a quarter as high.
    assert found.highlight == pytest.approx(0.25, abs=0.01)
    assert 0.5 < found.rms < 1


def test_the_brightest_percent_is_a_percent_of_each_incidences_flux() -> None:
    # Nothing is lost but what lies above the value that bounds the brightest percent.
    source = ward(0.5, 0.02, diffuse=0.0)

    def darkened(f: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
        # exp(−s/α²) bears the share 1 − exp(−s/α²) of the flux inside, but for what cosines turn with ωo.
        h = normalize(wi + wo)
        inside = (h[:, :2] ** 2).sum(1) / h[:, 2] ** 2 < -math.log1p(-energy.HIGHLIGHT) * 0.02**2
        return torch.where(inside[:, None], 0.0, f)

    found = energy_errors(Altered(source, darkened), source, isotropic=True)
    assert found.highlight < 0.1
    assert found.bright_half == pytest.approx(1 - 0.01 / 0.5, abs=4e-3)
    assert found.energy_overall == pytest.approx(0.99, abs=2e-3)


def test_the_floor_is_the_error_of_the_sources_own_reciprocal_part() -> None:
    # f = a + b (cosθi − cosθo): half the difference of both orders is b (cosθi − cosθo), of mean square b²/9.
    a, b = 0.3, 0.2
    flat = Lambert((a * math.pi,), channels=GREY)
    source = Altered(flat, lambda f, wi, wo: f + b * (wi[:, 2:] - wo[:, 2:]))
    fit = Altered(source, lambda f, wi, wo: (f + source.evaluate(wo, wi)) / 2)
    found = energy_errors(fit, source, isotropic=True)
    assert found.floor == pytest.approx(math.sqrt(b**2 / 9 / (a**2 + b**2 / 9)), rel=1e-3)
    assert found.rms == pytest.approx(found.floor, rel=1e-9)


def test_one_wrong_channel_is_the_worst() -> None:
    source = Lambert((0.4, 0.3, 0.8))
    found = energy_errors(Lambert((0.42, 0.3 * 1.3, 0.8)), source, isotropic=True)
    assert found.albedo_worst == pytest.approx(1.3)
    assert energy_errors(Lambert((0.4, 0.2, 1.0)), source, isotropic=True).albedo_worst == pytest.approx(2 / 3)


def test_black_sources() -> None:
    black, grey = Lambert((0.0,), channels=GREY), Lambert((0.5,), channels=GREY)
    same = energy_errors(black, black, isotropic=True)
    assert (same.albedo_worst, same.energy_overall, same.rms, same.highlight, same.floor) == (1, 1, 0, 1, 0)
    found = energy_errors(grey, black, isotropic=True)
    assert found.energy_overall == found.rms == math.inf
    record = found.record()
    assert record["energy_overall"] is None
    assert record["albedo_worst"] is None
    json.dumps(record, allow_nan=False)


def test_records_hold_every_figure() -> None:
    found = energy_errors(Lambert((0.5,), channels=GREY), Lambert((0.6,), channels=GREY), isotropic=True)
    record = json.loads(json.dumps(found.record(), allow_nan=False))
    assert set(EnergyErrors.__dataclass_fields__) <= set(record)
    assert record["albedo_worst"] == pytest.approx(5 / 6)
    assert record["albedo_ratio"][4][0] == pytest.approx(5 / 6)


def test_channels_must_agree() -> None:
    with pytest.raises(BadInput, match="found 3 channels, expected the source's 1"):
        energy_errors(Lambert((0.1, 0.2, 0.3)), Lambert((0.5,), channels=GREY), isotropic=True)


@pytest.mark.slow
def test_a_measured_gloss_is_resolved(real_data: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    source = open_source(str(real_data / "rgl" / "chm_light_blue_rgb.bsdf"), count=500).reflectance
    blunt = Altered(source, lambda f, wi, wo: f.clamp_max(5.0))
    usual = energy_errors(blunt, source, isotropic=True)
    assert usual.energy_overall < 0.5
    assert usual.highlight < 0.02
    assert 0.05 < usual.floor < 0.2
    monkeypatch.setattr(energy, "_ISOTROPIC", (300, 96))
    finer = energy_errors(blunt, source, isotropic=True)
    for one, two in zip(usual.source_albedo, finer.source_albedo, strict=True):
        assert one == pytest.approx(two, rel=3e-3)
    assert usual.energy_overall == pytest.approx(finer.energy_overall, rel=3e-3)
    assert usual.rms == pytest.approx(finer.rms, rel=1e-2)


def test_of_the_last_bright_node_only_the_part_that_is_wanted_counts() -> None:
    weight, own = torch.ones(1, 1, 4, dtype=torch.float64), torch.tensor([[[4.0, 3.0, 2.0, 1.0]]], dtype=torch.float64)
    fit = own.clone()
    fit[..., 1] = 0
    # Half of the flux is 5: the first node and a third of the second.
    assert energy._brightest(weight, fit[..., None], own[..., None], 0.5) == pytest.approx(4 / 5)
