"""Print the progress of a command as lines, if stderr is not a terminal, for example for a log."""

import math
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from homofact.api.progress import Progress, ProgressStep

# Seconds after which a stage is named, between a line and that of a new stage that counts its parts or has an expected
# time, and between the lines of one stage.
FIRST, SOON, EVERY = 2.0, 5.0, 15.0


class ProgressLines:
    """The stage of a command; its rate is measured from the beginning of the stage."""

    def __init__(self, say: Callable[[str], object]) -> None:
        """Lines go to `say`."""
        self._say = say
        self._step = ProgressStep("loading libraries")
        self._first, self._begun = 0.0, time.monotonic()
        self._taken = self._begun
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
        if step.note:
            return
        if step.total != self._step.total or step.done < self._step.done or step.total is None:
            self._first, self._begun = step.done, time.monotonic()
        self._step, self._taken = step, time.monotonic()

    def _speak(self) -> None:
        tick = FIRST / 2
        silent, seen, lasted, said = EVERY - FIRST, _task(self._step), 0.0, ""
        while not self._ended.wait(tick):
            step = self._step
            silent, lasted = silent + tick, lasted + tick if _task(step) == seen else 0.0
            seen = _task(step)
            new = lasted >= FIRST and seen != said
            if silent >= EVERY or (new and (step.total is None or silent >= SOON)):
                self._say(self._words())
                silent, said = 0.0, seen

    def _words(self) -> str:
        step, passed = self._step, time.monotonic() - self._begun
        parts = [step.stage]
        if step.figures:
            parts.append(step.figures)
        gone = step.done - self._first
        if step.left is not None:
            parts.append(time_left(step.left - (time.monotonic() - self._taken)))
        elif step.total is not None and gone > 0:
            parts.append(f"about {duration(passed * (step.total - step.done) / gone)} left")
        elif passed >= EVERY:
            parts.append(f"for {duration(passed)}")
        return ", ".join(parts)


def _task(step: ProgressStep) -> str:
    """What is done, whatever part of it."""
    return step.task or step.stage


def time_left(seconds: float) -> str:
    """Return the expected time left in words; `seconds` below 0 means that it takes longer than expected.

    Examples
    --------
    >>> time_left(40), time_left(-3)
    ('about 40 s left', 'takes longer than expected')
    """
    return f"about {duration(seconds)} left" if seconds > 0 else "takes longer than expected"


def duration(seconds: float) -> str:
    """Return seconds below two minutes, else minutes, or hours and minutes: as exact as an estimate is."""
    if seconds < 120:
        return f"{math.ceil(seconds)} s"
    minutes = math.ceil(seconds / 60)
    return f"{minutes} min" if minutes < 120 else f"{minutes // 60} h {minutes % 60} min"
