"""Fits of all samples: what `factorize` makes of `held_out=0`, what its figures are called, and when it is advised."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch
from pictured import no_looks, small_spheres

import homofact
from homofact.api.factorizing import FactorizeResult, caption
from homofact.brdf.materials import material
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model
from homofact.brdf.source import Source, source_of
from homofact.cli.tables import error_table
from homofact.errors import BadInput
from homofact.evaluation.compare import fit_and_measure, fit_split
from homofact.evaluation.metrics import measure
from homofact.evaluation.split import Split
from homofact.evaluation.verdict.verdict import Verdict
from homofact.methods.mccool import McCool

SMALL = McCool(projections=("theta_h-theta_d",), size=6)


def measurement(count: int = 400) -> Source:
    samples = replace(sample_model(material("phong-10").model, count, "discs", 0), provenance={})
    return source_of(samples)


@pytest.fixture(scope="module")
def every(tmp_path_factory: pytest.TempPathFactory) -> FactorizeResult:
    with no_looks(), small_spheres():
        return homofact.factorize(measurement(), tmp_path_factory.mktemp("all") / "fit", SMALL, held_out=0)


def note(verdict: Verdict, about: str) -> str:
    found = [each.found for each in verdict.findings if each.name == "held-out" and each.about.value == about]
    return found[0] if found else ""


def test_all_samples_are_fitted_and_the_errors_are_called_errors_of_the_source(every: FactorizeResult) -> None:
    assert every.fit.provenance["samples"] == 400
    assert set(every.report["error"]) == set(every.report["mccool"]["error"]) == {"train", "source"}
    expected = measure(every.fit, measurement().samples.rotated_at_random(SMALL.seed), every.fit.transform)
    assert every.report["error"]["source"] == pytest.approx(expected.record())
    kept = homofact.load(every.folder).provenance["source"]["split"]
    assert kept["held_out"] == 0
    assert kept["samples"] == 400


def test_no_line_calls_them_held_out(every: FactorizeResult) -> None:
    table = error_table(every.records())
    assert [len(list(column.cells)) for column in table.columns][:2] == [2, 2]
    assert "held out" not in list(table.columns[1].cells)
    record = every.report
    assert "held out" not in " ".join(caption(record))
    held = {"error": {"held_out": record["error"]["source"], "train": record["error"]["train"]}}
    assert "held out" in " ".join(caption(record | held))


def test_the_verdict_says_that_nothing_was_held_out_of_samples_alone(every: FactorizeResult, tmp_path: Path) -> None:
    assert note(every.row.verdict, "unknown")
    assert note(every.row.verdict, "fit") == ""
    # A model can be asked everywhere, and the verdict is measured on it.
    with no_looks(), small_spheres():
        asked = homofact.factorize("material:phong-10", tmp_path / "model", SMALL, held_out=0)
    assert note(asked.row.verdict, "unknown") == ""
    assert note(fit_and_measure(measurement(), SMALL).verdict, "unknown") == ""


def with_a_spike(height: float) -> Source:
    """A measurement whose held-out samples alone know a narrow highlight."""
    source = measurement()
    held = source.samples.split(0.2, SMALL.seed)[1]
    mirror = int((held.values[:, 0] * held.wi[:, 2] * held.wo[:, 2]).argmax())
    same = (source.samples.wi == held.wi[mirror]).all(1) & (source.samples.wo == held.wo[mirror]).all(1)
    values = torch.where(same[:, None], source.samples.values * height, source.samples.values)
    return replace(source, samples=replace(source.samples, values=values))


def test_light_that_only_held_out_samples_show_is_named_with_the_setting_that_fits_them() -> None:
    verdict = fit_and_measure(with_a_spike(1e4), SMALL).verdict
    assert verdict.figures.errors.gap > 2
    (found,) = (each for each in verdict.findings if each.name == "held-out")
    assert found.advice is not None
    assert (found.advice.setting, found.advice.value) == ("held_out", 0)
    assert f"{verdict.figures.errors.gap:.2g} times" in found.found


def test_the_brightest_sample_is_named_whether_it_was_held_out_or_not() -> None:
    source = with_a_spike(1e4)
    brightest = int(source.samples.values.mean(1).argmax())
    row = fit_and_measure(source, SMALL)
    light = row.verdict.figures.light
    assert light.peak == pytest.approx(float(source.samples.values[brightest].mean()))
    # The fit has not seen it.
    assert light.peak_fit < 0.01 * light.peak
    wi, wo = source.samples.wi[brightest], source.samples.wo[brightest]
    degrees = [float(torch.rad2deg(torch.acos(w[2]))) for w in (wi, wo)]
    assert light.peak_where.startswith("θi {:.0f}°, θo {:.0f}°, Δφ ".format(*degrees))
    apart = float(torch.rad2deg(torch.atan2(wo[1], wo[0]) - torch.atan2(wi[1], wi[0]))) % 360
    assert light.peak_where.endswith(f"Δφ {min(apart, 360 - apart):.0f}°")
    every = fit_split(source, Split.of(source, 0.0, 0), SMALL)
    assert every.verdict.figures.light.peak_fit > 10 * light.peak_fit


def test_a_large_ratio_of_errors_that_cost_no_light_is_not_named() -> None:
    exact = McCool(projections=("theta_h-theta_d", "theta_d-phi_d"), size=12, smoothing=1e-6)
    samples = measurement().samples
    held = samples.split(0.2, exact.seed)[1]
    # One part in a thousand at held-out samples alone: many times the training error, and no light.
    odd = torch.isin(samples.wi[:, 0], held.wi[:, 0])
    values = torch.full_like(samples.values, 0.3) * torch.where(odd, 1.001, 1.0)[:, None]
    verdict = fit_and_measure(source_of(replace(samples, values=values)), exact).verdict
    assert verdict.figures.errors.gap > 2
    assert note(verdict, "fit") == ""


COMPARED: dict[str, Callable[[Samples, Path, float], Any]] = {
    "compare": lambda samples, folder, part: homofact.compare(samples, [SMALL], held_out=part),
    "chart": lambda samples, folder, part: homofact.chart(samples, folder / "chart", {"own": SMALL}, held_out=part),
    "terms": lambda samples, folder, part: homofact.terms("material:phong-10", method=SMALL, held_out=part),
}


@pytest.mark.parametrize("part", [0.0, 1.0, -0.1])
@pytest.mark.parametrize("function", COMPARED)
def test_a_comparison_needs_held_out_samples(tmp_path: Path, function: str, part: float) -> None:
    with pytest.raises(BadInput) as refused:
        COMPARED[function](measurement().samples, tmp_path, part)
    assert refused.value.where == "held_out"
    assert refused.value.found == f"{part:g}"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("part", [1.0, 1.5, -0.1])
def test_factorize_takes_no_part_beyond_all_and_nothing(tmp_path: Path, part: float) -> None:
    with pytest.raises(BadInput) as refused:
        homofact.factorize(measurement(), tmp_path / "fit", SMALL, held_out=part)
    assert "held-out" in refused.value.where
    assert list(tmp_path.iterdir()) == []
