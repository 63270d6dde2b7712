"""Every check of a verdict on both sides of its threshold, on reflectances whose faults are made to measure."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import pytest
import torch
from torch import Tensor

from homofact.brdf.log_transform import LogTransform
from homofact.brdf.materials import material
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model
from homofact.errors import Report, Status
from homofact.evaluate.appearance import Appearance
from homofact.evaluate.energy import EnergyErrors
from homofact.evaluate.findings import Verdict
from homofact.evaluate.metrics import SixErrors
from homofact.evaluate.verdict import judge
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
    ("name", "good", "bad"), [("condition", 0.9e12, 1.1e12), ("determined", 0.51, 0.49), ("condition", 1.0, math.inf)]
)
def test_the_system(name: str, good: Any, bad: Any) -> None:
    assert names(verdict(**{name: good})) == set()
    assert names(verdict(**{name: bad})) == {name}


def test_the_gap_is_held_out_over_training_and_counts_from_an_error_that_is_seen() -> None:
    assert verdict(log_mse=(2e-3, 5e-3)).gap == pytest.approx(2.5)
    assert names(verdict(log_mse=(2e-3, 5e-3))) == {"gap"}
    assert names(verdict(log_mse=(2e-3, 3.9e-3))) == set()
    assert names(verdict(log_mse=(5e-3, 2e-3))) == set()
    assert names(verdict(log_mse=(1e-5, 0.9e-3))) == set()


def noisy(level: float) -> Samples:
    noise = torch.randn(TRAIN.values.shape, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    return replace(TRAIN, values=TRAIN.values * torch.exp(level * noise))


def test_a_misfit_is_held_against_the_noise() -> None:
    assert verdict(log_mse=(0.05, 0.05)).misfit == pytest.approx(math.sqrt(0.05))
    assert names(verdict(log_mse=(0.039, 0.039))) == set()
    assert names(verdict(log_mse=(0.05, 0.05))) == {"misfit"}
    # Three times a scatter of an eighth: no fit can be nearer than its own samples are to each other.
    assert "misfit" not in names(verdict(train=noisy(0.13), log_mse=(0.05, 0.05)))
    assert "misfit" in names(verdict(train=noisy(0.13), log_mse=(0.3, 0.3)))


def test_the_worst_channel_is_what_is_explained() -> None:
    def without(values: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
        return torch.cat((values[:, :2], values[:, 2:].mean().expand(len(values), 1)), 1)

    found = verdict(Altered(without))
    assert "explained" in names(found)
    assert found.explained < 0.2


@pytest.mark.parametrize(("factor", "found"), [(0.45, True), (0.6, False), (1.8, False), (2.2, True)])
def test_the_peak_may_be_neither_lost_nor_overdone(factor: float, found: bool) -> None:
    limit = float(TRAIN.values.mean(1).quantile(0.98))

    def scaled(values: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
        return torch.where(values.mean(1, keepdim=True) > limit, factor * values, values)

    one = verdict(Altered(scaled))
    assert one.peak == pytest.approx(factor, rel=1e-6)
    assert ("peak" in names(one)) is found


def test_one_wild_value_is_no_peak() -> None:
    at = int(TRAIN.values.mean(1).argmax())

    def wild(values: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
        same = (wi - TRAIN.wi[at]).abs().sum(1) + (wo - TRAIN.wo[at]).abs().sum(1) < 1e-12
        return torch.where(same[:, None], 50 * values, values)

    assert verdict(Altered(wild)).peak == pytest.approx(1, rel=1e-6)


@pytest.mark.parametrize(("share", "found"), [(0.03, False), (0.08, True)])
def test_values_that_are_cut_count_where_the_data_are_not_zero(share: float, found: bool) -> None:
    limit = float(torch.quantile(TEST.wi[:, 0], share))

    def cut(values: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
        return torch.where(wi[:, :1] < limit, 0.0, values)

    one = verdict(Altered(cut))
    assert one.cut == pytest.approx(share, abs=2e-3)
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
        assert ("epsilon" in names(verdict(fitted, train=floor))) is found


@pytest.mark.parametrize(("share", "found"), [(0.005, False), (0.02, True)])
def test_zeros_of_one_channel_are_enough(share: float, found: bool) -> None:
    values = TRAIN.values.clone()
    values[: round(share * len(values)), 1] = 0
    assert ("zeros" in names(verdict(train=replace(TRAIN, values=values)))) is found


def test_few_samples_far_off_are_outliers_and_many_are_none() -> None:
    def spoilt(every: int) -> Samples:
        values = noisy(0.01).values.clone()
        values[::every] *= 20
        return replace(TRAIN, values=values)

    assert "outliers" in names(verdict(train=spoilt(50)))
    assert "outliers" not in names(verdict(train=spoilt(10)))
    assert "outliers" not in names(verdict(train=noisy(0.01)))


def seen(albedo: float = 1.0, highlight: float = 1.0, floor: float = 0.0) -> Appearance:
    """An appearance of one angle and two channels, the second of them reflecting `albedo` of the source's light."""
    light = EnergyErrors(
        (5.0,), ((0.5, 0.5),), ((0.5, 0.5 * albedo),), (1.0, 1.0), 1.0, 0.1, floor, highlight, 1.0, None
    )
    return Appearance(light, 30.0, 30.0)


