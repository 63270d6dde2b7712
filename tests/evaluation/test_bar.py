"""Error bars: what they say, where they end, what widens them, and a reading that sees what a fit misses."""

import gc
import math
import time
import weakref
from dataclasses import replace

import pytest
import torch
from judged import MODEL, TRAIN, Altered, measured, noisy, seen, verdict
from refusals import refused
from torch import Tensor

import homofact
from homofact.api.result import RecordedVerdict
from homofact.brdf.log_transform import LogTransform
from homofact.brdf.materials import material
from homofact.brdf.quality.extrapolation import Extrapolation
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model
from homofact.brdf.scattered import LEAST_SAMPLES, surface_of
from homofact.evaluation.bar.error_bar import GOOD, MOST, BarKind, ErrorBar, ErrorBars, percent
from homofact.evaluation.bar.features import FEATURES, OF_QUANTITY, features_of
from homofact.evaluation.bar.reading import reading_of
from homofact.evaluation.bar.table import QUANTITIES, RATE, table
from homofact.evaluation.energy import ALBEDO_DEGREES
from homofact.evaluation.verdict.figures import Figures
from homofact.evaluation.wording import trust_in_words

MANY = measured(sample_model(MODEL, 5000, "lobe", seed=8))


def read(change: float = 1.0, samples: Samples = MANY) -> "object":
    fit = Altered(lambda values, wi, wo: change * values)
    return reading_of(fit, samples, Extrapolation(samples))


def bars(*errors: float | None, degrees: tuple[float, float] = (0.0, 75.0)) -> ErrorBars:
    by_angle = tuple(
        ErrorBar("albedo", BarKind.RIGHT, error, 0.9, (at, at)) for error, at in zip(errors, (20.0, 40.0), strict=False)
    )
    return ErrorBars(tuple(ErrorBar.stated(name, BarKind.RIGHT, 0.05, 0.9, degrees) for name in QUANTITIES), by_angle)


def test_the_samples_own_model_is_read_as_right_and_a_scaled_one_as_off() -> None:
    right, off = read(), read(1.3)
    assert right.mended < 0.01  # type: ignore[attr-defined]
    assert max(map(abs, right.albedo)) < 0.01  # type: ignore[attr-defined]
    # ε of the logarithms takes a little of it.
    for mended in off.albedo:  # type: ignore[attr-defined]
        assert mended == pytest.approx(-math.log(1.3), abs=0.02)
    assert off.highlight == pytest.approx(-math.log(1.3), abs=0.01)  # type: ignore[attr-defined]
    assert off.bias == pytest.approx(math.log(1.3), abs=0.02)  # type: ignore[attr-defined]


def test_a_surface_through_the_samples_finds_a_scaled_fit_off_by_its_scale() -> None:
    right, off = read(), read(1.3)
    assert max(map(abs, right.surface)) < 0.01  # type: ignore[attr-defined]
    assert right.surface_apart < 0.01  # type: ignore[attr-defined]
    assert right.surface_lamp < 0.01  # type: ignore[attr-defined]
    for through in (*off.surface, off.surface_highlight):  # type: ignore[attr-defined]
        assert through == pytest.approx(-math.log(1.3), abs=0.01)
    assert off.surface_apart == pytest.approx(0.3, abs=0.01)  # type: ignore[attr-defined]
    assert off.surface_lamp == pytest.approx(0.3, abs=0.01)  # type: ignore[attr-defined]


def test_the_worst_angle_of_a_surface_counts_and_one_that_diverges_counts_once() -> None:
    """Half the light at grazing incidence is lost, and at another angle the fit is a thousand times too bright."""
    half = Altered(lambda values, wi, wo: values * (0.5 + 0.5 * (wi[:, 2:] > 0.4)))
    dark = reading_of(half, MANY, Extrapolation(MANY))
    assert dark.surface[-1] == pytest.approx(math.log(2), abs=0.05)
    assert dark.surface_apart == pytest.approx(0.5 / len(ALBEDO_DEGREES), abs=0.01)
    bright = Altered(lambda values, wi, wo: values * (1 + 1000 * (wi[:, 2:] > 0.99)))
    assert reading_of(bright, MANY, Extrapolation(MANY)).surface_apart == pytest.approx(
        1 / len(ALBEDO_DEGREES), abs=0.02
    )


