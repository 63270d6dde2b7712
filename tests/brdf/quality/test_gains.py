"""Gains of rings and rows: planted ones are found and divided out, a clean material keeps every bit."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from refusals import refused

from homofact.brdf.materials import MATERIALS
from homofact.brdf.quality.gains import Calibration, Gains, calibrated, calibration_of, gain_at
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model
from homofact.geometry.directions import from_spherical, to_spherical

ISOTROPIC = sorted(name for name in MATERIALS if sample_model(MATERIALS[name].model, 4, "discs", 0).isotropic)


def scattered(name: str, count: int = 1000) -> Samples:
    return sample_model(MATERIALS[name].model, count, "discs", 3)


def goniometer(name: str, rings_i: int = 8, rings_o: int = 12, spokes: int = 13) -> Samples:
    """On rings of θi and θo, rows ring after ring of θi."""
    angles = (torch.linspace(low, high, steps, dtype=torch.float64).deg2rad()
              for low, high, steps in ((5, 80, rings_i), (0, 83, rings_o), (0, 180, spokes)))  # fmt: skip
    one, two, turn = (each.reshape(-1) for each in torch.meshgrid(*angles, indexing="ij"))
    wi, wo = from_spherical(one, torch.zeros_like(one)), from_spherical(two, turn)
    values = MATERIALS[name].model.evaluate(wi, wo)
    return Samples(wi, wo, values, channels=("R", "G", "B"), isotropic=True)


def times(samples: Samples, logs: torch.Tensor) -> Samples:
    """The samples with a gain whose mean log is 0."""
    return replace(samples, values=samples.values * torch.exp(logs - logs.mean())[:, None])


def by_ring(direction: torch.Tensor, seed: int) -> torch.Tensor:
    rank = torch.unique((to_spherical(direction)[0] * 1000).round(), return_inverse=True)[1]
    return torch.randn(int(rank.max()) + 1, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)[rank]


def left(clean: Samples, mended: Samples) -> float:
    """The RMS of the log gain that is left, its mean taken off."""
    logs = torch.log(mended.values / clean.values).mean(1)
    return float((logs - logs.mean()).square().mean().sqrt())


@pytest.mark.parametrize("kind", ["rings", "rows"])
@pytest.mark.parametrize("make", [scattered, goniometer])
@pytest.mark.parametrize("name", ISOTROPIC)
def test_clean_samples_keep_every_bit(name: str, make, kind: str) -> None:
    samples = make(name)
    found = calibrated(samples, [kind])
    assert torch.equal(found.values, samples.values)
    assert found.provenance["gains"][kind]["removed"] is False
    assert "nothing changed" in found.provenance["gains"][kind]["words"]


@pytest.mark.parametrize("name", ["lafortune-clay", "phong-30", "cook-torrance-plastic"])
def test_gains_of_rings_are_divided_out(name: str) -> None:
    clean = goniometer(name)
    planted = times(clean, 0.3 * by_ring(clean.wi, 0))
    assert left(clean, planted) > 0.15
    assert left(clean, calibrated(planted, ["rings"])) < 0.04


def test_a_lamp_that_fades_with_the_angle_is_told_by_reciprocity() -> None:
    clean = scattered("lafortune-clay")
    planted = times(clean, torch.log1p(-0.8 * to_spherical(clean.wi)[0] / (math.pi / 2)))
    assert left(clean, planted) > 0.25
    assert left(clean, calibrated(planted, ["rings"])) < 0.03


def test_a_gain_that_is_the_same_over_both_angles_is_the_material_s() -> None:
    clean = scattered("lafortune-clay")
    both = sum(torch.log1p(-0.5 * to_spherical(w)[0] / (math.pi / 2)) for w in (clean.wi, clean.wo))
    planted = times(clean, torch.as_tensor(both))
    assert torch.equal(calibrated(planted, ["rings"]).values, planted.values)


@pytest.mark.parametrize("make", [scattered, goniometer])
def test_a_drift_along_the_rows_is_divided_out(make) -> None:
    clean = make("phong-30")
    planted = times(clean, torch.log1p(-0.7 * torch.linspace(0, 1, len(clean), dtype=torch.float64)))
    assert left(clean, planted) > 0.2
    assert left(clean, calibrated(planted, ["rows"])) < 0.05


def test_the_mean_log_gain_is_kept_and_the_gains_are_told() -> None:
    clean = goniometer("phong-30")
    found = calibrated(times(clean, 0.3 * by_ring(clean.wi, 0)), ["rings"])
    logs = torch.log(found.values / clean.values).mean(1)
    assert float(logs.mean()) == pytest.approx(0, abs=1e-3)
    facts = found.provenance["gains"]["rings"]
    assert [at for at, _ in facts["theta_i"]] == pytest.approx(np.linspace(5, 80, 8), abs=0.06)
    assert len(facts["theta_o"]) == 12
    assert all(gain > 0 for _, gain in facts["theta_i"])
    assert "divided out" in facts["words"]


def test_outliers_do_not_make_gains() -> None:
    clean = scattered("phong-30")
    hit = torch.rand(1000, generator=torch.Generator().manual_seed(1)) < 0.02
    spoiled = replace(clean, values=clean.values * torch.where(hit, 300.0, 1.0)[:, None])
    assert torch.equal(calibrated(spoiled, ["rings", "rows"]).values, spoiled.values)


def test_a_ring_takes_the_gain_of_the_nearest_angle_and_a_row_is_interpolated() -> None:
    samples = goniometer("phong-30", 2, 2, 2)
    rings = Gains("theta_i", np.array([10.0, 70.0]), np.array([1.0, 2.0]))
    assert gain_at(rings, samples).tolist() == [1.0] * 4 + [2.0] * 4
    rows = Gains("row", np.array([0.0, 7.0]), np.array([0.0, 7.0]))
    assert gain_at(rows, samples).tolist() == pytest.approx(list(range(8)))


def test_both_conditions_have_to_hold_before_a_gain_is_removed() -> None:
    assert Calibration("rings", (), 0.1, 1.0).removed
    assert not Calibration("rings", (), 0.01, 1.0).removed
    assert not Calibration("rings", (), 0.1, 0.3).removed


def test_what_cannot_be_calibrated_is_refused() -> None:
    samples = scattered("phong-30", 300)
    with refused(where="calibrate", found="'ring'"):
        calibrated(samples, ["ring"])
    with refused(where="calibrate"):
        calibrated(replace(samples, isotropic=False), ["rows"])
    with refused(where="calibrate", found="150 samples"):
        calibrated(samples.subset(150, 0), ["rings"])
    assert calibration_of(samples, "rings").kind == "rings"


@pytest.mark.parametrize("bad", [{("theta_o", 3): -0.4}, {("theta_o", 4): 0.3, ("theta_o", 10): -0.4}])
def test_single_bad_rings_among_good_ones_are_divided_out(bad: dict[tuple[str, int], float]) -> None:
    clean = goniometer("phong-10", rings_o=17)
    ranks = {of: torch.unique((to_spherical(w)[0] * 1000).round(), return_inverse=True)[1]
             for of, w in (("theta_i", clean.wi), ("theta_o", clean.wo))}  # fmt: skip
    logs = torch.zeros(len(clean), dtype=torch.float64)
    for (of, ring), gain in bad.items():
        logs += torch.where(ranks[of] == ring, gain, 0.0).double()
    noise = torch.randn(clean.values.shape, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    noisy = replace(clean, values=clean.values * torch.exp(0.005 * noise))
    mended = calibrated(replace(noisy, values=noisy.values * torch.exp(logs)[:, None]), ["rings"])
    assert left(noisy, mended) < 0.25 * float(logs.std())
    assert mended.provenance["gains"]["rings"]["removed"] is True
    untouched = logs == 0
    assert torch.equal(mended.values[untouched], noisy.values[untouched])
    assert mended.provenance["gains"]["rings"]["words"].count("its neighbours") == len(bad)
