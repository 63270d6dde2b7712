"""Progress of a long call: the same callback for every public function.

homofact.compare("paint.brdf", progress=lambda step: print(step.stage, step.done, step.total))
"""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from homofact.evaluation.time_left import TimeLeft

if TYPE_CHECKING:
    from homofact.evaluation.estimate import TimeEstimate
    from homofact.methods.fitting import FitProgress

WORTH_SAYING = 5.0  # seconds that a call may take without saying so


@dataclass(frozen=True)
class ProgressStep:
    """Progress of a call: the `stage` in words, `done` of `total` parts (None if unknown), and `figures` of a fit.

    `time` is the time that is left of the call or of its stage, as a range, and None if there is no estimate. A step
    with a `note` contains a message for the user and does not change the progress. If it is `passing`, the message only
    explains a wait and can be removed afterwards. `task` is the name of a counted stage without its count and figures,
    so it is the same for all parts. It is empty if `stage` is already the name.
    """

    stage: str = ""
    done: float = 0.0
    total: float | None = None
    figures: str = ""
    note: str = ""
    passing: bool = False
    time: TimeLeft | None = None
    task: str = ""

    @property
    def left(self) -> float | None:
        """The expected seconds that are left; 0 if the step takes longer than expected, None without an estimate."""
        return None if self.time is None else self.time.now[0]


Progress = Callable[[ProgressStep], object]


class ProgressSteps:
    """Create the steps of one call and pass them to its callback, if there is one."""

    def __init__(self, progress: Progress | None = None) -> None:
        """Store the callback."""
        self._progress = progress
        self._stage, self._task, self._done, self._runs = "", "", 0, 1
        self._time: TimeLeft | None = None
        self._begun = 0.0

    def stage(self, name: str, left: float | TimeLeft | None = None) -> None:
        """Begin a stage without counted parts. `left` is the remaining time; None if it is unknown.

        A number is the expected seconds of the stage alone, which are known within a factor of 2.
        """
        self._begin(name, 0, 1, left)
        self._say(ProgressStep(name, time=self._time))

    def part(self, done: int, parts: int) -> None:
        """Say how many parts of the stage are done."""
        self._say(ProgressStep(self._stage, done, parts))

    def run(self, name: str, done: int, runs: int, left: float | TimeLeft | None = None) -> None:
        """Begin the next of several runs after `done` finished ones; `left` as in `stage`."""
        self._begin(f"{done + 1}/{runs} {name}", done, runs, left, name)
        self._say(ProgressStep(self._stage, done, runs, time=self._time, task=name))

    def note(self, text: str, passing: bool = False) -> None:
        """Pass a message to the callback."""
        self._say(ProgressStep(note=text, passing=passing))

    def estimate(self, estimate: "TimeEstimate") -> None:
        """Report the number of fits and their expected time, if this is at least `WORTH_SAYING` seconds."""
        if estimate.seconds_left >= WORTH_SAYING:
            self.note(estimate.words())

    def warm_up(self) -> None:
        """Load the compiled kernels before a fit is timed, and report the time if they had to be compiled."""
        from homofact.linear.normal import warm_up

        self.stage("compiling kernels, once per installation")
        seconds = warm_up()
        if seconds > 0:
            self.note(f"compiled its kernels in {seconds:.1f} s; from now on they are loaded", passing=True)

    def __call__(self, at: "FitProgress") -> None:
        """Report the progress of a fit."""
        done = at.term - 1 + (at.restart - 1) / max(at.restarts, 1)
        best = f", best {at.best:.4g}" if math.isfinite(at.best) else ""
        # A search of mixes has no restarts: only Cole's begins each term several times.
        again = f", restart {at.restart}/{at.restarts}" if at.restarts > 1 else ""
        words = f"{self._stage}: term {at.term}/{at.terms}{again}"
        figures = f"{at.evaluations} evaluations{best}"
        left = None if self._time is None else self._time.after(time.monotonic() - self._begun)
        if self._runs == 1:
            self._say(ProgressStep(words, done, at.terms, figures, time=left, task=self._task))
        else:
            part = self._done + done / max(at.terms, 1)
            self._say(ProgressStep(words, part, self._runs, figures, time=left, task=self._task))

    def _begin(self, stage: str, done: int, runs: int, left: float | TimeLeft | None, task: str = "") -> None:
        self._stage, self._done, self._runs, self._task = stage, done, runs, task or stage
        self._begun = time.monotonic()
        self._time = TimeLeft.within(left) if isinstance(left, int | float) else left

    def _say(self, step: ProgressStep) -> None:
        if self._progress is not None:
            self._progress(step)
