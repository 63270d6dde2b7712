"""Every check of the data on both sides of its threshold: what is odd in samples, and what they leave unknown."""

import math
from dataclasses import replace

import pytest
import torch
from judged import MODEL, TRAIN, Altered, measured, names, noisy, verdict

from homofact.brdf.analytic import Ward
from homofact.brdf.log_transform import LogTransform
from homofact.brdf.materials import material
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model
from homofact.evaluation.bar.error_bar import BarKind
from homofact.evaluation.verdict import flux, noting
from homofact.evaluation.verdict.finding import About
from homofact.evaluation.verdict.flux import asymmetry_of_samples, flux_of
from homofact.geometry.coordinates import rusinkiewicz_angles
from homofact.geometry.directions import from_spherical


def test_noise_makes_no_highlight_too_dark() -> None:
    one = verdict(train=measured(noisy(0.3)))
    assert one.figures.light.highlight == pytest.approx(1, abs=0.1)


def test_the_floor_of_the_noise_is_held_against_epsilon() -> None:
    noise = torch.randn(TRAIN.values.shape, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    floor = replace(TRAIN, values=(TRAIN.values + 0.06 * TRAIN.values.mean(0) * noise).clamp_min(0))
    for epsilon, found in ((6e-3, True), (0.03, False)):
        fitted = Altered(transform=LogTransform.of(floor, epsilon))
        assert ("epsilon" in names(verdict(fitted, train=floor, log_mse=(0.1, 0.1)))) is found


@pytest.mark.parametrize("left_in", [True, False])
def test_a_tilt_that_is_left_in_is_named_instead_of_the_ring_that_it_makes(left_in: bool) -> None:
    parts = {"found": "the sample was tilted by +0.1°", "effect": "it can be undone"}
    tilt = {"left_in": left_in, "undone": not left_in, **parts}
    one = verdict(train=replace(rings(1.4), provenance={"tilt": tilt}), log_mse=(0.01, 0.01))
    found = [each for each in one.findings if each.name in ("tilt", "ring")]
    assert [each.name for each in found] == (["tilt"] if left_in else ["ring"])
    assert found[0].about is About.DATA
    if left_in:
        assert (found[0].found, found[0].remedy) == tuple(parts.values())


@pytest.mark.parametrize(("share", "found"), [(0.005, False), (0.03, True)])
def test_zeros_of_one_channel_are_enough_where_there_should_be_light(share: float, found: bool) -> None:
    values = TRAIN.values.clone()
    values[: round(share * len(values)), 1] = 0
    one = verdict(train=replace(TRAIN, values=values))
    assert one.figures.data.zeros == pytest.approx(share, abs=1e-3)
    assert one.figures.data.dark == pytest.approx(share, rel=0.6)
    assert ("zeros" in names(one)) is found
    # A third of all samples, where next to nothing is reflected, is no matter of the light.
    flux = flux_of(TRAIN) * TRAIN.values.mean(1)
    dark = flux < flux.quantile(0.3)
    one = verdict(train=replace(TRAIN, values=torch.where(dark[:, None], 0.0, TRAIN.values)))
    assert one.figures.data.zeros > 0.25
    assert one.figures.data.dark < 0.1


def test_few_samples_far_off_are_outliers_and_many_are_none() -> None:
    def spoilt(every: int) -> Samples:
        values = noisy(0.01).values.clone()
        values[::every] *= 20
        return replace(TRAIN, values=values)

    def said(samples: Samples) -> set[str]:
        return names(verdict(train=samples))

    assert "outliers" in said(spoilt(50))
    assert "outliers" not in said(spoilt(10))
    assert "outliers" not in said(noisy(0.01))


def test_samples_that_are_repeated_count_where_they_differ() -> None:
    def doubled(factor: float) -> Samples:
        both = {name: torch.cat((getattr(TRAIN, name), getattr(TRAIN, name))) for name in ("wi", "wo", "weights")}
        return replace(TRAIN, **both, values=torch.cat((TRAIN.values, factor * TRAIN.values)))

    assert verdict(train=doubled(1.0)).figures.data.repeated == pytest.approx(0, abs=1e-12)
    one = verdict(train=doubled(1.5))
    # Both are a fifth of their mean off it.
    assert one.figures.data.repeated == pytest.approx(0.2, abs=1e-6)
    assert "repeated" in names(one)


def rings(gain: float) -> Samples:
    """A goniometer's samples, those of one ring of θi brighter by `gain`."""
    theta = torch.arange(10, 80, 10, dtype=torch.float64).deg2rad()
    theta_i, theta_o, phi = torch.meshgrid(theta, theta, torch.linspace(0, 3.1, 12, dtype=torch.float64), indexing="ij")
    wi = from_spherical(theta_i.reshape(-1), torch.zeros(theta_i.numel(), dtype=torch.float64))
    wo = from_spherical(theta_o.reshape(-1), phi.reshape(-1))
    values = MODEL.evaluate(wi, wo) * torch.where((theta_i.reshape(-1, 1) - theta[3]).abs() < 1e-9, gain, 1.0)
    return Samples(wi, wo, values, channels=MODEL.channels, isotropic=True)


@pytest.mark.parametrize(("gain", "found"), [(1.0, False), (1.05, False), (1.25, True), (0.75, True)])
def test_a_ring_of_another_gain(gain: float, found: bool) -> None:
    one = verdict(train=rings(gain), log_mse=(0.01, 0.01))
    assert ("ring" in names(one)) is found
    assert one.figures.data.ring == pytest.approx(gain, rel=0.02)
    if found:
        assert one.figures.data.ring_where == "θi = 40°"


def test_what_lies_between_samples_or_beyond_them_is_not_known() -> None:
    peaked = measured(replace(TRAIN, values=TRAIN.values.clone()))
    generator = torch.Generator().manual_seed(0)
    struck = torch.randperm(len(TRAIN), generator=generator)[:8]
    peaked.values[struck] *= 300
    one = verdict(Altered(), train=peaked)
    assert one.figures.coverage.unresolved > 0.9
    assert "sampling" in names(one)
    assert verdict(train=measured(TRAIN)).figures.coverage.unresolved < 0.4
    near = TRAIN.select((TRAIN.wi[:, 2] > 0.7) & (TRAIN.wo[:, 2] > 0.7))
    narrow = verdict(train=measured(near))
    assert 0.2 < narrow.figures.coverage.unmeasured < 0.9
    (coverage,) = (each for each in narrow.findings if each.name == "coverage")
    assert coverage.about is About.UNKNOWN
    assert coverage.feature == "unmeasured"
    # What was not measured is not promised.
    assert narrow.bars.of("albedo").degrees[1] == pytest.approx(math.degrees(math.acos(0.7)), abs=1)
    assert verdict(train=TRAIN).figures.coverage.unmeasured == 0


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


def test_scatter_of_the_data() -> None:
    assert "scatter" not in names(verdict(train=noisy(0.15)))
    assert "scatter" in names(verdict(train=noisy(0.3)))


def test_light_at_the_end_of_the_detector_is_clipped() -> None:
    limit = TRAIN.values.sort(0).values[-40]
    one = verdict(train=measured(replace(TRAIN, values=TRAIN.values.minimum(limit))))
    assert one.figures.data.clipped > 0.003
    (clipped,) = (each for each in one.findings if each.name == "clipped")
    assert (clipped.about, clipped.feature) == (About.DATA, "clipped")
    assert clipped.cost is not None
    assert verdict().figures.data.clipped == 0
    constant = replace(TRAIN, values=torch.ones_like(TRAIN.values))
    assert flux.clipped_light(constant, flux_of(constant)) == 0


@pytest.mark.parametrize(("power", "name"), [(1, "cosine-o"), (2, "cosine-o-squared")])
def test_what_samples_are_suspected_of_is_in_the_verdict_on_a_measurement(power: int, name: str) -> None:
    many = sample_model(MODEL, 6000, "discs", seed=4)
    given = replace(many, values=many.values * many.wo[:, 2:] ** power)
    one = verdict(train=measured(given))
    (found,) = (each for each in one.findings if each.name.startswith("cosine"))
    assert (found.name, found.about) == (name, About.DATA)
    assert "`convert(undo=" in found.remedy
    # Such samples may be wrong: no bar says that it holds if they are right.
    assert one.bars.kind in (BarKind.FAULT, BarKind.WITHDRAWN)
    assert one.bars.of("albedo").reason == f"the samples look faulty ({name})"
    # Of what was drawn by a scheme nothing is suspected: its convention is ours.
    assert name not in names(verdict(train=given))
    assert not any(each.name.startswith("cosine") for each in verdict(train=measured(many)).findings)


def test_zeros_of_a_colour_outside_srgb_are_named_as_such() -> None:
    values = TRAIN.values.clone()
    values[: len(values) // 2, 0] = 0
    cut = replace(measured(TRAIN), values=values, provenance={"colour": {"clipped": {"R": len(values) // 2}}})
    one = verdict(train=cut)
    assert one.figures.data.gamut == pytest.approx(0.5, abs=0.01)
    (gamut,) = (each for each in one.findings if each.name in ("gamut", "zeros"))
    assert (gamut.name, gamut.advice, gamut.about) == ("gamut", None, About.DATA)


def test_a_highlight_that_still_rises_where_samples_end_is_not_known() -> None:
    narrow = Ward((0.1,), (0.3,), alpha_x=0.02, alpha_y=0.02, channels=("Y",))
    broad = Ward((0.1,), (0.3,), alpha_x=0.2, alpha_y=0.2, channels=("Y",))
    found = {}
    for name, model, scheme in (("hidden", narrow, "discs"), ("seen", narrow, "lobe"), ("broad", broad, "discs")):
        samples = measured(sample_model(model, 6000, scheme, 1))
        found[name] = flux.rising(samples, flux_of(samples))
    assert found["hidden"] > 1.5
    assert max(found["seen"], found["broad"]) < 0.5
    # A power of θh is measured as what it is, less a standard error.
    many = measured(sample_model(MODEL, 20_000, "discs", 2))
    theta_h, _, _ = rusinkiewicz_angles(many.wi, many.wo)
    power = replace(many, values=theta_h[:, None].clamp_min(1e-4).expand(-1, 3) ** -1.5)
    assert flux.rising(power, flux_of(power)) == pytest.approx(1.5, abs=0.3)
    few = power.subset(6, 0)
    assert flux.rising(few, flux_of(few)) == 0
    # It is a finding of what is unknown.
    theta_h = rusinkiewicz_angles(TRAIN.wi, TRAIN.wo)[0].clamp_min(1e-3)[:, None]
    steep = replace(measured(TRAIN), values=(0.01 / theta_h.expand(-1, 3)) ** 1.8)
    (one,) = (each for each in verdict(train=steep).findings if each.name == "sampling")
    assert one.about is About.UNKNOWN
    assert "sampling" not in names(verdict(train=measured(TRAIN)))


def test_a_base_that_was_cut_off_is_found_though_its_neighbours_are_dark() -> None:
    dark = TRAIN.values.quantile(0.3, 0)
    cut = (TRAIN.values - dark).clamp_min(0)
    one = verdict(train=replace(TRAIN, values=cut))
    assert one.figures.data.black > 0.05
    assert "zeros" in names(one)
    # Zeros of a single channel are a colour's.
    single = verdict(train=replace(TRAIN, values=torch.cat((cut[:, :1], TRAIN.values[:, 1:]), 1)))
    assert single.figures.data.black == 0
    assert single.figures.data.zeros > 0.2


@pytest.mark.parametrize("levels", [16, 63])
def test_levels_count_by_the_light_that_they_miss(levels: int) -> None:
    many = measured(sample_model(MODEL, 6000, "discs", 4))
    step = many.values.max() / levels
    rounded = replace(many, values=(many.values / step).round() * step)
    one = verdict(train=rounded)
    assert "quantised" in names(one)
    weights = flux_of(many)
    light = (weights[:, None] * rounded.values).sum(0).min()
    assert one.figures.data.rounded == pytest.approx(float(step / 4 * weights.sum() / light), rel=1e-3)
    assert flux.rounded_light(many, weights) == 0


def test_what_chance_does_to_a_band_is_taken_off() -> None:
    generator = torch.Generator().manual_seed(3)
    noise = 0.5 * torch.randn(TRAIN.values.shape, generator=generator, dtype=TRAIN.values.dtype)
    band = flux.worst_band(TRAIN, flux_of(TRAIN), TRAIN.values * (1 + noise))
    assert band is not None
    # Without that 0.41 would be off, in another band.
    assert band[0] == pytest.approx(1, abs=0.1)
    steady = flux.worst_band(TRAIN, flux_of(TRAIN), 0.7 * TRAIN.values)
    assert steady is not None
    assert steady[0] == pytest.approx(0.7, abs=0.06)


def test_directions_of_one_plane_have_one_azimuth() -> None:
    theta = torch.linspace(0.3, 1.2, 20, dtype=torch.float64)
    half = torch.arange(20) < 10
    plane = from_spherical(theta, torch.where(half, 0.0, torch.pi).to(theta))
    around = from_spherical(theta, torch.linspace(0, 2 * torch.pi, 21, dtype=torch.float64)[:-1])
    for directions, spread in ((plane, 0.0), (around, 1.0)):
        samples = Samples(directions, directions, torch.ones(20, 3, dtype=torch.float64))
        assert noting._azimuths(samples) == pytest.approx(spread, abs=1e-9)