@pytest.mark.parametrize("samples", [replace(MANY, isotropic=False), MANY.subset(LEAST_SAMPLES - 1, 0)])
def test_without_a_model_the_plain_interpolation_takes_the_place_of_the_surface(samples: Samples) -> None:
    found = read(1.2, samples)
    assert found.surface == pytest.approx(found.read_albedo)  # type: ignore[attr-defined]
    assert found.surface_highlight == pytest.approx(found.read_highlight)  # type: ignore[attr-defined]
    assert 0.1 < found.surface_apart < 1  # type: ignore[attr-defined]


def test_the_surface_of_samples_is_made_once_and_goes_with_them() -> None:
    samples = replace(MANY)
    assert surface_of(samples) is surface_of(samples)
    surface, alive = weakref.ref(surface_of(samples)), weakref.ref(samples)
    del samples
    gc.collect()
    assert alive() is None
    assert surface() is None


def test_noise_is_mended_and_is_no_bias() -> None:
    noise = torch.randn(MANY.values.shape, dtype=torch.float64, generator=torch.Generator().manual_seed(2))
    noisy_ones = replace(MANY, values=MANY.values * torch.exp(0.2 * noise))
    found = read(samples=noisy_ones)
    assert found.mended > 0.05  # type: ignore[attr-defined]
    assert found.bias < 0.6 * found.mended  # type: ignore[attr-defined]


def test_the_table_has_what_is_stated_and_says_by_what_it_was_made() -> None:
    found = table()
    known = {*FEATURES, *OF_QUANTITY}
    for kind in ("right", "fault"):
        assert set(found.bars[kind]) == set(QUANTITIES)
        assert len(found.angles[kind]) == len(ALBEDO_DEGREES)
        for model in (*found.bars[kind].values(), *found.angles[kind]):
            assert {*model.model.columns, *model.spread.columns} <= known
            assert model.quantile > 0
    assert 0 < found.threshold < 1
    assert set(found.made) >= {"script", "seed", "cases", "fits", "searched", "hash", "version"}


@pytest.mark.slow
def test_features_are_documented_and_come_back_from_a_record() -> None:
    figures = verdict(train=MANY).figures
    for quantity in QUANTITIES:
        found = features_of(figures, {}, quantity)
        assert set(found) == {*FEATURES, *OF_QUANTITY}
        assert all(math.isfinite(value) for value in found.values())
        again = Figures.of(verdict(train=MANY).record())
        assert features_of(again, {}, quantity) == found
    one = features_of(figures, {"pi": 1000.0}, "albedo")
    assert one["odds"] > features_of(figures, {}, "albedo")["odds"]


def test_a_worse_fit_has_wider_bars_and_a_higher_score() -> None:
    good = verdict(train=MANY)
    worse = verdict(Altered(lambda values, wi, wo: values * (0.3 + wi[:, :1].abs())), train=MANY)
    assert good.bars.kind is BarKind.RIGHT
    assert good.bars.of("albedo").rate == RATE
    for name in ("albedo", "sky"):
        wide, narrow = worse.bars.of(name).error, good.bars.of(name).error
        assert narrow is not None
        assert wide is None or wide > 2 * narrow
    assert worse.alarm.score > good.alarm.score
    assert not worse.trusted


@pytest.mark.parametrize("scale", [1.0, 1.05, 1.2])
def test_the_worst_angle_is_no_surer_than_each(scale: float) -> None:
    found = verdict(Altered(lambda values, wi, wo: scale * values), train=MANY).bars
    worst = found.of("albedo").error
    assert worst is not None
    assert all(bar.error is not None and bar.error <= worst for bar in found.by_angle)


