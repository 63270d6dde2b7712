"""Print the progress of a command as lines, if stderr is not a terminal, for example for a log."""

import math
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from homofact.api.progress import Progress, ProgressStep
from homofact.evaluation.time_left import TimeLeft

# Seconds after which a stage is named, between a line and that of a new stage that counts its parts or has an expected
# time, and between the lines of one stage.
FIRST, SOON, EVERY = 2.0, 5.0, 15.0


class StageClock:
    """The time of the present stage of a command: how long it runs, and how much is left."""

    def __init__(self) -> None:
        """Start with the stage that every command begins with."""
        self.step = ProgressStep("loading libraries")
        self._first, self._begun = 0.0, time.monotonic()
        self._taken = self._begun

    def take(self, step: ProgressStep) -> None:
        """Record a step. The rate is measured from the beginning of its stage."""
        if step.total != self.step.total or step.done < self.step.done or step.total is None:
            self._first, self._begun = step.done, time.monotonic()
        self.step, self._taken = step, time.monotonic()

    @property
    def passed(self) -> float:
        """The seconds of the stage so far."""
        return time.monotonic() - self._begun

    def left(self) -> str:
        """Return the time left in words: the expected one, or else that by the rate of the parts; empty if unknown."""
        step = self.step
        if step.time is not None:
            return step.time.after(time.monotonic() - self._taken).words()
        gone = step.done - self._first
        if step.total is None or gone <= 0:
            return ""
        return TimeLeft.at_rate(gone, step.total - step.done, self.passed).words()


class ProgressLines:
    """The lines of a command's progress."""

    def __init__(self, say: Callable[[str], object]) -> None:
        """Lines go to `say`."""
        self._say = say
        self._clock = StageClock()
        self._ended = threading.Event()

    @contextmanager
    def running(self) -> Iterator[Progress]:
        """Print a line after `FIRST` seconds, then every `EVERY` seconds, and when a new stage has lasted `FIRST`.

        A new stage with parts or an expected time is printed no sooner than `SOON` seconds after the previous line,
        because such a stage may change with every fit.
        """
        speaker = threading.Thread(target=self._speak, daemon=True)
        speaker.start()
        try:
            yield self._take
        finally:
            self._ended.set()
            speaker.join()

    def _take(self, step: ProgressStep) -> None:
        if not step.note:
            self._clock.take(step)

    def _speak(self) -> None:
        tick = FIRST / 2
        silent, seen, lasted, said = EVERY - FIRST, _task(self._clock.step), 0.0, ""
        while not self._ended.wait(tick):
            step = self._clock.step
            silent, lasted = silent + tick, lasted + tick if _task(step) == seen else 0.0
            seen = _task(step)
            counted = step.total is not None or step.time is not None
            new = lasted >= FIRST and seen != said
            if silent >= EVERY or (new and (not counted or silent >= SOON)):
                self._say(self._words())
                silent, said = 0.0, seen

    def _words(self) -> str:
        step, passed = self._clock.step, self._clock.passed
        left = self._clock.left() or (f"for {duration(passed)}" if passed >= EVERY else "")
        return ", ".join(part for part in (step.stage, step.figures, left) if part)


def _task(step: ProgressStep) -> str:
    """What is done, whatever part of it."""
    return step.task or step.stage


def duration(seconds: float) -> str:
    """Return seconds below two minutes, else minutes, or hours and minutes."""
    if seconds < 120:
        return f"{math.ceil(seconds)} s"
    minutes = math.ceil(seconds / 60)
    return f"{minutes} min" if minutes < 120 else f"{minutes // 60} h {minutes % 60} min"
