"""What a sweep says of its time: one expectation, from the tasks that have ended in this run."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from homofact.evaluation.estimate import fit_seconds
from homofact.methods.mccool import McCool
from homofact.methods.search import Search
from homofact.sweeps import work
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

    def seconds_left() -> float:
        assert counted.time_left is not None
        return counted.time_left.seconds

    counted = SweepProgress(2)
    counted.begin(state)
    assert counted.time_left is None
    modelled = {method: 1.5 + fit_seconds(method, 20_000) for method in (slow, fast)}
    end("a slow", seconds=3 * modelled[slow])
    # No fast one is done yet: of the model, corrected by what the slow one took.
    expected = 3 * (modelled[slow] + 3 * modelled[fast])
    assert seconds_left() == pytest.approx(expected / 2, rel=0.1)
    assert counted.time_left is not None
    assert counted.time_left.whole
    end("a fast", seconds=modelled[fast])
    expected = 3 * modelled[slow] + 2 * modelled[fast]
    assert seconds_left() == pytest.approx(expected / 2, rel=0.1)
    # A worker that died has ended no task; one that is set aside is not waited for.
    end("b slow", gone=False, seconds=None)
    assert seconds_left() == pytest.approx(expected / 2, rel=0.1)
    end("b slow", seconds=None)
    assert seconds_left() == pytest.approx(modelled[fast], rel=0.1)
    assert counted.words() == "2 at work"


def test_a_task_takes_all_the_time_that_its_worker_is_at_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Drawing and writing a result take longer than a quick fit."""
    now = [0.0]
    monkeypatch.setattr(work, "time", SimpleNamespace(monotonic=lambda: now[0]))

    def written(*_: Any) -> None:
        now[0] += 7.0

    def fitted(*_: Any, **__: Any) -> Any:
        now[0] += 2.0
        return SimpleNamespace(record=dict, seconds_total=1.0, seconds_read=0.0)

    monkeypatch.setattr(work, "put", written)
    monkeypatch.setattr(work, "fit_and_measure", fitted)
    monkeypatch.setattr(work, "_opened", lambda *_: None)
    settings: Any = SimpleNamespace(subset=0)
    task: Any = SimpleNamespace(
        key="k", version=work.__version__, source="s", digest="d", settings={"seed": 0}, held_out=0.2,
        source_settings=lambda: settings, fit_method=lambda: None,
    )  # fmt: skip
    assert work.do(task, tmp_path) == {"seconds": 9.0}
