"""Suspected conventions: each planted fault is found by its own check, clean materials are not accused."""

import math
from dataclasses import replace
from functools import lru_cache

import pytest
import torch
from refusals import refused

from homofact.brdf.analytic import BlinnPhong, Lambert
from homofact.brdf.analytic.ggx import GgxBrdf, GgxLobe
from homofact.brdf.materials import MATERIALS
from homofact.brdf.quality.suspicion import conventions
from homofact.brdf.quality.suspicion.base import base_of
from homofact.brdf.quality.suspicion.evidence import Evidence
from homofact.brdf.quality.suspicion.suspects import CHECKS, suspicions, undone_evidence
from homofact.brdf.quality.suspicion.undo import UNDO, names_in, srgb_decoded, undone
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model
from homofact.brdf.symmetry import angles_of_pairs
from homofact.geometry.directions import from_spherical, to_spherical
from scripts.verdict.planting import FAULTS, Planted

COUNT = 1000


def _srgb_encoded(values: torch.Tensor) -> torch.Tensor:
    """The inverse of `srgb_decoded`."""
    return torch.where(values <= 0.0031308, 12.92 * values, 1.055 * values.clamp_min(0.0031308) ** (1 / 2.4) - 0.055)


@lru_cache(maxsize=16)
def clean(name: str, seed: int = 3) -> Samples:
    return sample_model(MATERIALS[name].model, COUNT, "discs", seed)


@pytest.mark.parametrize("name", sorted(MATERIALS))
def test_clean_materials_are_not_accused(name: str) -> None:
    assert [each.line() for each in suspicions(clean(name))] == []


# Each is planted where it can be known: directions on a material with a highlight.
ON_A_HIGHLIGHT = {
    "elevation for zenith", "elevation of ωi", "elevation of ωo", "azimuth off by 180°",
}  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS, ids=[fault.name for fault in FAULTS])
def test_a_planted_fault_is_found(fault: Planted) -> None:
    samples = clean("blinn-phong-50" if fault.name in ON_A_HIGHLIGHT else "lafortune-clay")
    if fault.name == "times π":
        samples = replace(samples, values=samples.values * 2)
    found = suspicions(fault.plant(samples, fault.strengths[-1], 0))
    assert {each.name for each in found} & set(fault.found_as), [each.line() for each in found]
    assert found == sorted(found, key=lambda each: -each.odds)


def test_what_cannot_be_known_is_not_said() -> None:
    """f/π, swapped directions and a permutation of the channels of a whole file are other materials as likely."""
    samples = clean("lafortune-clay")
    for other in (
        replace(samples, values=samples.values / math.pi),
        replace(samples, wi=samples.wo, wo=samples.wi),
        replace(samples, values=samples.values.flip(1)),
    ):
        assert suspicions(other) == []


def test_equal_seed_equal_odds_and_few_samples_say_nothing() -> None:
    struck = replace(clean("phong-30"), values=clean("phong-30").values * clean("phong-30").wo[:, 2:])
    assert suspicions(struck) == suspicions(struck)
    assert suspicions(struck.subset(150, 0)) == []
    assert suspicions(replace(struck, values=struck.values * 0)) == []


def test_zeros_that_the_gamut_explains_are_not_suspected() -> None:
    samples = clean("phong-30")
    cut = replace(samples, values=samples.values * (samples.wi[:, 2:] < 0.8))
    assert "zeros" in {each.name for each in suspicions(cut)}
    known = replace(cut, provenance={"colour": {"clipped": {"R": 12, "G": 0, "B": 0}}})
    assert "zeros" not in {each.name for each in suspicions(known)}


def test_the_exponent_of_a_cosine_is_measured() -> None:
    """f cosθo^q of a reciprocal f has an odd exponent of q exactly."""
    for power in (-1.0, 0.5, 1.0):
        samples = clean("cook-torrance-plastic")
        odd, _ = conventions.exponents(
            Evidence.of(replace(samples, values=samples.values * samples.wo[:, 2:] ** power))
        ) or (math.nan, 0)
        assert odd == pytest.approx(power, abs=0.03)


