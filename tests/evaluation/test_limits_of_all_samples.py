"""Limits of a fit of all samples: its search's own validation stands for held-out samples, and they hold less often."""

from dataclasses import replace

import pytest
import torch

import homofact
from homofact.api.fit_facts import fit_facts
from homofact.brdf.materials import material
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model
from homofact.evaluation.compare import fit_and_measure
from homofact.evaluation.metrics import measure
from homofact.evaluation.verdict.verdict import Verdict
from homofact.methods.mccool import McCool
from homofact.methods.search import Search

QUICK = Search(textures=1, size=8, restarts=1, search_size=6, search_samples=300, effort=20)


@pytest.fixture(scope="module")
def samples() -> Samples:
    """Few and noisy samples, as a list without the word on how they were drawn."""
    drawn = sample_model(material("phong-30").model, 400, "lobe", 0)
    noise = torch.randn(drawn.values.shape, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    return replace(drawn, values=drawn.values * torch.exp(0.1 * noise), provenance={})


def judged(fit: homofact.Fit) -> Verdict:
    assert isinstance(fit.verdict, Verdict)
    return fit.verdict


def test_the_gap_is_that_of_the_validation(samples: Samples) -> None:
    fit = homofact.fit(samples, QUICK)
    assert fit.report is not None
    verdict = judged(fit)
    errors = verdict.figures.errors
    assert not errors.is_held_out
    seen = measure(fit.factorization, samples.rotated_at_random(0), fit.transform).log_mse
    validation = fit.report.details["validation_error"]
    assert validation > 1.2 * seen
    assert errors.gap == pytest.approx(validation / seen)
    assert "nine of ten" in verdict.summary
    assert {bar.rate for bar in verdict.bars.bars} == {0.9}


def test_a_method_without_validation_has_a_gap_of_one(samples: Samples) -> None:
    errors = judged(homofact.fit(samples, McCool(size=6))).figures.errors
    assert errors.gap == 1
    assert not errors.is_held_out


def test_held_out_samples_have_their_own_gap(samples: Samples) -> None:
    row = fit_and_measure(homofact.read(samples), QUICK, 0.2)
    errors = row.verdict.figures.errors
    assert errors.is_held_out
    assert errors.gap == pytest.approx(row.held_out.log_mse / row.train.log_mse)
    assert {bar.rate for bar in row.verdict.bars.bars} == {0.9}


def test_only_held_out_samples_make_the_advice_to_hold_none_out(samples: Samples) -> None:
    verdict = judged(homofact.fit(samples, QUICK))
    (found,) = (each for each in verdict.findings if each.name == "held-out")
    assert "hold some out" in found.remedy


def test_a_fit_says_what_was_undone_of_its_measurement(samples: Samples, tmp_path) -> None:
    tilt = {"undone": True, "left_in": False, "words": "the sample was tilted"}
    homofact.fit(replace(samples, provenance={"tilt": tilt}), QUICK).save(tmp_path / "a.npz")
    facts = fit_facts(tmp_path / "a.npz")
    assert facts is not None
    assert facts[1]["measurement"] == "the sample was tilted"
    homofact.fit(samples, QUICK).save(tmp_path / "b.npz")
    facts = fit_facts(tmp_path / "b.npz")
    assert facts is not None
    assert "measurement" not in facts[1]
