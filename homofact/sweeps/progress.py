"""What is said of a sweep while it runs: how much there is to do, for how long, and what went wrong."""

import time

from homofact.errors import Advice
from homofact.sweeps.local import TaskEnding
from homofact.sweeps.run import State


class SweepProgress:
    """Counts tasks; the time left is that of this run so far, a task, times those that are left."""

    def __init__(self, workers: int) -> None:
        """Nothing is done yet."""
        self._workers = workers
        self._begun, self._ended, self._left = time.monotonic(), 0, 0
        # How many results there are, of how many.
        self.done, self.total = 0, 0

    def begin(self, state: State) -> str:
        """Return the line that a sweep begins with."""
        self._begun, self._left = time.monotonic(), state.left
        self.done, self.total = state.done, len(state.tasks)
        before = f", {state.before} done before" if state.before else ""
        aside = sum(entry.final for entry in state.aside.values())
        set_aside = f", {aside} set aside before ({Advice('retry', True)} tries them again)" if aside else ""
        workers = f"{self._workers} worker{'' if self._workers == 1 else 's'}"
        fits = f"{len(state.tasks)} fit{'' if len(state.tasks) == 1 else 's'}"
        return f"{fits}{before}{set_aside}; {state.left} to do by {workers}"

    def end(self, state: State, ending: TaskEnding) -> None:
        """A task has ended."""
        self._left, self.done = state.left, state.done
        self._ended += ending.died is None

    def words(self) -> str:
        """For the progress bar, which adds the time left."""
        return f"{self._workers} at work"

    @property
    def seconds_left(self) -> float | None:
        """The seconds that the rest may take; None before the first task has ended."""
        return (time.monotonic() - self._begun) / self._ended * self._left if self._ended else None

    def misfortune(self, state: State, ending: TaskEnding) -> str:
        """Why a task did not end well, and what becomes of it."""
        if ending.refused is not None:
            return f"{ending.refused} (set aside)"
        if state.aside[ending.task.key].final:
            return f"{ending.died} again (set aside)"
        return f"{ending.died}, tried once more"
