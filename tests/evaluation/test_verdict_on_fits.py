"""Every check of a fit on both sides of its threshold, on reflectances whose faults are made to measure."""

import math
from dataclasses import replace
from typing import Any

import pytest
import torch
from judged import MODEL, TEST, TRAIN, Altered, measured, names, noisy, seen, verdict
from torch import Tensor

from homofact.brdf.sampling import sample_model
from homofact.errors import Advice, Status
from homofact.evaluation.verdict import of_fit
from homofact.evaluation.verdict.finding import About, Finding, Grade, ordered
from homofact.evaluation.verdict.flux import flux_of
from homofact.methods.search import Search


def test_the_model_itself_has_nothing_against_it() -> None:
    assert names(verdict()) == set()


@pytest.mark.parametrize(("status", "found"), [(each, each.value in ("interrupted", "fallback")) for each in Status])
def test_endings(status: Status, found: bool) -> None:
    assert ("status" in names(verdict(status=status))) is found


@pytest.mark.parametrize(
    ("name", "good", "bad", "matters"),
    [
        ("condition", 0.9e12, 1.1e12, True),
        ("condition", 1.0, math.inf, True),
        ("determined", 0.51, 0.49, False),
        ("determined", 0.51, 0.24, True),
    ],
)
def test_the_system(name: str, good: Any, bad: Any, matters: bool) -> None:
    assert names(verdict(**{name: good})) == set()
    (found,) = verdict(**{name: bad}).findings
    assert found.name == name
    assert found.matters is matters


