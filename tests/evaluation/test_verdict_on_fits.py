"""Every check of a fit on both sides of its threshold, on reflectances whose faults are made to measure."""

import math
from dataclasses import replace
from typing import Any

import pytest
import torch
from judged import MODEL, TEST, TRAIN, Altered, measured, names, noisy, seen, verdict
from torch import Tensor

from homofact.brdf.log_transform import LogTransform
from homofact.brdf.sampling import sample_model
from homofact.errors import Advice, Status
from homofact.evaluation.bar.error_bar import BarKind
from homofact.evaluation.verdict.finding import About, Finding, ordered
from homofact.evaluation.verdict.flux import flux_of
from homofact.evaluation.verdict.noting import LEAST_ACROSS, Noted, of_the_figures
from homofact.methods.search import Search


def test_the_model_itself_has_nothing_against_it() -> None:
    assert names(verdict()) == set()


@pytest.mark.parametrize(("status", "found"), [(each, each.value in ("interrupted", "fallback")) for each in Status])
def test_endings(status: Status, found: bool) -> None:
    assert ("status" in names(verdict(status=status))) is found


@pytest.mark.parametrize(
    ("name", "good", "bad"),
    [("condition", 0.9e12, 1.1e12), ("condition", 1.0, math.inf), ("determined", 0.51, 0.49)],
)
def test_the_system(name: str, good: Any, bad: Any) -> None:
    assert names(verdict(**{name: good})) == set()
    (found,) = verdict(**{name: bad}).findings
    assert found.name == name


