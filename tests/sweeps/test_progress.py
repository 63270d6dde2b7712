"""What a sweep says of its time: one expectation, from the tasks that have ended in this run."""

from types import SimpleNamespace
from typing import Any

import pytest

from homofact.sweeps import progress
from homofact.sweeps.progress import SweepProgress


def test_the_time_left_is_of_the_tasks_that_are_left_and_in_no_words(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]
    monkeypatch.setattr(progress, "time", SimpleNamespace(monotonic=lambda: now[0]))
    counted = SweepProgress(2)
    state: Any = SimpleNamespace(left=4, done=0, tasks=range(4), before=0, aside={})
    counted.begin(state)
    assert counted.seconds_left is None
    now[0] = 30.0
    state.left, state.done = 3, 1
    counted.end(state, SimpleNamespace(died=None))  # type: ignore[arg-type]
    assert counted.seconds_left == 90.0
    # A worker that died has ended no task.
    now[0] = 40.0
    counted.end(state, SimpleNamespace(died="killed"))  # type: ignore[arg-type]
    assert counted.seconds_left == 120.0
    now[0] = 60.0
    state.left = 2
    counted.end(state, SimpleNamespace(died=None))  # type: ignore[arg-type]
    assert counted.seconds_left == 60.0
    assert counted.words() == "2 at work"
