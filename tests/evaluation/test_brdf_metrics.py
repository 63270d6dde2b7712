"""The wider BRDF metrics: values by hand, laws of scale and perfection, and what each of them weighs."""

import math
from dataclasses import dataclass, replace

import pytest
import torch
from torch import Tensor

from homofact.brdf.analytic import Lambert
from homofact.brdf.log_transform import LogTransform
from homofact.brdf.materials import material
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model
from homofact.evaluation.brdf_metrics import EvaluatedPairs, uniform_weights
from homofact.evaluation.metric_table import METRICS as TABLE
from homofact.evaluation.metric_table import SIX
from homofact.evaluation.metrics import six_errors
from homofact.geometry.directions import from_spherical

METRICS = {name: metric.formula for name, metric in TABLE.items() if metric.computed_from == "pairs"}
UNIT = LogTransform(0.01, torch.ones(1, dtype=torch.float64))


@dataclass(frozen=True)
class Fixed:
    """A reflectance that gives stored values, whatever it is asked."""

    values: Tensor

    channels = ("Y",)
    nbytes = 0
    fetches = 0

    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        return self.values


@dataclass(frozen=True)
class Skewed:
    """Another reflectance times (1 + amount · a pattern of both directions)."""

    base: Lambert
    amount: float

    channels = ("Y",)
    nbytes = 0
    fetches = 0

    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        return self.base.evaluate(wi, wo) * (1 + self.amount * torch.cos(7 * wi[:, :1] + 3 * wo[:, 2:]))


def pair(found: list[float], expected: list[float], theta_i: list[float], theta_o: list[float]) -> EvaluatedPairs:
    ti, to = (torch.tensor(x, dtype=torch.float64) * (math.pi / 180) for x in (theta_i, theta_o))
    wi, wo = from_spherical(ti, 0 * ti), from_spherical(to, 0 * to + math.pi)
    samples = Samples(wi, wo, torch.tensor(expected)[:, None], channels=("Y",), isotropic=True)
    return EvaluatedPairs(Fixed(torch.tensor(found, dtype=torch.float64)[:, None]), samples, UNIT)


def test_two_samples_by_hand() -> None:
    # cosθi is 1 and 1/2.
    judged = pair([3.0, 2.0], [1.0, 4.0], [0, 60], [0, 0])
    low = [math.log(4) - math.log(2), math.log(2) - math.log(3)]
    hand = {
        "mae": 2.0,
        "male": (abs(low[0]) + abs(low[1])) / 2,
        "cosine_rms": math.sqrt((2**2 + 1**2) / 2),
        "cube_root_rms": math.sqrt((4 ** (1 / 3) + 1) / 2),
        "low_rms": abs(low[1]),  # the first sample has sinθi = 0
        "log_rms_80": math.sqrt(
            (math.log(3.001 / 1.001) ** 2 + math.log(1.001 / 2.001) ** 2) / 2,
        ),
        "male_theta_i_0_30": abs(low[0]),
        "male_theta_i_60_75": abs(low[1]),
        "male_theta_h_0_10": abs(low[0]),
        "male_theta_h_30_90": abs(low[1]),  # half of 60°, within the band that begins at 30
    }
    judged = replace(judged, samples=replace(judged.samples, wi=from_spherical(*_angles([0, 61]))))
    exact = pair([3.0, 2.0], [1.0, 4.0], [0, 60], [0, 0])
    for name, value in hand.items():
        if ("_theta_" in name and "60_75" not in name and "30_90" not in name) or "_theta_" not in name:
            assert METRICS[name](exact) == pytest.approx(value, rel=1e-6), name
    # One degree inside the bands, since an edge falls by rounding.
    inner = math.log1p(2 * math.cos(math.radians(61))) - math.log1p(4 * math.cos(math.radians(61)))
    for name in ("male_theta_i_60_75", "male_theta_h_30_90"):
        assert METRICS[name](judged) == pytest.approx(abs(inner), rel=1e-6)
    assert math.isnan(METRICS["male_theta_i_30_60"](judged))


def _angles(degrees: list[float]) -> tuple[Tensor, Tensor]:
    theta = torch.tensor(degrees, dtype=torch.float64) * (math.pi / 180)
    return theta, 0 * theta


def test_grazing_pairs_do_not_count_under_80_degrees() -> None:
    same = pair([1.0, 9.0, 9.0], [1.0, 1.0, 1.0], [10, 85, 10], [10, 10, 85])
    assert METRICS["log_rms_80"](same) == 0
    assert math.isnan(METRICS["log_rms_80"](pair([1.0], [2.0], [85], [85])))


