"""Every check of a verdict on both sides of its threshold, on reflectances whose faults are made to measure."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import pytest
import torch
from torch import Tensor

from homofact.brdf.analytic import Ward
from homofact.brdf.log_transform import LogTransform
from homofact.brdf.materials import material
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model
from homofact.errors import Report, Status
from homofact.evaluate.appearance import Appearance
from homofact.evaluate.energy import EnergyErrors
from homofact.evaluate.metrics import SixErrors
from homofact.evaluate.verdict import flux
from homofact.evaluate.verdict.finding import About, Finding, Grade, ordered
from homofact.evaluate.verdict.flux import asymmetry_of_samples, flux_of
from homofact.evaluate.verdict.judge import judge
from homofact.evaluate.verdict.verdict import Verdict
from homofact.geometry.directions import from_spherical
from homofact.methods.search import Search

MODEL = material("phong-10").model
TRAIN, TEST = (sample_model(MODEL, 3000, seed=seed) for seed in (0, 1))
Change = Callable[[Tensor, Tensor, Tensor], Tensor]


@dataclass(frozen=True)
class Altered:
    """A model's values put through `change(values, wi, wo)`: a `Fitted` with the fault that a test asks for."""

    change: Change = field(default=lambda values, wi, wo: values)
    transform: LogTransform = field(default_factory=lambda: LogTransform.of(TRAIN, 1e-2))
    channels: tuple[str, ...] = MODEL.channels
    nbytes: int = 4
    fetches: int = 1
    terms: tuple[Any, ...] = ()
    provenance: dict[str, Any] = field(default_factory=dict)

    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        return self.change(MODEL.evaluate(wi, wo), wi, wo)

    def save(self, path: object) -> None:
        raise AssertionError("a verdict saves nothing")


def errors(log_mse: float) -> SixErrors:
    return SixErrors(log_mse, 0, 0, 0, 0, 0)


def verdict(
    fitted: Altered | None = None,
    train: Samples = TRAIN,
    test: Samples = TEST,
    log_mse: tuple[float, float] = (1e-4, 1e-4),
    status: Status = Status.DIRECT,
    seen: Appearance | None = None,
    settings: Search = Search(reciprocal=False),  # noqa: B008
    **details: Any,
) -> Verdict:
    report = Report(status, 0, 0, 0.0, 0.0, 0, details=details)
    pair = (errors(log_mse[0]), errors(log_mse[1]))
    whole: Any = fitted or Altered()
    return judge(whole, report, settings, train, test, pair, seen)


def names(found: Verdict) -> set[str]:
    return {finding.name for finding in found.findings}


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


