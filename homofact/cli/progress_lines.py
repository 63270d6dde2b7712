"""Where a command is, in lines: for stderr where it is no terminal, such as a log."""

import math
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from homofact.api.progress import Progress, ProgressStep

FIRST, EVERY = 2.0, 15.0  # seconds to the first line, and between the others


class ProgressLines:
    """The stage of a command, its rate known from how it has gone on since the stage began."""

    def __init__(self, say: Callable[[str], object]) -> None:
        """Lines go to `say`."""
        self._say = say
        self._step = ProgressStep("starting")
        self._first, self._begun = 0.0, time.monotonic()
        self._ended = threading.Event()

    @contextmanager
    def running(self) -> Iterator[Progress]:
        """Say a line after `FIRST` seconds of the block and every `EVERY` seconds from then on."""
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
        self._step = step

    def _speak(self) -> None:
        wait = FIRST
        while not self._ended.wait(wait):
            self._say(self._words())
            wait = EVERY

    def _words(self) -> str:
        step, passed = self._step, time.monotonic() - self._begun
        parts = [step.stage]
        if step.figures:
            parts.append(step.figures)
        gone = step.done - self._first
        if step.total is not None and gone > 0:
            parts.append(f"about {duration(passed * (step.total - step.done) / gone)} left")
        elif passed >= EVERY:
            parts.append(f"for {duration(passed)}")
        return ", ".join(parts)


def duration(seconds: float) -> str:
    """Return seconds below two minutes, else minutes, or hours and minutes: as exact as an estimate is."""
    if seconds < 120:
        return f"{math.ceil(seconds)} s"
    minutes = math.ceil(seconds / 60)
    return f"{minutes} min" if minutes < 120 else f"{minutes // 60} h {minutes % 60} min"