def on_coarse_rings(step_i: int, step_o: int, turn: int) -> Samples:
    """A dielectric GGX on a goniometer's coarse rings, with 1% of noise; steps in degrees."""
    model = GgxBrdf((0.2, 0.15, 0.1), (GgxLobe((1.0, 1.0, 1.0), 0.1, 0.04),))
    steps = ((0, 76, step_i), (0, 81, step_o), (0, 181, turn))
    i, o, phi = (each.reshape(-1) for each in torch.meshgrid(
        *(torch.arange(*step, dtype=torch.float64).deg2rad() for step in steps), indexing="ij"
    ))  # fmt: skip
    wi, wo = from_spherical(i, 0 * i), from_spherical(o, phi)
    values = model.evaluate(wi, wo)
    noise = torch.randn(values.shape, dtype=torch.float64, generator=torch.Generator().manual_seed(1))
    return Samples(wi, wo, values * torch.exp(0.01 * noise), channels=model.channels, isotropic=True)


@pytest.mark.parametrize("steps", [(15, 10, 15), (15, 5, 10), (20, 5, 5)])
def test_a_fit_that_extrapolates_to_the_light_suspects_no_shadow(steps: tuple[int, int, int]) -> None:
    """On coarse rings few samples determine the smooth fit near the light, but those around it still show a shadow."""
    samples = on_coarse_rings(*steps)
    for part in (samples, samples.subset(len(samples) * 4 // 5, 3)):
        assert [each.line() for each in suspicions(part)] == []
    shadow = next(fault for fault in FAULTS if fault.name == "shadow of the arm")
    assert "shadow" in {each.name for each in suspicions(shadow.plant(samples, 0.95, 0))}


def test_odds_are_said_in_words() -> None:
    samples = clean("lafortune-clay")
    first = suspicions(replace(samples, values=samples.values * samples.wo[:, 2:]))[0]
    assert first.record() == {
        "name": "cosine-o", "odds": first.odds, "words": "the values hold cosθo",
        "remedy": "`convert(undo='cosine-o')`",
    }  # fmt: skip
    assert first.line().startswith("the values hold cosθo: odds ")
    assert first.line().endswith(" to 1; `convert(undo='cosine-o')`")


PAIRS = {
    "cosine-o": lambda s: replace(s, values=s.values * s.wo[:, 2:]),
    "cosine-i": lambda s: replace(s, values=s.values * s.wi[:, 2:]),
    "cosines": lambda s: replace(s, values=s.values * s.wi[:, 2:] * s.wo[:, 2:]),
    "cosine-o-squared": lambda s: replace(s, values=s.values * s.wo[:, 2:] ** 2),
    "cosine-i-squared": lambda s: replace(s, values=s.values * s.wi[:, 2:] ** 2),
    "per-cosine-o": lambda s: replace(s, values=s.values / s.wo[:, 2:]),
    "per-cosine-i": lambda s: replace(s, values=s.values / s.wi[:, 2:]),
    "per-cosines": lambda s: replace(s, values=s.values / s.wi[:, 2:] / s.wo[:, 2:]),
    "pi": lambda s: replace(s, values=s.values * math.pi),
    "per-pi": lambda s: replace(s, values=s.values / math.pi),
    "srgb": lambda s: replace(s, values=_srgb_encoded(s.values)),
    "gamma": lambda s: replace(s, values=s.values ** (1 / 2.2)),
    "log1p": lambda s: replace(s, values=torch.log1p(s.values)),
    "density": lambda s: replace(s, values=-torch.log10(s.values / 100)),
    "elevation": lambda s: undone(s, ["elevation"]),
    "elevation-i": lambda s: undone(s, ["elevation-i"]),
    "elevation-o": lambda s: undone(s, ["elevation-o"]),
    "azimuth": lambda s: undone(s, ["azimuth"]),
    "swap": lambda s: undone(s, ["swap"]),
    "radians": next(fault.plant for fault in FAULTS if "radians" in fault.found_as),
}


@pytest.mark.parametrize("name", sorted(UNDO))
def test_undoing_gives_the_clean_samples_back(name: str) -> None:
    samples = clean("lafortune-clay")
    struck = PAIRS[name](samples, 1.0, 0) if name == "radians" else PAIRS[name](samples)
    assert not (torch.equal(struck.values, samples.values) and torch.equal(struck.wo, samples.wo))
    back = undone(struck, [name])
    factor = 100 if name == "density" else 1
    assert torch.allclose(back.values * factor, samples.values, rtol=1e-9)
    assert torch.allclose(back.wi, samples.wi, atol=1e-9)
    assert torch.allclose(back.wo, samples.wo, atol=1e-9)
    assert back.provenance["undone"][-1] == name


def test_srgb_is_the_published_curve() -> None:
    """IEC 61966-2-1: 0.5 is 0.21404114, 0.04045 is where the straight part ends, 1 is 1."""
    got = srgb_decoded(torch.tensor([0.0, 0.04045, 0.5, 1.0], dtype=torch.float64))
    expected = torch.tensor([0, 0.04045 / 12.92, 0.21404114, 1], dtype=torch.float64)
    assert torch.allclose(got, expected, atol=1e-8)


def test_elevation_is_the_complement_and_keeps_the_azimuth() -> None:
    samples = clean("phong-10")
    turned = undone(samples, ["elevation"])
    for one, two in ((samples.wi, turned.wi), (samples.wo, turned.wo)):
        (theta, phi), (other, same) = to_spherical(one), to_spherical(two)
        assert torch.allclose(theta + other, torch.full_like(theta, math.pi / 2))
        assert torch.allclose(torch.cos(phi - same), torch.ones_like(phi))


def test_samples_at_the_horizon_are_left_out_where_a_cosine_is_divided_by() -> None:
    samples = clean("phong-10")
    wo = samples.wo.clone()
    wo[:7] = torch.tensor([1.0, 0, 0], dtype=torch.float64)
    low = replace(samples, wo=wo)
    assert len(undone(low, ["cosine-o"])) == COUNT - 7
    assert len(undone(low, ["per-cosine-o"])) == COUNT
    # The evidence keeps each row's place beside its values.
    evidence = Evidence.of(low)
    left = undone_evidence(evidence, "cosine-o")
    assert len(left) == COUNT - 7
    assert left.place[0] == pytest.approx(evidence.place[7])


def test_names_to_undo() -> None:
    assert names_in("") == ()
    assert names_in(" srgb, cosine-o ") == ("srgb", "cosine-o")
    with refused(where="undo", found="'sRGB'"):
        names_in("sRGB")
    with refused(where="undo", found="'nothing'"):
        undone(clean("phong-10"), ["nothing"])


def on_rings(seed: int | None = None) -> Samples:
    """A goniometer's samples in the order of its angles, or in a random one."""
    theta_i = torch.arange(10.0, 81.0, 10.0, dtype=torch.float64).deg2rad()
    theta_o = torch.linspace(8, 80, 10, dtype=torch.float64).deg2rad()
    i, o, phi = torch.meshgrid(theta_i, theta_o, torch.linspace(0, math.pi, 12, dtype=torch.float64), indexing="ij")
    wi, wo = from_spherical(i.reshape(-1), 0 * i.reshape(-1)), from_spherical(o.reshape(-1), phi.reshape(-1))
    model = MATERIALS["cook-torrance-plastic"].model
    samples = Samples(wi, wo, model.evaluate(wi, wo), channels=model.channels, isotropic=True)
    if seed is None:
        return samples
    return samples.select(torch.randperm(len(samples), generator=torch.Generator().manual_seed(seed)))


def test_a_drift_over_rows_that_are_sorted_by_angle_is_not_told_from_the_material() -> None:
    drift = next(fault.plant for fault in FAULTS if fault.name == "drift in time")

    def said(samples: Samples) -> set[str]:
        return {each.name for each in suspicions(samples)}

    assert said(on_rings(1)) == set()
    assert "drift-in-time" in said(drift(on_rings(1), 0.6, 0))
    assert said(on_rings()) == set()
    assert "drift-in-time" not in said(drift(on_rings(), 0.6, 0))
    # Whichever angle the rows are sorted by.
    ordered = on_rings(1)
    for angle in (ordered.wi[:, 2], ordered.wo[:, 2], angles_of_pairs(ordered.wi, ordered.wo)[:, 2]):
        by_angle = ordered.select(angle.argsort(stable=True))
        assert "drift-in-time" not in said(drift(by_angle, 0.6, 0))


def test_the_base_is_what_lies_off_the_highlight() -> None:
    """Of a Lambertian base under a lobe: its albedo, and no cosine in it; of a base with cosines their exponent."""
    glossy = sample_model(BlinnPhong((0.3,), (0.5,), 300, channels=("Y",)), 6000, "lobe", 1)
    found = base_of(Evidence.of(glossy))
    assert found is not None
    assert found == pytest.approx((0.0, 0.3), abs=0.02)
    tilted = replace(glossy, values=glossy.values * (glossy.wi[:, 2:] * glossy.wo[:, 2:]) ** 0.7)
    found = base_of(Evidence.of(tilted))
    assert found is not None
    assert found[0] == pytest.approx(0.7, abs=0.03)


def test_levels_are_measured_by_how_many_values_come_twice() -> None:
    samples = sample_model(Lambert((0.5,), channels=("Y",)), 1200, "discs", 5)
    number = torch.arange(1200, dtype=torch.float64)
    # Levels 1.00, 1.01, ... of two samples each, as many that come once; the commonest value is left out.
    twice = torch.where(number < 600, 1 + (number % 300) / 100, 10 + number).where(number < 1190, 0.5)
    given = Evidence.of(replace(samples, values=twice[:, None]))
    figures = CHECKS["quantised"].figures(given)
    assert figures is not None
    assert figures[0] == pytest.approx(600 / 1189, abs=2e-3)
    different = (1 + number / 100).where(number < 1190, 0.5)[:, None]
    once = CHECKS["quantised"].figures(Evidence.of(replace(samples, values=different)))
    assert once is not None
    assert once[0] == 0
    # The same values at a swapped place are one.
    joined = {name: torch.cat((getattr(samples, name), getattr(samples, other)))
              for name, other in (("wi", "wo"), ("wo", "wi"))}  # fmt: skip
    both = replace(samples, **joined, values=different.repeat(2, 1), weights=torch.ones(2400))
    once = CHECKS["quantised"].figures(Evidence.of(both))
    assert once is not None
    assert once[0] == 0


def test_what_is_beyond_doubt_is_undone_before_the_instrument_is_asked() -> None:
    turned, tilted = clean("blinn-phong-50"), clean("lafortune-clay")
    assert {each.name for each in suspicions(undone(turned, ["elevation"]))} == {"elevation"}
    found = suspicions(replace(tilted, values=tilted.values * tilted.wo[:, 2:] ** 2))
    assert {each.name for each in found} == {"cosine-o-squared"}


PAINT = "lafortune-blue-paint"
GAIN = CHECKS["gains"]


def gained(gain, scheme: str = "discs", count: int = 4000):
    """Samples with a gain over θi and θo in degrees."""
    samples = sample_model(MATERIALS[PAINT].model, count, scheme, 3)
    theta_i, theta_o = (torch.rad2deg(to_spherical(w)[0]) for w in (samples.wi, samples.wo))
    return replace(samples, values=samples.values * gain(theta_i, theta_o)[:, None], provenance={})


def rms_of_gains(samples) -> float:
    figures = GAIN.figures(Evidence.of(samples, 0))
    assert figures is not None
    return math.exp(figures[0])


@pytest.mark.parametrize("scheme", ["discs", "lobe"])
def test_a_gain_over_the_angle_is_measured_by_reciprocity(scheme: str) -> None:
    """A lamp that loses a fifth to grazing: its RMS about the mean is that of the gain at the samples' own angles."""
    lamp = gained(lambda i, o: 1 - 0.2 * i / 90, scheme)
    theta = torch.rad2deg(to_spherical(lamp.wi)[0])
    logs = torch.log(1 - 0.2 * theta / 90)
    assert rms_of_gains(lamp) == pytest.approx(float(logs.std()), rel=0.25)
    assert rms_of_gains(gained(lambda i, o: 1 + 0 * i, scheme)) < 0.02
    detector = gained(lambda i, o: torch.where((o - 40).abs() < 4, 1.5, 1.0), scheme)
    assert rms_of_gains(detector) > 0.06
    assert "gains" in [each.name for each in suspicions(detector)]


def test_a_gain_that_is_the_same_over_both_angles_is_another_material() -> None:
    both = gained(lambda i, o: (1 - 0.4 * i / 90) * (1 - 0.4 * o / 90))
    assert rms_of_gains(both) < 0.03
    assert suspicions(both) == []


@pytest.mark.parametrize("sigma", [0.2, 0.6])
def test_noise_is_no_gain(sigma: float) -> None:
    generator = torch.Generator().manual_seed(0)
    clean = gained(lambda i, o: 1 + 0 * i)
    noise = sigma * torch.randn(clean.values.shape, generator=generator, dtype=torch.float64)
    assert rms_of_gains(replace(clean, values=clean.values * torch.exp(noise))) < 0.03


def test_few_samples_and_those_on_rings_are_not_asked_for_gains() -> None:
    assert GAIN.figures(Evidence.of(gained(lambda i, o: 1 - 0.5 * i / 90, count=1200), 0)) is None
    samples = gained(lambda i, o: 1 - 0.5 * i / 90)
    theta, phi = to_spherical(samples.wi)
    rings = from_spherical(torch.deg2rad(10 * (torch.rad2deg(theta) / 10).round().clamp(1, 8)), phi)
    assert GAIN.figures(Evidence.of(replace(samples, wi=rings), 0)) is None
