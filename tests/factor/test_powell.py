"""Golden section and Powell on functions whose minima are known."""

import math

import pytest
import torch

from homofact.errors import Status
from homofact.factor.search.golden import golden_section
from homofact.factor.search.powell import Powell
from homofact.geometry.rotation import Rotation


@pytest.mark.parametrize("minimum", [0.0, 0.1, -0.1, 1.0, -1.3, 2.5])
def test_golden_section_finds_the_minimum_of_a_cosine(minimum: float) -> None:
    def function(t: float) -> float:
        return 1 - math.cos(t - minimum)

    t, value = golden_section(function, function(0.0), 0.3, 1e-4, 4 * math.pi)
    assert t == pytest.approx(minimum, abs=1e-4)
    assert value == function(t)


def test_golden_section_on_a_flat_line_stays() -> None:
    assert golden_section(lambda t: 1.0, 1.0, 0.3, 1e-3, 4 * math.pi)[1] == 1.0


def test_golden_section_ends_on_a_function_that_falls_for_ever() -> None:
    t, _ = golden_section(lambda t: -t, 0.0, 0.3, 1e-3, 4 * math.pi)
    assert math.pi < t < 6 * math.pi


@pytest.mark.parametrize("seed", range(6))
def test_powell_recovers_a_planted_rotation_from_its_plane(seed: int) -> None:
    """The error is the distance between planes of projection, a function on SO(4) with flat directions."""
    generator = torch.Generator().manual_seed(seed)
    target = Rotation.random(generator).matrix()[:, :2]

    def error(rotation: Rotation) -> float:
        rows = rotation.matrix()[:, :2]
        return 2 - float((rows.T @ target).square().sum())

    powell = Powell(line_tolerance=1e-3, tolerance=1e-9, sweeps=40)
    found = [powell.minimize(error, Rotation.random(generator), seed) for _ in range(3)]
    rotation, report = min(found, key=lambda each: each[1].residual)
    assert report.residual < 1e-4
    assert report.residual == error(rotation)
    assert report.status is Status.CONVERGED


def test_the_report_counts_and_the_trace_only_falls() -> None:
    calls = 0

    def error(rotation: Rotation) -> float:
        nonlocal calls
        calls += 1
        return float((rotation.matrix() - torch.eye(4, dtype=torch.float64)).square().sum())

    start = Rotation.random(torch.Generator().manual_seed(1))
    rotation, report = Powell(sweeps=1).minimize(error, start, seed=5)
    assert report.evaluations == calls
    assert report.seed == 5
    assert report.status is Status.BUDGET
    values = [value for _, _, value in report.trace]
    assert values == sorted(values, reverse=True)
    assert values[-1] == report.residual < error(start)
    assert float(rotation.quaternions[0].norm()) == pytest.approx(1)