def test_a_perfect_fit_has_no_error() -> None:
    model = Lambert((0.5,), channels=("Y",))
    judged = EvaluatedPairs(model, sample_model(model, 500), UNIT, model)
    found = {name: metric(judged) for name, metric in METRICS.items()}
    assert found.pop("albedo") == pytest.approx(0.5, rel=0.03)
    assert all(value == pytest.approx(0, abs=1e-12) for value in found.values()), found


def test_the_six_are_those_of_the_thesis() -> None:
    model = material("lafortune-blue-paint").model
    samples = sample_model(model, 300)
    judged = EvaluatedPairs(Lambert((0.1, 0.2, 0.3)), samples, LogTransform.of(samples, 1e-5))
    six = six_errors(judged.found, samples.values, judged.transform).record()
    assert {name: METRICS[name](judged) for name in SIX} == six


@pytest.mark.parametrize(
    ("name", "power"), [("cosine_rms", 1), ("mae", 1), ("mse", 2), ("cube_root_rms", 1 / 3), ("log_mse", 0)]
)
def test_how_each_scales_with_the_reflectance(name: str, power: float) -> None:
    one = pair([3.0, 2.0, 0.4], [1.0, 4.0, 0.5], [0, 60, 70], [0, 10, 20])
    mean = UNIT.mean * 8
    eight = EvaluatedPairs(
        Fixed(one.found * 8), replace(one.samples, values=one.samples.values * 8), LogTransform(UNIT.epsilon, mean)
    )
    assert METRICS[name](eight) == pytest.approx(METRICS[name](one) * 8**power, rel=1e-9)


@pytest.mark.parametrize("name", [name for name in METRICS if name not in ("albedo", "energy_above_one")])
def test_more_error_is_never_a_better_number(name: str) -> None:
    model = Lambert((0.6,), channels=("Y",))
    samples = sample_model(model, 4000)
    errors = [METRICS[name](EvaluatedPairs(Skewed(model, a), samples, UNIT, model)) for a in (0.0, 0.05, 0.2, 0.8)]
    assert errors == sorted(errors)
    assert errors[0] < errors[1] < errors[3]


@pytest.mark.parametrize("scheme", ["discs", "cosine"])
def test_cosine_rms_is_the_same_integral_however_it_is_sampled(scheme: str) -> None:
    # f − f̂ = cosθo + ½: the mean over both hemispheres of (…)²cos²θi is (1/3 + 1/2 + 1/4)/3.
    samples = sample_model(Lambert((math.pi,), channels=("Y",)), 200_000, scheme, radius_squared=1.0)
    found = samples.values + samples.wo[:, 2:] + 0.5
    assert METRICS["cosine_rms"](EvaluatedPairs(Fixed(found), samples, UNIT)) == pytest.approx(
        math.sqrt((1 / 3 + 1 / 2 + 1 / 4) / 3), rel=0.01
    )
    measured = replace(samples, provenance={})
    assert torch.allclose(uniform_weights(measured), torch.full((200_000,), 1 / 200_000, dtype=torch.float64))


@pytest.mark.parametrize("rho", [0.2, 0.9])
def test_albedo_of_lambert_is_rho(rho: float) -> None:
    samples = sample_model(Lambert((0.5,), channels=("Y",)), 50)
    judged = EvaluatedPairs(Lambert((rho,), channels=("Y",)), samples, UNIT, Lambert((0.5,), channels=("Y",)))
    assert METRICS["albedo"](judged) == pytest.approx(rho, rel=0.02)
    assert METRICS["albedo_error"](judged) == pytest.approx(abs(rho - 0.5), rel=0.02)
    assert METRICS["energy_above_one"](judged) == 0
    assert math.isnan(METRICS["albedo_error"](replace(judged, source=None)))


def test_energy_above_one_is_told() -> None:
    samples = sample_model(Lambert((0.5,), channels=("Y",)), 50)
    bright = Skewed(Lambert((1.0,), channels=("Y",)), 0.0)
    judged = EvaluatedPairs(Fixed(torch.zeros(50, 1)), samples, UNIT)

    @dataclass(frozen=True)
    class Twice:
        channels = ("Y",)
        nbytes = 0
        fetches = 0

        def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
            return 2 * bright.evaluate(wi, wo)

    assert METRICS["energy_above_one"](replace(judged, reflectance=Twice())) == pytest.approx(1.0, rel=0.04)


def test_reciprocity_is_of_the_fit_alone() -> None:
    model = Lambert((0.5,), channels=("Y",))
    samples = sample_model(model, 50)
    assert METRICS["reciprocity"](EvaluatedPairs(model, samples, UNIT)) == 0
    assert METRICS["reciprocity"](EvaluatedPairs(Skewed(model, 0.5), samples, UNIT)) > 0.1