def noisy(level: float) -> Samples:
    noise = torch.randn(TRAIN.values.shape, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    return replace(TRAIN, values=TRAIN.values * torch.exp(level * noise))


def test_the_worst_channel_is_what_is_explained() -> None:
    def without(values: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
        return torch.cat((values[:, :2], values[:, 2:].mean().expand(len(values), 1)), 1)

    found = verdict(Altered(without))
    assert "explained" in names(found)
    assert found.explained < 0.2


def measured(samples: Samples) -> Samples:
    """The samples as a measurement, whose source nobody can ask."""
    return replace(samples, provenance={})


@pytest.mark.parametrize(("factor", "found"), [(0.93, False), (0.97, False), (0.8, True), (1.3, True)])
def test_the_brightest_samples_tell_of_the_highlight(factor: float, found: bool) -> None:
    limit = float(TRAIN.values.mean(1).quantile(0.9))

    def scaled(values: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
        return torch.where(values.mean(1, keepdim=True) > limit, factor * values, values)

    one = verdict(Altered(scaled))
    assert one.highlight is not None
    assert abs(one.highlight - factor) < 0.3 * abs(factor - 1)
    assert any(each.name == "highlight" and each.matters for each in one.findings) is found


def test_noise_makes_no_highlight_too_dark() -> None:
    one = verdict(train=measured(noisy(0.3)))
    assert one.highlight == pytest.approx(1, abs=0.1)


def test_a_band_that_is_off_is_named_with_its_channel_and_chance_is_none() -> None:
    def dim(values: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
        there = torch.rad2deg(torch.acos(wi[:, 2:])).floor()
        gain = torch.where((there >= 30) & (there < 45), 0.7, 1.0)
        return torch.cat((values[:, :1], values[:, 1:2] * gain, values[:, 2:]), 1)

    one = verdict(Altered(dim))
    assert one.off is not None
    assert 0.7 < one.off < 0.8  # what chance may do is taken off
    assert one.off_where == f"{MODEL.channels[1]} at θi from 30 to 45°"
    (light,) = (each for each in one.findings if each.name == "light")
    assert light.grade is Grade.SEVERE
    assert light.about is About.FIT
    assert one.summary.startswith(f"its light is off by {1 - one.off:.0%} ({one.off_where})")
    # So much noise moves a band of a few hundred samples by less than chance may.
    assert verdict(train=measured(noisy(0.3))).off == pytest.approx(1, abs=0.05)


@pytest.mark.parametrize(("share", "found"), [(0.005, False), (0.04, True)])
def test_light_that_is_cut_counts_where_the_data_are_not_zero(share: float, found: bool) -> None:
    order = torch.argsort(TEST.wi[:, 0])
    light = (flux_of(TEST) * TEST.values.mean(1))[order].cumsum(0)
    limit = float(TEST.wi[order, 0][int((light < share * light[-1]).sum())])

    def cut(values: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
        return torch.where(wi[:, :1] < limit, 0.0, values)

    one = verdict(Altered(cut))
    assert one.cut == pytest.approx(share, rel=0.2, abs=2e-3)
    assert ("positivity" in names(one)) is found
    black = replace(TEST, values=cut(TEST.values, TEST.wi, TEST.wo))
    assert verdict(Altered(cut), test=black).cut == 0


def test_energy_at_any_azimuth_of_an_anisotropic_material() -> None:
    def along_y(values: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
        return values * (1 + 4 * wi[:, 1:2] ** 2)

    one = verdict(Altered(along_y), train=replace(TRAIN, isotropic=False))
    assert "energy" in names(one)
    other = verdict(Altered(lambda values, wi, wo: values * (1 + 4 * wi[:, :1] ** 2)))
    assert "energy" in names(other)
    assert other.albedo == pytest.approx(one.albedo, rel=0.02)
    assert "energy" not in names(verdict(Altered(lambda values, wi, wo: 0.9 * values / verdict().albedo)))


def test_the_floor_of_the_noise_is_held_against_epsilon() -> None:
    noise = torch.randn(TRAIN.values.shape, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    floor = replace(TRAIN, values=(TRAIN.values + 0.06 * TRAIN.values.mean(0) * noise).clamp_min(0))
    for epsilon, found in ((6e-3, True), (0.03, False)):
        fitted = Altered(transform=LogTransform.of(floor, epsilon))
        assert ("epsilon" in names(verdict(fitted, train=floor, log_mse=(0.1, 0.1)))) is found
        # Nothing stood in the way of a fit that meets its data.
        assert "epsilon" not in names(verdict(fitted, train=floor, log_mse=(0.002, 0.002)))


@pytest.mark.parametrize(("share", "found"), [(0.005, False), (0.03, True)])
def test_zeros_of_one_channel_are_enough_where_there_should_be_light(share: float, found: bool) -> None:
    values = TRAIN.values.clone()
    values[: round(share * len(values)), 1] = 0
    one = verdict(train=replace(TRAIN, values=values))
    assert one.zeros == pytest.approx(share, abs=1e-3)
    assert one.dark == pytest.approx(share, rel=0.6)
    assert ("zeros" in names(one)) is found
    # A third of all samples, where next to nothing is reflected, is no matter of the light.
    flux = flux_of(TRAIN) * TRAIN.values.mean(1)
    dark = flux < flux.quantile(0.3)
    one = verdict(train=replace(TRAIN, values=torch.where(dark[:, None], 0.0, TRAIN.values)))
    assert one.zeros > 0.25
    assert one.dark < 0.1


def test_few_samples_far_off_are_outliers_and_many_are_none() -> None:
    def spoilt(every: int) -> Samples:
        values = noisy(0.01).values.clone()
        values[::every] *= 20
        return replace(TRAIN, values=values)

    def said(samples: Samples, log_mse: float = 0.1) -> set[str]:
        return names(verdict(train=samples, log_mse=(log_mse, log_mse)))

    assert "outliers" in said(spoilt(50))
    assert "outliers" not in said(spoilt(50), 0.002)
    assert "outliers" not in said(spoilt(10))
    assert "outliers" not in said(noisy(0.01))


def test_samples_that_are_repeated_count_where_they_differ() -> None:
    def doubled(factor: float) -> Samples:
        both = {name: torch.cat((getattr(TRAIN, name), getattr(TRAIN, name))) for name in ("wi", "wo", "weights")}
        return replace(TRAIN, **both, values=torch.cat((TRAIN.values, factor * TRAIN.values)))

    assert verdict(train=doubled(1.0)).repeated == pytest.approx(0, abs=1e-12)
    one = verdict(train=doubled(1.5))
    # Both are a fifth of their mean off it.
    assert one.repeated == pytest.approx(0.2, abs=1e-6)
    assert "repeated" in names(one)


def rings(gain: float) -> Samples:
    """A goniometer's samples, those of one ring of θi brighter by `gain`."""
    theta = torch.arange(10, 80, 10, dtype=torch.float64).deg2rad()
    theta_i, theta_o, phi = torch.meshgrid(theta, theta, torch.linspace(0, 3.1, 12, dtype=torch.float64), indexing="ij")
    wi = from_spherical(theta_i.reshape(-1), torch.zeros(theta_i.numel(), dtype=torch.float64))
    wo = from_spherical(theta_o.reshape(-1), phi.reshape(-1))
    values = MODEL.evaluate(wi, wo) * torch.where((theta_i.reshape(-1, 1) - theta[3]).abs() < 1e-9, gain, 1.0)
    return Samples.make(wi, wo, values, channels=MODEL.channels, isotropic=True)


@pytest.mark.parametrize(("gain", "found"), [(1.0, False), (1.05, False), (1.25, True), (0.75, True)])
def test_a_ring_of_another_gain(gain: float, found: bool) -> None:
    one = verdict(train=rings(gain), log_mse=(0.01, 0.01))
    assert ("ring" in names(one)) is found
    assert one.ring == pytest.approx(gain, rel=0.02)
    if found:
        assert one.ring_where == "θi = 40°"


def test_what_lies_between_samples_or_beyond_them_is_not_known() -> None:
    peaked = measured(replace(TRAIN, values=TRAIN.values.clone()))
    generator = torch.Generator().manual_seed(0)
    struck = torch.randperm(len(TRAIN), generator=generator)[:8]
    peaked.values[struck] *= 300
    one = verdict(Altered(), train=peaked)
    assert one.unresolved > 0.9
    assert "sampling" in names(one)
    assert verdict(train=measured(TRAIN)).unresolved < 0.4
    near = TRAIN.select((TRAIN.wi[:, 2] > 0.7) & (TRAIN.wo[:, 2] > 0.7))
    narrow = verdict(train=measured(near))
    assert 0.2 < narrow.unmeasured < 0.9
    (coverage,) = (each for each in narrow.findings if each.name == "coverage")
    assert coverage.about is About.UNKNOWN
    assert coverage.light == narrow.unmeasured
    # A fault that is nobody's but the measurement's leaves the fit trusted.
    assert narrow.trusted
    assert verdict(train=TRAIN).unmeasured == 0


def seen(albedo: float = 1.0, highlight: float = 1.0, floor: float = 0.0, asymmetry: float = 0.0) -> Appearance:
    """An appearance of one angle and two channels, the second of them reflecting `albedo` of the source's light."""
    light = EnergyErrors(
        (5.0,), ((0.5, 0.5),), ((0.5, 0.5 * albedo),), (1.0, 1.0), 1.0, 0.1, floor, highlight, 1.0, None, asymmetry
    )
    return Appearance(light, 30.0, 30.0)


@pytest.mark.parametrize("name", ["light", "highlight"])
@pytest.mark.parametrize(
    ("ratio", "grade"),
    [(0.94, "slight"), (0.96, None), (1.04, None), (1.12, "visible"), (0.8, "severe"), (0.0, "severe")],
)
def test_light_that_is_not_the_sources(name: str, ratio: float, grade: str | None) -> None:
    one = verdict(seen=seen(**{"albedo" if name == "light" else name: ratio}))
    assert names(one) == (set() if grade is None else {name})
    assert {"light": one.off, "highlight": one.highlight}[name] == pytest.approx(ratio)
    if grade is not None:
        (found,) = one.findings
        assert (found.grade.value, found.about) == (grade, About.FIT)
        assert found.light == pytest.approx(abs(ratio - 1))
        assert f"{ratio:.3g} of the source's light" in found.line()
        assert one.trusted is (grade == "slight")
        assert (one.recommended == "--size 32") is (grade != "slight")
        assert f"{MODEL.channels[1]} at θi = 5°" in found.found or name == "highlight"


def test_a_verdict_is_summed_up_in_a_sentence() -> None:
    assert verdict(seen=seen()).summary == "its light is right to 3% at every angle"
    assert verdict(seen=seen(albedo=0.92, highlight=0.8)).summary == (
        "good for diffuse light, off by at most 8%; highlight 20% too dark"
    )
    assert verdict(seen=seen(albedo=1.5)).summary == f"its light is off by 50% ({MODEL.channels[1]} at θi = 5°)"


def test_light_is_judged_by_the_samples_where_the_source_cannot_be_asked() -> None:
    one = verdict()
    assert (one.source_albedo, one.floor) == (None, None)
    assert one.off == pytest.approx(1)
    assert one.highlight == pytest.approx(1)


def test_energy_that_is_made_at_grazing_angles_alone() -> None:
    limit = math.cos(math.radians(80))

    def grazing(values: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
        return torch.where(wi[:, 2:] < limit, 4 * values, values)

    one = verdict(Altered(grazing))
    assert one.albedo > 1.02 > verdict().albedo
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
        assert (" RMS)" in one.found) is said


def test_reciprocity_of_samples_is_more_than_what_neighbours_differ_by() -> None:
    # Of a reciprocal lobe narrower than its sampling, swapped or not, the nearest sample is another value.
    narrow = Ward((0.1,), (0.3,), alpha_x=0.05, alpha_y=0.05, channels=("Y",))
    few = sample_model(narrow, 6000, "lobe", seed=3)
    assert asymmetry_of_samples(few, flux_of(few), 0) == pytest.approx(0, abs=0.02)
    many = sample_model(material("blinn-phong-50").model, 20_000, "discs", seed=3)
    assert asymmetry_of_samples(many, flux_of(many), 0) == pytest.approx(0, abs=0.02)
    tilted = replace(many, values=many.values * torch.where(many.wi[:, 2:] > many.wo[:, 2:], 1.5, 1.0))
    found = asymmetry_of_samples(tilted, flux_of(tilted), 0)
    assert found is not None
    assert found == pytest.approx(0.2, abs=0.03)


@pytest.mark.parametrize(("power", "found"), [(0.05, False), (0.5, True)])
def test_reciprocity_of_the_fit(power: float, found: bool) -> None:
    def crooked(values: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
        return values * torch.where(wi[:, 2:] > wo[:, 2:], 1 + power, 1.0)

    assert ("reciprocity" in names(verdict(Altered(crooked)))) is found


def test_scatter_of_the_data() -> None:
    missed = (0.05, 0.05)
    assert "scatter" not in names(verdict(train=noisy(0.15), log_mse=missed))
    assert "scatter" in names(verdict(train=noisy(0.3), log_mse=missed))
    assert "scatter" not in names(verdict(train=noisy(0.3)))


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
        verdict(Altered(flat_outside), test=sample_model(MODEL, 20_000, scheme, seed=6)).explained
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


def test_light_at_the_end_of_the_detector_is_clipped() -> None:
    limit = TRAIN.values.sort(0).values[-40]
    one = verdict(train=measured(replace(TRAIN, values=TRAIN.values.minimum(limit))))
    assert one.clipped > 0.003
    (clipped,) = (each for each in one.findings if each.name == "clipped")
    assert (clipped.about, clipped.grade) == (About.DATA, Grade.VISIBLE)
    assert verdict().clipped == 0
    constant = replace(TRAIN, values=torch.ones_like(TRAIN.values))
    assert flux.clipped_light(constant, flux_of(constant)) == 0


@pytest.mark.parametrize(("power", "name"), [(1, "cosine-o"), (2, "cosine-o-squared")])
def test_what_samples_are_suspected_of_is_in_the_verdict_on_a_measurement(power: int, name: str) -> None:
    many = sample_model(MODEL, 6000, "discs", seed=4)
    given = replace(many, values=many.values * many.wo[:, 2:] ** power)
    one = verdict(train=measured(given))
    (found,) = (each for each in one.findings if each.name.startswith("cosine"))
    assert (found.name, found.about, found.matters) == (name, About.DATA, True)
    assert "--undo" in found.remedy
    assert one.trusted or any(each.about is About.FIT for each in one.findings)
    # Of what was drawn by a scheme nothing is suspected: its convention is ours.
    assert name not in names(verdict(train=given))
    assert not any(each.name.startswith("cosine") for each in verdict(train=measured(many)).findings)


def test_zeros_of_a_colour_outside_srgb_are_named_as_such() -> None:
    values = TRAIN.values.clone()
    values[: len(values) // 2, 0] = 0
    cut = replace(measured(TRAIN), values=values, provenance={"colour": {"clipped": {"R": len(values) // 2}}})
    one = verdict(train=cut)
    assert one.gamut == pytest.approx(0.5, abs=0.01)
    (gamut,) = (each for each in one.findings if each.name in ("gamut", "zeros"))
    assert (gamut.name, gamut.options, gamut.about) == ("gamut", "--channels spectral", About.DATA)