@pytest.mark.parametrize(("ratio", "direction"), [(0.5, "too dark"), (1.3, "too bright"), (0.995, "")])
def test_a_measured_error_of_light_has_a_direction(ratio: float, direction: str) -> None:
    found = verdict(seen=seen(albedo=ratio, highlight=1 / ratio))
    words = f", {direction}" if direction else ""
    assert f"total reflected light within {percent(max(ratio, 1 / ratio) - 1)} (0–75°{words})" in found.summary
    opposite = {"too dark": " (too bright)", "too bright": " (too dark)", "": ""}[direction]
    assert f"highlight within {percent(max(ratio, 1 / ratio) - 1)}{opposite}" in found.summary
    (bar,) = found.bars.by_angle
    assert (bar.ratio, bar.direction) == (pytest.approx(ratio), direction)
    again = ErrorBars.of_record(found.bars.record())
    assert again == found.bars
    if direction:
        assert f"total reflected light is {direction} by" in found.cause
    # An estimate has none.
    assert not any(bar.direction for bar in verdict(train=MANY).bars.bars)


class Plastic(Altered):
    """A fit that is the plastic itself, much of whose light grazes."""

    model = material("cook-torrance-plastic").model

    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        return self.model.evaluate(wi, wo)


def test_light_in_unmeasured_directions_is_named_where_it_is_more_than_the_bar() -> None:
    """Even a right fit rests on extrapolation where the views end: no sample shows what leaves beyond."""
    samples = measured(sample_model(Plastic.model, 5000, "lobe", seed=8))
    limit = math.cos(math.radians(78))
    views = samples.select((samples.wo[:, 2] > limit) & (samples.wi[:, 2] > limit))
    found, whole = (
        verdict(Plastic(transform=LogTransform.of(each, 1e-2)), train=each).bars for each in (views, samples)
    )
    wrong, last = found.by_angle[-1], whole.by_angle[-1]
    assert wrong.degrees == last.degrees == (75.0, 75.0)
    assert wrong.unmeasured > 0.15 > 0.05 > last.unmeasured
    assert wrong.rests_on_extrapolation
    assert not last.rests_on_extrapolation
    assert "75°" in found.extrapolated_sentence()
    # The sentence states the limit of the other angles, and names this one.
    assert f"within {percent(max(bar.error or 0 for bar in found.by_angle[:-1]))} at 0–60°" in found.sentence()
    assert f"° and {percent(wrong.error or 0)} at 75° (75° partly extrapolated)" in found.sentence()
    assert "extrapolated" not in whole.sentence()
    assert found.interval("albedo", 75).unmeasured == wrong.unmeasured
    again = ErrorBars.of_record(found.record())
    assert again == found


def test_bars_end_where_the_measurement_ends() -> None:
    near = MANY.select((MANY.wi[:, 2] > 0.5) & (MANY.wo[:, 2] > 0.5))
    found = verdict(train=near).bars
    assert found.of("albedo").degrees == (0.0, pytest.approx(60, abs=1))
    assert found.interval("albedo", 45).error is not None
    beyond = found.interval("albedo", 70)
    assert (beyond.kind, beyond.error) == (BarKind.WITHDRAWN, None)
    assert "0–60°" in beyond.reason
    assert "beyond is extrapolation" in found.sentence()


def test_anisotropic_samples_are_promised_nothing() -> None:
    found = verdict(train=replace(measured(TRAIN), isotropic=False)).bars
    assert found.kind is BarKind.WITHDRAWN
    assert "anisotropic" in found.of("sky").reason


def test_an_angle_between_two_has_an_error_between_theirs() -> None:
    found = bars(0.1, 0.3)
    assert found.interval("albedo", 30).error == pytest.approx(0.2)
    assert found.interval("albedo", 5).error == 0.1
    assert found.interval("albedo", 75).error == 0.3
    assert found.interval("albedo").error == 0.05
    assert bars(0.1, None).interval("albedo", 30).error is None
    with refused(where="quantity", found="'gloss'"):
        found.interval("gloss")
    with refused(where="theta", found="30 of sky"):
        found.interval("sky", 30)
    with refused(where="theta", found="-1"):
        found.interval("albedo", -1)


