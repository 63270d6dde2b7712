"""What every search over a vector of projections must do, whatever its algorithm."""

import math

import pytest
import torch

from homofact.errors import BadInput, Status
from homofact.factor.objective import Objective
from homofact.factor.projection import Projection
from homofact.factor.search.minimize import minimize
from homofact.factor.textures import LogSamples
from homofact.geometry.directions import draw_in_discs
from homofact.geometry.rotation import Rotation
from homofact.methods.search_task import search_named

NAMES = (
    "gradient",
    "powell",
    "nlopt-PRAXIS",
    "nlopt-SBPLX",
    "nlopt-BOBYQA",
    "nlopt-COBYLA",
    "nlopt-LD_LBFGS",
    "nlopt-LD_SLSQP",
    "nlopt-MLSL",
)


def _objective(count: int = 800) -> Objective:
    """One texture over a planted projection, started a fifth of a radian away from it."""
    wi, wo = draw_in_discs(count, torch.Generator().manual_seed(0), 0.98)
    planted = Rotation.random(torch.Generator().manual_seed(7))
    u, v = Projection.from_rotation("half-diff", planted, False).place(wi, wo)[0].unbind(1)
    logs = (torch.sin(3 * u) + torch.cos(2 * v) * u)[:, None]
    step = torch.randn(2, 4, dtype=torch.float64, generator=torch.Generator().manual_seed(2)) * 0.1
    near = Rotation.of_numbers(planted.quaternions + step)
    start = Projection.from_rotation("half-diff", near, False)
    return Objective(LogSamples(wi, wo, logs, torch.ones(count).double()), (start,), ((8, 8),), 1e-4)


@pytest.mark.parametrize("name", NAMES)
def test_it_goes_down_reports_what_it_returns_and_only_gets_better(name: str) -> None:
    objective = _objective()
    start = objective.start()
    first = objective.error(start)
    vector, report = minimize(search_named(name), objective, start, seconds=5, seed=3)
    assert report.residual == pytest.approx(objective.error(vector), rel=1e-9)
    assert report.residual < 0.7 * first
    values = [value for _, _, value in report.trace]
    assert values == sorted(values, reverse=True)
    assert values[-1] == report.residual
    assert report.seed == 3
    assert report.evaluations >= len(values)
    assert search_named(name).name == name


@pytest.mark.parametrize("name", NAMES)
def test_a_guard_that_strikes_at_once_still_gives_one_evaluation(name: str) -> None:
    objective = _objective()
    vector, report = minimize(search_named(name), objective, objective.start(), seconds=1e-9)
    assert report.status is Status.GUARD
    assert report.evaluations == 1
    assert math.isfinite(report.residual)
    assert vector.shape == objective.start().shape


@pytest.mark.parametrize("name", NAMES)
def test_an_interrupt_keeps_the_best_so_far(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    objective = _objective()
    calls = 0

    def interrupted(original):
        def wrapper(vector):
            nonlocal calls
            calls += 1
            if calls > 4:
                raise KeyboardInterrupt
            return original(vector)

        return wrapper

    monkeypatch.setattr(objective, "evaluate", interrupted(objective.evaluate))
    monkeypatch.setattr(objective, "error", interrupted(objective.error))
    vector, report = minimize(search_named(name), objective, objective.start(), seconds=20)
    assert report.status is Status.INTERRUPTED
    monkeypatch.undo()
    assert report.residual == pytest.approx(objective.error(vector), rel=1e-9)


@pytest.mark.parametrize("name", NAMES)
def test_the_same_start_gives_the_same_end(name: str) -> None:
    ends = []
    for _ in range(2):
        objective = _objective(300)
        vector, _ = minimize(search_named(name).limited(6), objective, objective.start(), seconds=60, seed=1)
        ends.append(vector)
    assert torch.equal(ends[0], ends[1])


@pytest.mark.parametrize("name", ["annealing", "nlopt-ANNEALING", "nlopt-"])
def test_an_unknown_search_is_named(name: str) -> None:
    with pytest.raises(BadInput, match="search: found"):
        search_named(name)
