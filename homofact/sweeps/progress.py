"""The messages of a running sweep: its number of tasks, the time left, and failures."""

from homofact.errors import Advice
from homofact.evaluation.estimate import TimeEstimate, fit_seconds
from homofact.evaluation.time_left import TimeLeft
from homofact.sweeps.local import TaskEnding
from homofact.sweeps.run import State

# How many samples the times of fits are modelled for: the sources are not open here. Measured times correct it.
_SAMPLES = 20_000
# Seconds to draw and write a result.
_WRITTEN = 1.5


class SweepProgress:
    """Count tasks, and estimate the time left from the times of finished fits with the same method and size."""

    def __init__(self, workers: int) -> None:
        """Nothing is done yet."""
        self._workers = workers
        self._places: dict[str, int] = {}
        self._estimate = TimeEstimate()
        # How many results there are, of how many.
        self.done, self.total = 0, 0

    def begin(self, state: State) -> str:
        """Return the line that a sweep begins with."""
        self._places = {key: place for place, key in enumerate(state.todo)}
        jobs = [(task.label, _WRITTEN + fit_seconds(task.fit_method(), _SAMPLES)) for task in state.todo.values()]
        self._estimate = TimeEstimate(jobs)
        self.done, self.total = state.done, len(state.tasks)
        before = f", {state.before} done before" if state.before else ""
        aside = sum(entry.final for entry in state.aside.values())
        set_aside = f", {aside} set aside before ({Advice('retry', True)} tries them again)" if aside else ""
        workers = f"{self._workers} worker{'' if self._workers == 1 else 's'}"
        fits = f"{len(state.tasks)} fit{'' if len(state.tasks) == 1 else 's'}"
        return f"{fits}{before}{set_aside}; {state.left} to do by {workers}"

    def end(self, state: State, ending: TaskEnding) -> None:
        """Record the end of a task."""
        self.done = state.done
        place = self._places.get(ending.task.key)
        if place is not None and ending.seconds is not None:
            self._estimate.finish(place, ending.seconds)
        elif place is not None and ending.task.key not in state.todo:
            self._estimate.skip(place)

    def words(self) -> str:
        """Return the text for the progress bar, which adds the time left."""
        return f"{self._workers} at work"

    @property
    def time_left(self) -> TimeLeft | None:
        """The time that the rest may take; None before the first fit is done."""
        return self._estimate.time_left(workers=self._workers) if self._estimate.done else None

    def misfortune(self, state: State, ending: TaskEnding) -> str:
        """Return why a task failed, and whether it is tried again."""
        if ending.refused is not None:
            return f"{ending.refused} (set aside)"
        if state.aside[ending.task.key].final:
            return f"{ending.died} again (set aside)"
        return f"{ending.died}, tried once more"
