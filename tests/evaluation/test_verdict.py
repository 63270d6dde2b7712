"""The verdict: every check sees its own trouble, and a good fit has nothing found against it."""

from dataclasses import replace

import pytest
import torch

from homofact.brdf.materials import material
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model
from homofact.brdf.source import Source
from homofact.errors import Status
from homofact.evaluation.bar.error_bar import BarKind
from homofact.evaluation.compare import fit_and_measure
from homofact.evaluation.verdict.verdict import Verdict
from homofact.methods.mccool import McCool
from homofact.methods.method import Method
from homofact.methods.svd import Svd
from homofact.stability.cells import NeverEvaluated

GOOD = McCool(projections=("theta_h-theta_d", "theta_d-phi_d"), size=12, smoothing=1e-4)


def drawn(name: str = "phong-10", count: int = 6000) -> Samples:
    return sample_model(material(name).model, count, "discs", 0)


def verdict_on(samples: Samples, settings: Method = GOOD, name: str = "phong-10", epsilon: float = 1e-2) -> Verdict:
    source = Source("test", "material", samples, material(name).model, epsilon, 0.0)
    return fit_and_measure(source, settings).verdict


def measured_verdict(samples: Samples, settings: Method = GOOD) -> Verdict:
    """Of samples whose source nobody can ask."""
    source = Source("test", "measurement", replace(samples, provenance={}), NeverEvaluated(samples.channels), 1e-2, 0.0)
    return fit_and_measure(source, settings).verdict


def names(verdict: Verdict) -> set[str]:
    return {finding.name for finding in verdict.findings}


def noise_like(samples: Samples, seed: int = 1) -> torch.Tensor:
    return torch.randn(samples.values.shape, dtype=torch.float64, generator=torch.Generator().manual_seed(seed))


def test_a_good_fit_has_nothing_found_against_it_and_all_its_figures() -> None:
    verdict = verdict_on(drawn("blinn-phong-50"), name="blinn-phong-50")
    assert verdict.trusted
    assert verdict.figures.light.highlight == pytest.approx(1, abs=0.1)
    assert verdict.figures.light.off is not None
    assert verdict.figures.light.off == pytest.approx(1, abs=0.1)
    assert verdict.figures.light.floor == pytest.approx(0, abs=1e-9)
    assert verdict.figures.errors.explained > 0.98
    assert verdict.figures.errors.misplaced < 0.1
    assert verdict.figures.light.source_albedo is not None
    assert verdict.figures.light.source_albedo < 1
    assert verdict.figures.system.condition is not None
    assert 1 < verdict.figures.system.condition < 1e9
    assert verdict.figures.system.determined is not None
    assert verdict.figures.system.determined > 0.9
    assert verdict.figures.light.albedo < 1
    assert verdict.figures.light.reciprocity < 1e-6
    record = verdict.record()
    assert record["trusted"] is True
    assert verdict.bars.kind is BarKind.MEASURED
    assert verdict.bars.of("albedo").error == pytest.approx(abs(verdict.figures.light.off - 1), rel=0.1)
    assert record["recommended"] is None
    assert record["status"] == "direct"


def test_few_samples_leave_texels_undetermined() -> None:
    assert "determined" in names(verdict_on(drawn().subset(100, 0)))


def test_a_method_that_cannot_follow_explains_little_and_misses_the_light() -> None:
    found = names(verdict_on(drawn("blinn-phong-50"), McCool(projections=("theta_i",), size=8)))
    assert {"explained", "light", "highlight"} <= found


def test_noise_fitted_by_too_many_texels_is_scatter_and_misplaces_light() -> None:
    samples = drawn().subset(700, 0)
    noisy = replace(samples, values=samples.values * torch.exp(0.5 * noise_like(samples)))
    assert {"explained", "scatter"} <= names(verdict_on(noisy, replace(GOOD, smoothing=1e-7)))


def test_energy_out_of_nothing_is_found() -> None:
    samples = drawn()
    assert "energy" in names(verdict_on(replace(samples, values=samples.values * 3)))


@pytest.mark.slow
def test_data_that_are_not_reciprocal_are_not_for_a_reciprocal_fit() -> None:
    samples = drawn(count=40_000)
    tilted = replace(samples, values=samples.values * samples.wi[:, 2:], isotropic=True)
    assert "reciprocity" in names(measured_verdict(tilted))
    follows = replace(GOOD, projections=("theta_h-theta_d", "wo"), reciprocal=False)
    verdict = measured_verdict(tilted, follows)
    assert "reciprocity" not in names(verdict)
    assert verdict.figures.light.reciprocity > 0.1
    # The same freedom is a fault where the data are reciprocal.
    crooked = verdict_on(
        replace(samples, isotropic=True), replace(follows, smoothing=1e-4, projections=("theta_h", "wo"))
    )
    assert ("reciprocity" in names(crooked)) == (crooked.figures.light.reciprocity > 0.05)


@pytest.mark.slow
def test_outliers_noise_floor_and_cut_values_are_found() -> None:
    samples = drawn()
    spoiled = samples.values.clone()
    spoiled[::50] *= 300
    assert "outliers" in names(verdict_on(replace(samples, values=spoiled)))
    floor = replace(samples, values=(samples.values + 0.2 * samples.values.mean(0) * noise_like(samples)).clamp_min(0))
    assert "epsilon" in names(verdict_on(floor, epsilon=1e-5))
    assert "epsilon" not in names(verdict_on(floor, epsilon=0.2))


@pytest.mark.slow
def test_one_azimuth_of_an_anisotropic_material_is_found() -> None:
    samples = drawn("ward-brushed")
    flat: list[torch.Tensor] = []
    for w in (samples.wi, samples.wo):
        sine = w[:, :2].norm(dim=1) * torch.sign(w[:, 0])
        flat.append(torch.stack((sine, torch.zeros_like(sine), w[:, 2]), 1))
    wi, wo = flat
    values = material("ward-brushed").model.evaluate(wi, wo)
    plane = Samples(wi, wo, values, channels=samples.channels, isotropic=False)
    assert "azimuth" in names(verdict_on(plane, McCool(size=8), "ward-brushed"))
    assert "azimuth" not in names(verdict_on(samples, McCool(size=8), "ward-brushed"))


def test_svd_has_no_linear_system_to_judge() -> None:
    verdict = verdict_on(drawn(count=3000), Svd(textures=2, size=8))
    assert verdict.figures.system.condition is None
    assert verdict.figures.system.determined is None
    assert verdict.status is Status.DIRECT
