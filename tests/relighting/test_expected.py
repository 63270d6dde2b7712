"""How long stages of relighting are expected to take: laws of the estimate, and that every long stage announces one."""

import math
from pathlib import Path
from typing import Any

import pytest
import torch
from relighting.ball_scene import TEXT
from slow_cases import slow_among
from torch import Tensor

from homofact.api.progress import ProgressStep
from homofact.api.relighting import relight
from homofact.brdf.analytic import Lambert
from homofact.meshes.shapes import sphere
from homofact.relighting import expected
from homofact.relighting.expected import (
    error_seconds,
    evaluation_seconds,
    factoring_seconds,
    planning_seconds,
    reference_seconds,
    whole_picture_seconds,
)

MATT = Lambert((0.5, 0.5, 0.5))


class Slow:
    """A reflectance whose clock runs a millisecond per evaluation."""

    channels = ("R", "G", "B")

    def __init__(self, clock: list[float]) -> None:
        self.clock, self.pairs = clock, 0

    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        assert wi.shape == wo.shape
        assert (wi[:, 2] > 0).all()
        assert torch.allclose(wi.norm(dim=1), torch.ones(len(wi), dtype=wi.dtype))
        self.clock[0] += 1e-6 * len(wi)
        self.pairs += len(wi)
        return torch.zeros(len(wi), 3, dtype=wi.dtype)


@pytest.fixture
def slow(monkeypatch: pytest.MonkeyPatch) -> Any:
    clock = [0.0]
    monkeypatch.setattr(expected.time, "perf_counter", lambda: clock[0])
    return Slow(clock)


def test_the_cost_of_a_pair_is_measured(slow: Any) -> None:
    assert evaluation_seconds(slow) == pytest.approx(1e-6)
    # One call warms up; the others take 0.05 s together.
    assert slow.pairs == (1 + math.ceil(0.05 / 1e-6 / expected._PROBED)) * expected._PROBED


def test_a_probe_that_is_interrupted_once_changes_the_cost_little(slow: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    evaluate, calls = slow.evaluate, []

    def interrupted(wi: Tensor, wo: Tensor) -> Tensor:
        calls.append(len(wi))
        slow.clock[0] += 0.01 if len(calls) == 5 else 0.0
        return evaluate(wi, wo)

    monkeypatch.setattr(slow, "evaluate", interrupted)
    assert 1e-6 < evaluation_seconds(slow) < 1.4e-6


def test_expected_seconds_follow_the_work(slow: Any) -> None:
    assert factoring_seconds(slow) == pytest.approx(11.0)
    assert planning_seconds(slow) == pytest.approx(15.0)
    quick = error_seconds(slow, 64, 64, False)
    assert quick == pytest.approx(2 * 64 * 6 * 64**2 * 1.3e-6)
    assert error_seconds(slow, 128, 64, False) == pytest.approx(2 * quick)
    assert error_seconds(slow, 64, 128, False) == pytest.approx(4 * quick)
    assert error_seconds(slow, 64, 64, True) > 10 * quick
    # The error sums at vertices and at as many pixels.
    assert whole_picture_seconds([slow, slow], 128, 64) == pytest.approx(quick)


def test_the_reference_is_summed_at_the_vertices_that_face_the_eye(slow: Any) -> None:
    ball = sphere()
    above = reference_seconds([(slow, ball)], (0.0, 100.0, 0.0), 8)
    half = (ball.normals[:, 1] > 0).sum() * 6 * 8**2 * 1.3e-6
    assert above == pytest.approx(half, rel=0.1)
    assert reference_seconds([(slow, ball)] * 2, (0.0, 100.0, 0.0), 8) == pytest.approx(2 * above)
    assert reference_seconds([(slow, ball)], (0.0, 0.0, 0.0), 8) < 0.1 * above


@pytest.mark.usefixtures("decomposed_once")
@pytest.mark.parametrize("tolerance", slow_among([False, True], True))
def test_every_long_stage_of_a_scene_says_how_long_it_is_expected_to_take(tolerance: bool, tmp_path: Path) -> None:
    text = TEXT.replace("steps = 6", "steps = 2").replace("[40, 30]", "[10, 8]")
    if tolerance:
        text = text.replace("kept = 40\nclusters = 2\ncomponents = 3\n", "[tolerance]\nreflected = 0.3\n")
    text += "[[camera]]\neye = [1, 1.5, 3]\npixels = [8, 8]\n" if not tolerance else ""
    (tmp_path / "scene.toml").write_text(text)
    told: list[ProgressStep] = []
    relight(tmp_path / "scene.toml", vertices=4, progress=told.append)
    timed = [step.stage for step in told if step.left is not None and step.left > 0]
    named = [
        *(f"factoring albedo {albedo}" for albedo in ("0.5", "0.2, 0.4, 0.6")),
        *(f"rendering picture {number} of 2" for number in (1, 2)),
    ]
    named = ["planning sphere", "planning ground", "rendering"] if tolerance else named
    assert [name for name in named if name not in timed] == []
    assert {"1/2 measuring the error of sphere", "2/2 measuring the error of ground"} <= {*timed}