@pytest.mark.parametrize("error", [math.inf, math.nan, -0.1])
def test_bars_of_a_damaged_report_are_none(error: float) -> None:
    record = ErrorBars((ErrorBar("albedo", BarKind.RIGHT, 0.1, 0.9, (0.0, 75.0)),)).record()
    assert ErrorBars.of_record(record) is not None
    record["all"][0]["error"] = error
    assert ErrorBars.of_record(record) is None


def test_a_bar_that_says_nothing_is_withdrawn() -> None:
    assert ErrorBar.stated("sky", BarKind.RIGHT, 1.01 * MOST, 0.9, (0, 75)).kind is BarKind.WITHDRAWN
    assert ErrorBar.stated("sky", BarKind.RIGHT, math.nan, 0.9, (0, 75)).error is None
    bar = ErrorBar.stated("highlight", BarKind.RIGHT, 0.25, 0.9, (0, 75))
    assert (bar.low, bar.high) == (0.8, 1.25)
    picture = ErrorBar.stated("sky", BarKind.RIGHT, 0.25, 0.9, (0, 75))
    assert (picture.low, picture.high) == (None, None)
    assert ErrorBar.of(bar.record()) == bar


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (0.0, "0.1%"),
        (0.004, "0.4%"),
        (0.0057, "0.6%"),
        (0.0091, "1%"),
        (0.0147, "1.5%"),
        (0.02, "2%"),
        (0.0204, "2.1%"),
        (0.0499, "5%"),
        (0.052, "6%"),
        (0.07, "7%"),
        (0.4, "40%"),
        (2.0, "a factor of 3"),
        (1.24, "a factor of 2.3"),
        (10.2, "a factor of 12"),
        (math.inf, "an infinite factor"),
    ],
)
def test_a_limit_in_words_is_rounded_up(error: float, words: str) -> None:
    assert percent(error) == words


@pytest.mark.slow
def test_a_fit_states_its_interval_and_so_does_its_report() -> None:
    fit = homofact.fit("material:phong-10", homofact.McCool(size=8))
    bar = fit.interval("albedo", 40)
    assert bar.kind is BarKind.MEASURED
    assert fit.verdict is not None
    recorded = RecordedVerdict.of(fit.verdict.record())  # type: ignore[attr-defined]
    assert recorded is not None
    assert replace(fit, verdict=recorded).interval("albedo", 40) == bar
    kept = [(each.name, each.about, each.found, each.remedy, each.cost) for each in fit.verdict.findings]
    assert kept
    assert [(each.name, each.about, each.found, each.remedy, each.cost) for each in recorded.findings] == kept
    with refused(where="interval"):
        homofact.Fit(fit.factorization).interval()
    broken = RecordedVerdict.of({"trusted": True, "bars": {"all": [{"kind": "sure"}]}})
    assert broken is not None
    assert broken.bars is None


def test_judging_takes_no_longer_than_it_may() -> None:
    """Half a second; four times as much for a machine that does other things."""
    verdict(train=MANY)
    began = time.process_time()
    verdict(train=measured(noisy(0.05)))
    assert time.process_time() - began < 2.0


def test_a_limit_wider_than_a_factor_of_ten_is_not_trusted() -> None:
    assert not bars().too_wide
    wide = ErrorBar.stated("albedo", BarKind.RIGHT, 2 * MOST, 0.9, (0, 75))
    assert ErrorBars((wide, *bars().bars[1:])).too_wide
    sound = verdict()
    assert sound.trusted
    doubted = replace(sound, bars=ErrorBars((wide, *sound.bars.bars[1:])))
    assert not doubted.trusted
    assert doubted.summary.startswith("not trusted; ")
    # Where no bars can be had at all, as of anisotropic samples, nothing was found wider than it may be.
    reason = "error bars were calibrated without anisotropic measurements"
    none = ErrorBars((ErrorBar("albedo", BarKind.WITHDRAWN, None, 0.9, (0, 75), reason),))
    assert not none.too_wide
    assert none.sentence() == f"how far it may be off is unknown: {reason}"