def test_the_worst_channel_is_what_is_explained() -> None:
    def without(values: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
        return torch.cat((values[:, :2], values[:, 2:].mean().expand(len(values), 1)), 1)

    found = verdict(Altered(without))
    assert "explained" in names(found)
    assert found.figures.errors.explained < 0.2


@pytest.mark.parametrize(("factor", "found"), [(0.97, False), (0.8, True), (1.3, True)])
def test_the_brightest_samples_tell_of_the_highlight(factor: float, found: bool) -> None:
    limit = float(TRAIN.values.mean(1).quantile(0.9))

    def scaled(values: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
        return torch.where(values.mean(1, keepdim=True) > limit, factor * values, values)

    one = verdict(Altered(scaled))
    assert one.figures.light.highlight is not None
    assert abs(one.figures.light.highlight - factor) < 0.3 * abs(factor - 1)
    assert ("highlight" in names(one)) is found


def test_a_band_that_is_off_is_named_with_its_channel_and_chance_is_none() -> None:
    def dim(values: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
        there = torch.rad2deg(torch.acos(wi[:, 2:])).floor()
        gain = torch.where((there >= 30) & (there < 45), 0.7, 1.0)
        return torch.cat((values[:, :1], values[:, 1:2] * gain, values[:, 2:]), 1)

    one = verdict(Altered(dim))
    assert one.figures.light.off is not None
    assert 0.7 < one.figures.light.off < 0.8  # what chance may do is taken off
    assert one.figures.light.off_where == f"{MODEL.channels[1]} at θi from 30 to 45°"
    (light,) = (each for each in one.findings if each.name == "light")
    assert light.about is About.FIT
    assert one.figures.light.off_where in light.found
    assert f"at most {one.figures.light.off:.3g} times" in light.found
    # So much noise moves a band of a few hundred samples by less than chance may.
    assert verdict(train=measured(noisy(0.3))).figures.light.off == pytest.approx(1, abs=0.05)


@pytest.mark.parametrize(("share", "found"), [(0.005, False), (0.04, True)])
def test_light_that_is_cut_counts_where_the_data_are_not_zero(share: float, found: bool) -> None:
    order = torch.argsort(TEST.wi[:, 0])
    light = (flux_of(TEST) * TEST.values.mean(1))[order].cumsum(0)
    limit = float(TEST.wi[order, 0][int((light < share * light[-1]).sum())])

    def cut(values: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
        return torch.where(wi[:, :1] < limit, 0.0, values)

    one = verdict(Altered(cut))
    assert one.figures.errors.cut == pytest.approx(share, rel=0.2, abs=2e-3)
    assert ("positivity" in names(one)) is found
    black = replace(TEST, values=cut(TEST.values, TEST.wi, TEST.wo))
    assert verdict(Altered(cut), test=black).figures.errors.cut == 0


@pytest.mark.slow
def test_energy_at_any_azimuth_of_an_anisotropic_material() -> None:
    def along_y(values: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
        return values * (1 + 4 * wi[:, 1:2] ** 2)

    one = verdict(Altered(along_y), train=replace(TRAIN, isotropic=False))
    assert "energy" in names(one)
    other = verdict(Altered(lambda values, wi, wo: values * (1 + 4 * wi[:, :1] ** 2)))
    assert "energy" in names(other)
    assert other.figures.light.albedo == pytest.approx(one.figures.light.albedo, rel=0.02)
    assert "energy" not in names(verdict(Altered(lambda values, wi, wo: 0.9 * values / verdict().figures.light.albedo)))


@pytest.mark.parametrize("name", ["light", "highlight"])
@pytest.mark.parametrize(
    ("ratio", "found"), [(0.94, True), (0.96, False), (1.04, False), (1.12, True), (0.8, True), (0.0, True)]
)
def test_light_that_is_not_the_sources(name: str, ratio: float, found: bool) -> None:
    one = verdict(seen=seen(**{"albedo" if name == "light" else name: ratio}))
    assert names(one) == ({name} if found else set())
    assert {"light": one.figures.light.off, "highlight": one.figures.light.highlight}[name] == pytest.approx(ratio)
    if found:
        (noted,) = one.findings
        assert noted.about is About.FIT
        assert f"reflects {ratio:.3g} times the source's light" in noted.line()
        assert f"{MODEL.channels[1]} at θi = 5°" in noted.found or name == "highlight"
    # A fit is bad by its albedo alone: what the highlight lacks is in its own bar.
    assert one.trusted is (name == "highlight" or 1 / 1.15 <= ratio <= 1.15)
    assert one.recommended == (None if one.trusted else Advice("size", 32))


@pytest.mark.parametrize(("albedo", "highlight"), [(1.0, 1.0), (0.92, 1.3), (1.5, 0.8)])
def test_of_a_source_that_was_asked_the_errors_are_measured(albedo: float, highlight: float) -> None:
    given = replace(seen(albedo=albedo, highlight=highlight), off_sky=0.07, off_light=0.2)
    bars = verdict(seen=given).bars
    assert bars.kind is BarKind.MEASURED
    expected = {"albedo": max(albedo, 1 / albedo) - 1, "highlight": max(highlight, 1 / highlight) - 1}
    for name, error in (expected | {"sky": 0.07, "lamp": 0.2}).items():
        bar = bars.of(name)
        assert bar.error == pytest.approx(error)
        assert bar.rate == 1
    # What an eye would tell makes it bad; what logarithms of a nearly diffuse material miss does not.
    assert verdict(seen=replace(given, explained=0.5)).trusted is (albedo != 1.5)
    assert verdict(seen=replace(given, off_sky=0.11)).trusted is False
    assert verdict(seen=replace(given, off_light=0.26)).trusted is False


def test_light_is_judged_by_the_samples_where_the_source_cannot_be_asked() -> None:
    one = verdict()
    assert (one.figures.light.source_albedo, one.figures.light.floor) == (None, None)
    assert one.figures.light.off == pytest.approx(1)
    assert one.figures.light.highlight == pytest.approx(1)


def test_energy_that_is_made_at_grazing_angles_alone() -> None:
    limit = math.cos(math.radians(80))

    def grazing(values: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
        return torch.where(wi[:, 2:] < limit, 4 * values, values)

    one = verdict(Altered(grazing))
    assert one.figures.light.albedo > 1.02 > verdict().figures.light.albedo
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
        verdict(Altered(flat_outside), test=sample_model(MODEL, 20_000, scheme, seed=6)).figures.errors.explained
        for scheme in ("discs", "lobe")
    ]
    assert found[0] == pytest.approx(found[1], abs=0.03)


def test_findings_are_ordered_by_whose_they_are_and_by_what_they_cost() -> None:
    def finding(name: str, about: About, cost: float | None) -> Finding:
        return Finding(name, about, "found", "remedy", cost=cost)

    given = [
        finding("e", About.UNKNOWN, 9.0),
        finding("c", About.DATA, 1.3),
        finding("d", About.DATA, None),
        finding("a", About.FIT, 2.0),
        finding("b", About.FIT, 1.05),
    ]
    assert [each.name for each in ordered(given)] == ["a", "b", "c", "d", "e"]
    assert [bool(each.costs) for each in ordered(given)] == [True, False, True, False, True]


@pytest.mark.parametrize(("factor", "found"), [(0.8, False), (0.5, True), (1.3, False), (1.8, True)])
def test_the_albedo_of_a_fit_has_no_steps(factor: float, found: bool) -> None:
    def dip(values: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
        return torch.where(wi[:, 2:] > math.cos(math.radians(7)), factor * values, values)

    one = verdict(Altered(dip))
    assert one.figures.light.step == pytest.approx(factor, rel=0.05)
    assert ("step" in names(one)) is found
    if found:
        (step,) = (each for each in one.findings if each.name == "step")
        assert step.about is About.FIT
        assert "θi = 0° over 15°" in step.found


def test_what_is_explained_of_a_source_is_asked_of_it() -> None:
    seen_at = replace(seen(), explained=0.8)
    one = verdict(seen=seen_at)
    assert one.figures.errors.explained == 0.8
    (found,) = (each for each in one.findings if each.name == "explained")
    assert "20% of the variation of the source's logarithms" in found.found
    assert verdict(seen=replace(seen(), explained=None)).figures.errors.explained > 0.99


def test_a_narrow_highlight_asks_for_as_many_texels_as_hold_it() -> None:
    one = verdict(settings=Search(size=10, reciprocal=False))
    narrow = replace(one.figures.light, texels_across=LEAST_ACROSS / 3)
    fitted: Any = Altered()
    noted = Noted(fitted, replace(one.figures, light=narrow), Search(size=10, reciprocal=False), TRAIN, one.status)
    (found,) = of_the_figures(noted)
    assert (found.name, found.advice) == ("narrow", Advice("size", 30))
    # Beside a number of bytes a size is not read: three times as wide are nine times as many.
    (found,) = of_the_figures(replace(noted, settings=Search(bytes=6144, reciprocal=False)))
    assert found.advice == Advice("bytes", 9 * 6144)
    across = replace(narrow, texels_across=LEAST_ACROSS * 1.01)
    assert list(of_the_figures(replace(noted, figures=replace(one.figures, light=across)))) == []


def test_a_setting_that_the_fit_was_made_with_is_not_advised() -> None:
    one = verdict(settings=Search(size=10, reciprocal=False))
    zeros = replace(one.figures, data=replace(one.figures.data, dark=0.2))
    fitted: Any = Altered(transform=LogTransform.of(TRAIN, 0.1))
    for epsilon, expected in ((None, Advice("epsilon", 0.1)), (0.1, None)):
        noted = Noted(fitted, zeros, Search(size=10, reciprocal=False, epsilon=epsilon), TRAIN, one.status)
        (found,) = (each for each in of_the_figures(noted) if each.name == "zeros")
        assert found.advice == expected


def test_gains_that_were_looked_for_are_not_advised_again() -> None:
    one = verdict(settings=Search(size=10, reciprocal=False))
    ring = replace(one.figures, data=replace(one.figures.data, ring=0.5, ring_where="θi = 20°"))
    fitted: Any = Altered()
    for gains, expected in (({}, Advice("calibrate", "rings")), ({"rings": {"removed": False}}, None)):
        train = replace(TRAIN, provenance=TRAIN.provenance | {"gains": gains})
        noted = Noted(fitted, ring, Search(size=10, reciprocal=False), train, one.status)
        (found,) = (each for each in of_the_figures(noted) if each.name == "ring")
        assert found.advice == expected


def test_a_ring_is_not_named_under_a_fit_that_is_far_from_all_its_samples() -> None:
    one = verdict(settings=Search(size=10, reciprocal=False))
    data = replace(one.figures.data, ring=0.5, ring_where="θi = 20°")
    for misplaced, named in ((0.19, True), (0.21, False)):
        figures = replace(one.figures, data=data, errors=replace(one.figures.errors, misplaced=misplaced))
        noted = Noted(Altered(), figures, Search(size=10, reciprocal=False), TRAIN, one.status)  # pyright: ignore[reportArgumentType]
        assert any(each.name == "ring" for each in of_the_figures(noted)) is named
