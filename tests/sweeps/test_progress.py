"""What a sweep says of its time: one expectation, from the tasks that have ended in this run."""

from types import SimpleNamespace
from typing import Any

import pytest

from homofact.evaluation.estimate import fit_seconds
from homofact.methods.mccool import McCool
from homofact.methods.search import Search
from homofact.sweeps.progress import SweepProgress


def test_the_time_left_is_of_the_methods_that_are_left_and_in_no_words() -> None:
    slow, fast = Search(effort="thorough"), McCool(size=8)
    made = {"a slow": slow, "a fast": fast, "b slow": slow, "b fast": fast, "c fast": fast}
    todo: dict[str, Any] = {
        key: SimpleNamespace(key=key, label=key[2:], fit_method=lambda method=method: method)
        for key, method in made.items()
    }
    state: Any = SimpleNamespace(done=0, tasks=range(5), before=0, aside={}, todo=dict(todo), left=5)

    def end(key: str, gone: bool = True, **how: Any) -> None:
        if gone:
            del state.todo[key]
        counted.end(state, SimpleNamespace(task=todo[key], **how))  # type: ignore[arg-type]

    counted = SweepProgress(2)
    counted.begin(state)
    assert counted.seconds_left is None
    end("a slow", seconds=100.0)
    # No fast one is done yet: of the model, corrected by what the slow one took, within a factor of two.
    modelled = fit_seconds(fast, 20_000)
    assert counted.seconds_left is not None
    assert (100 + 1.5 * modelled) / 2 <= counted.seconds_left <= (100 + 6 * modelled) / 2
    end("a fast", seconds=3.0)
    assert counted.seconds_left == pytest.approx((100 + 3 + 3) / 2)
    # A worker that died has ended no task; one that is set aside is not waited for.
    end("b slow", gone=False, seconds=None)
    assert counted.seconds_left == pytest.approx((100 + 3 + 3) / 2)
    end("b slow", seconds=None)
    assert counted.seconds_left == pytest.approx((3 + 3) / 2)
    assert counted.words() == "2 at work"