def test_estimated_limits_beyond_a_good_fit_are_called_wide() -> None:
    def bars(kind: BarKind, albedo: float | None, sky: float) -> ErrorBars:
        given = {"albedo": albedo, "highlight": 5.0, "sky": sky}
        return ErrorBars(tuple(ErrorBar(name, kind, error, 0.9, (0, 75)) for name, error in given.items()))

    assert not bars(BarKind.RIGHT, GOOD["albedo"], GOOD["sky"]).wide
    assert bars(BarKind.RIGHT, GOOD["albedo"] + 0.01, 0.01).wide
    assert bars(BarKind.FAULT, 0.01, GOOD["sky"] + 0.01).wide
    # What was measured is judged itself, and what is unknown has no limit.
    assert not bars(BarKind.MEASURED, 1.0, 1.0).wide
    assert not bars(BarKind.WITHDRAWN, None, 0.01).wide
    assert trust_in_words(True, "as it is", wide=True) == "trusted, with wide limits; as it is"
    # A saved sentence that has its first words stays as it is.
    assert trust_in_words(True, "trusted, with wide limits; as it is") == "trusted, with wide limits; as it is"


@pytest.mark.parametrize(
    ("kind", "rate", "words"),
    [
        (BarKind.RIGHT, 0.9, "true for eight to nine of ten such fits"),
        (BarKind.FAULT, 0.9, "true for about eight of ten such fits"),
        (BarKind.FAULT, 0.8, "true for 80% of such fits"),
    ],
)
def test_a_sentence_claims_no_more_than_held_in_the_calibration(kind: BarKind, rate: float, words: str) -> None:
    bars = tuple(ErrorBar(name, kind, 0.1, rate, (0.0, 75.0), "the samples look faulty") for name in QUANTITIES)
    assert words in ErrorBars(bars).sentence()


def test_extrapolated_angles_between_others_are_named_apart() -> None:
    errors = {0: (0.01, 0.0), 30: (0.02, 0.0), 45: (0.03, 0.3), 60: (0.04, 0.0)}
    by_angle = tuple(
        ErrorBar("albedo", BarKind.RIGHT, error, 0.9, (at, at), unmeasured=share)
        for at, (error, share) in errors.items()
    )
    bars = ErrorBars((ErrorBar("albedo", BarKind.RIGHT, 0.04, 0.9, (0.0, 60.0)),), by_angle)
    assert "within 4% at 0–30° and 60° and 3% at 45° (45° partly extrapolated)" in bars.sentence()


def test_the_first_and_last_angle_stand_for_what_is_measured_beyond_them() -> None:
    shares = {5: 0.0, 20: 0.0, 40: 0.2, 60: 0.4}
    by_angle = tuple(
        ErrorBar("albedo", BarKind.RIGHT, 0.01 * at / 5, 0.9, (at, at), unmeasured=share)
        for at, share in shares.items()
    )
    bars = ErrorBars((ErrorBar("albedo", BarKind.RIGHT, 0.12, 0.9, (0.0, 70.0)),), by_angle)
    assert "within 4% at 0–20°, 8% at 40° and 12% at 60–70° (40° and 60–70° partly extrapolated)" in bars.sentence()


@pytest.mark.parametrize(
    ("error", "words"), [(0.0465, "0.955 to 1.047"), (0.174, "0.851 to 1.18"), (4.13, "0.194 to 5.13"), (0.02, "0.98")]
)
def test_ranges_are_rounded_outwards_as_limits_are(error: float, words: str) -> None:
    bar = ErrorBar("albedo", BarKind.RIGHT, error, 0.9, (0.0, 75.0))
    found = bar.between()
    assert found.startswith(words)
    low, high = map(float, found.split(" to "))
    assert low <= (bar.low or 0)
    assert high >= (bar.high or 9)