def test_the_worst_channel_is_what_is_explained() -> None:
    def without(values: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
        return torch.cat((values[:, :2], values[:, 2:].mean().expand(len(values), 1)), 1)

    found = verdict(Altered(without))
    assert "explained" in names(found)
    assert found.errors.explained < 0.2


@pytest.mark.parametrize(("factor", "found"), [(0.93, False), (0.97, False), (0.8, True), (1.3, True)])
def test_the_brightest_samples_tell_of_the_highlight(factor: float, found: bool) -> None:
    limit = float(TRAIN.values.mean(1).quantile(0.9))

    def scaled(values: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
        return torch.where(values.mean(1, keepdim=True) > limit, factor * values, values)

    one = verdict(Altered(scaled))
    assert one.light.highlight is not None
    assert abs(one.light.highlight - factor) < 0.3 * abs(factor - 1)
    assert any(each.name == "highlight" and each.matters for each in one.findings) is found


def test_a_band_that_is_off_is_named_with_its_channel_and_chance_is_none() -> None:
    def dim(values: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
        there = torch.rad2deg(torch.acos(wi[:, 2:])).floor()
        gain = torch.where((there >= 30) & (there < 45), 0.7, 1.0)
        return torch.cat((values[:, :1], values[:, 1:2] * gain, values[:, 2:]), 1)

    one = verdict(Altered(dim))
    assert one.light.off is not None
    assert 0.7 < one.light.off < 0.8  # what chance may do is taken off
    assert one.light.off_where == f"{MODEL.channels[1]} at θi from 30 to 45°"
    (light,) = (each for each in one.findings if each.name == "light")
    assert light.grade is Grade.SEVERE
    assert light.about is About.FIT
    assert one.summary.startswith(f"its light is off by {1 - one.light.off:.0%} ({one.light.off_where})")
    # So much noise moves a band of a few hundred samples by less than chance may.
    assert verdict(train=measured(noisy(0.3))).light.off == pytest.approx(1, abs=0.05)


@pytest.mark.parametrize(("share", "found"), [(0.005, False), (0.04, True)])
def test_light_that_is_cut_counts_where_the_data_are_not_zero(share: float, found: bool) -> None:
    order = torch.argsort(TEST.wi[:, 0])
    light = (flux_of(TEST) * TEST.values.mean(1))[order].cumsum(0)
    limit = float(TEST.wi[order, 0][int((light < share * light[-1]).sum())])

    def cut(values: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
        return torch.where(wi[:, :1] < limit, 0.0, values)

    one = verdict(Altered(cut))
    assert one.errors.cut == pytest.approx(share, rel=0.2, abs=2e-3)
    assert ("positivity" in names(one)) is found
    black = replace(TEST, values=cut(TEST.values, TEST.wi, TEST.wo))
    assert verdict(Altered(cut), test=black).errors.cut == 0


def test_energy_at_any_azimuth_of_an_anisotropic_material() -> None:
    def along_y(values: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
        return values * (1 + 4 * wi[:, 1:2] ** 2)

    one = verdict(Altered(along_y), train=replace(TRAIN, isotropic=False))
    assert "energy" in names(one)
    other = verdict(Altered(lambda values, wi, wo: values * (1 + 4 * wi[:, :1] ** 2)))
    assert "energy" in names(other)
    assert other.light.albedo == pytest.approx(one.light.albedo, rel=0.02)
    assert "energy" not in names(verdict(Altered(lambda values, wi, wo: 0.9 * values / verdict().light.albedo)))


@pytest.mark.parametrize("name", ["light", "highlight"])
@pytest.mark.parametrize(
    ("ratio", "grade"),
    [(0.94, "slight"), (0.96, None), (1.04, None), (1.12, "visible"), (0.8, "severe"), (0.0, "severe")],
)
def test_light_that_is_not_the_sources(name: str, ratio: float, grade: str | None) -> None:
    one = verdict(seen=seen(**{"albedo" if name == "light" else name: ratio}))
    assert names(one) == (set() if grade is None else {name})
    assert {"light": one.light.off, "highlight": one.light.highlight}[name] == pytest.approx(ratio)
    if grade is not None:
        (found,) = one.findings
        assert (found.grade.value, found.about) == (grade, About.FIT)
        assert found.light == pytest.approx(abs(ratio - 1))
        assert f"{ratio:.3g} of the source's light" in found.line()
        assert one.trusted is (grade == "slight")
        assert (one.recommended == Advice("size", 32)) is (grade != "slight")
        assert f"{MODEL.channels[1]} at θi = 5°" in found.found or name == "highlight"


def test_a_verdict_is_summed_up_in_a_sentence() -> None:
    one = verdict(seen=seen())
    assert one.summary == "its light is right to 3% at every angle"
    assert replace(one, coverage=replace(one.coverage, unmeasured=0.13)).summary == (
        "its light is right to 3% wherever it was measured; 13% of its light is where nothing was measured"
    )
    assert verdict(seen=seen(albedo=0.92, highlight=0.8)).summary == (
        "good for diffuse light, off by at most 8%; highlight (the brightest 1% of its light) 20% too dark"
    )
    assert verdict(seen=seen(albedo=1.5)).summary == f"its light is off by 50% ({MODEL.channels[1]} at θi = 5°)"


def test_light_is_judged_by_the_samples_where_the_source_cannot_be_asked() -> None:
    one = verdict()
    assert (one.light.source_albedo, one.light.floor) == (None, None)
    assert one.light.off == pytest.approx(1)
    assert one.light.highlight == pytest.approx(1)


def test_energy_that_is_made_at_grazing_angles_alone() -> None:
    limit = math.cos(math.radians(80))

    def grazing(values: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
        return torch.where(wi[:, 2:] < limit, 4 * values, values)

    one = verdict(Altered(grazing))
    assert one.light.albedo > 1.02 > verdict().light.albedo
    assert "energy" in names(one)


def test_data_that_are_not_reciprocal_are_the_datas_and_a_fit_that_is_not_is_the_fits() -> None:
    found = {each.name: each for each in verdict(seen=seen(floor=0.12, asymmetry=0.2)).findings}
    assert set(found) == {"reciprocity"}
    assert found["reciprocity"].about is About.DATA
    assert "20% of the light changes where light and viewer are swapped" in found["reciprocity"].found
    assert "no reciprocal fit comes nearer to this source than 12% RMS" in found["reciprocity"].found
    assert names(verdict(seen=seen(floor=0.04, asymmetry=0.03))) == set()
    # Nor is one that a search has made so by the data's own word, where no source can be asked.
    skewed = Altered(lambda values, wi, wo: values * torch.where(wi[:, 2:] > wo[:, 2:], 1.5, 1.0))
    assert "reciprocity" not in names(verdict(skewed, settings=Search()))
    assert "reciprocity" in names(verdict(skewed, settings=Search(), seen=seen()))
    # A fit that follows such a source is not blamed for not being reciprocal either.
    crooked = Altered(lambda values, wi, wo: values * torch.where(wi[:, 2:] > wo[:, 2:], 1.5, 1.0))
    (own,) = (each for each in verdict(crooked).findings if each.name == "reciprocity")
    assert own.about is About.FIT
    assert "reciprocity" not in names(verdict(crooked, seen=seen(floor=0.12, asymmetry=0.2)))
    # What is not explained may be what no reciprocal fit could.
    flat = Altered(lambda values, *_: values.mean(0).expand_as(values))
    for floor, said in ((0.12, True), (0.005, False)):
        one = next(each for each in verdict(flat, seen=seen(floor=floor)).findings if each.name == "explained")
        assert ("RMS of f cosθi cosθo)" in one.found) is said


@pytest.mark.parametrize(("power", "found"), [(0.05, False), (0.5, True)])
def test_reciprocity_of_the_fit(power: float, found: bool) -> None:
    def crooked(values: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
        return values * torch.where(wi[:, 2:] > wo[:, 2:], 1 + power, 1.0)

    assert ("reciprocity" in names(verdict(Altered(crooked)))) is found


def test_light_is_weighted_by_both_cosines_whatever_the_sampling() -> None:
    """Of all light on and off a white surface the mean cosine is ∫cos²/∫cos = 2/3 of either direction."""
    for scheme in ("discs", "lobe", "cosine"):
        samples = sample_model(MODEL, 20_000, scheme, seed=5)
        flux = flux_of(samples)
        for direction in (samples.wi, samples.wo):
            assert float((flux * direction[:, 2]).sum() / flux.sum()) == pytest.approx(2 / 3, abs=0.02)


def test_what_is_explained_is_that_of_the_discs_whatever_the_sampling() -> None:
    def flat_outside(values: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
        h = (wi + wo) / (wi + wo).norm(dim=1, keepdim=True)
        return torch.where(h[:, 2:] > 0.95, values, TRAIN.values.mean(0).expand_as(values))

    found = [
        verdict(Altered(flat_outside), test=sample_model(MODEL, 20_000, scheme, seed=6)).errors.explained
        for scheme in ("discs", "lobe")
    ]
    assert found[0] == pytest.approx(found[1], abs=0.03)


def test_findings_are_ordered_by_what_a_picture_shows_of_them() -> None:
    def finding(name: str, about: About, light: float | None, least: Grade = Grade.SLIGHT) -> Finding:
        return Finding(name, about, light, "found", "remedy", least=least)

    given = [
        finding("d", About.UNKNOWN, 0.12),
        finding("a", About.DATA, 0.9),
        finding("e", About.FIT, 0.02),
        finding("c", About.FIT, None, Grade.VISIBLE),
        finding("b", About.DATA, 0.2),
    ]
    assert [each.name for each in ordered(given)] == ["a", "b", "c", "d", "e"]
    assert [each.grade.value for each in ordered(given)] == ["severe", "severe", "visible", "visible", "slight"]


@pytest.mark.parametrize(("factor", "found"), [(0.8, False), (0.5, True), (1.3, False), (1.8, True)])
def test_the_albedo_of_a_fit_has_no_steps(factor: float, found: bool) -> None:
    def dip(values: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
        return torch.where(wi[:, 2:] > math.cos(math.radians(7)), factor * values, values)

    one = verdict(Altered(dip))
    assert one.light.step == pytest.approx(factor, rel=0.05)
    assert ("step" in names(one)) is found
    if found:
        (step,) = (each for each in one.findings if each.name == "step")
        assert step.about is About.FIT
        assert "θi = 0° over 15°" in step.found


def test_what_is_explained_of_a_source_is_asked_of_it() -> None:
    seen_at = replace(seen(), explained=0.8)
    one = verdict(seen=seen_at)
    assert one.errors.explained == 0.8
    (found,) = (each for each in one.findings if each.name == "explained")
    assert "80% of the variation of the source's logarithms" in found.found
    assert verdict(seen=replace(seen(), explained=None)).errors.explained > 0.99


def test_a_narrow_highlight_asks_for_as_many_texels_as_hold_it() -> None:
    light = replace(verdict().light, texels_across=of_fit.LEAST_ACROSS / 3)
    (found,) = (each for each in of_fit._light(light, Search(size=10)) if each.name == "narrow")
    assert found.advice == Advice("size", 30)
