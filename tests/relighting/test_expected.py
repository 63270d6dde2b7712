"""How long stages of relighting are expected to take: laws of the estimate, and that every long stage announces one."""

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
from homofact.relighting import expected
from homofact.relighting.expected import error_seconds, evaluation_seconds, factoring_seconds, planning_seconds

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
    assert slow.pairs == 2 * expected._PROBED


def test_expected_seconds_follow_the_work(slow: Any) -> None:
    assert factoring_seconds(slow) == pytest.approx(8.0)
    assert planning_seconds(slow) == pytest.approx(15.0)
    quick = error_seconds(slow, 64, 64, False)
    assert quick == pytest.approx(2 * 64 * 6 * 64**2 * 1.3e-6)
    assert error_seconds(slow, 128, 64, False) == pytest.approx(2 * quick)
    assert error_seconds(slow, 64, 128, False) == pytest.approx(4 * quick)
    assert error_seconds(slow, 64, 64, True) > 10 * quick


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