@pytest.mark.parametrize("name", ["albedo", "highlight"])
@pytest.mark.parametrize(("ratio", "found"), [(0.89, True), (0.91, False), (1.09, False), (1.11, True), (0.0, True)])
def test_light_that_is_not_the_sources(name: str, ratio: float, found: bool) -> None:
    one = verdict(seen=seen(**{name: ratio}))
    assert names(one) == ({name} if found else set())
    assert {"albedo": one.albedo_ratio, "highlight": one.highlight}[name] == pytest.approx(ratio)
    if found:
        words = one.findings[0].line()
        assert f"{ratio:.3g} of the source's light, expected 1 within 10%: " in words
        assert len(words.partition(": ")[2]) > 20


def test_light_is_not_judged_where_the_source_cannot_be_asked() -> None:
    one = verdict()
    assert (one.albedo_ratio, one.highlight, one.floor) == (None, None, None)


def test_energy_that_is_made_at_grazing_angles_alone() -> None:
    limit = math.cos(math.radians(80))

    def grazing(values: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
        return torch.where(wi[:, 2:] < limit, 4 * values, values)

    one = verdict(Altered(grazing))
    assert one.albedo > 1.02 > verdict().albedo
    assert "energy" in names(one)


def test_the_sources_own_floor_stands_beside_what_it_bounds() -> None:
    reciprocal = Search(reciprocal=True)
    words = "no reciprocal fit comes nearer to this source than 12% RMS"
    found = {each.name: each for each in verdict(seen=seen(floor=0.12), settings=reciprocal).findings}
    assert set(found) == {"reciprocity"}
    assert "the source's two orders of directions differ by 24% RMS" in found["reciprocity"].found
    assert words in found["reciprocity"].found
    assert names(verdict(seen=seen(floor=0.04), settings=reciprocal)) == set()
    # A fit that follows such a source is not blamed for not being reciprocal either.
    crooked = Altered(lambda values, wi, wo: values * torch.where(wi[:, 2:] > wo[:, 2:], 1.5, 1.0))
    assert "reciprocity" in names(verdict(crooked))
    assert "reciprocity" not in names(verdict(crooked, seen=seen(floor=0.12)))
    # What is not explained may be what no reciprocal fit could.
    flat = Altered(lambda values, *_: values.mean(0).expand_as(values))
    for floor, said in ((0.12, True), (0.005, False)):
        one = next(each for each in verdict(flat, seen=seen(floor=floor)).findings if each.name == "explained")
        assert (" RMS)" in one.found) is said


@pytest.mark.parametrize(("power", "found"), [(0.05, False), (0.5, True)])
def test_reciprocity_of_the_fit(power: float, found: bool) -> None:
    def crooked(values: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
        return values * torch.where(wi[:, 2:] > wo[:, 2:], 1 + power, 1.0)

    assert ("reciprocity" in names(verdict(Altered(crooked)))) is found


def test_scatter_of_the_data() -> None:
    assert "scatter" not in names(verdict(train=noisy(0.15)))
    assert "scatter" in names(verdict(train=noisy(0.3)))
