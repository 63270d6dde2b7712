"""Whether Ctrl-C came while a command ran, and whether the user was told what became of it.

A search that is interrupted keeps its best and reports it. But an interrupt can also be lost: raised in a callback or a
destructor of a library, Python's exception ends nothing. A command then must not end as if nobody had asked it to stop.
"""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType


@dataclass
class Watch:
    """Whether an interrupt came that nothing was said of."""

    untold: bool = False


_watches: list[Watch] = []


@contextmanager
def watched() -> Iterator[Watch]:
    """Watch for interrupts while the block runs; they are raised as before."""
    watch = Watch()
    before = signal.getsignal(signal.SIGINT)
    # Elsewhere they cannot be watched for, and where another handler is, they are its own.
    if threading.current_thread() is not threading.main_thread() or before is not signal.default_int_handler:
        yield watch
        return

    def came(number: int, frame: FrameType | None) -> None:
        watch.untold = True
        signal.default_int_handler(number, frame)

    _watches.append(watch)
    signal.signal(signal.SIGINT, came)
    try:
        yield watch
    finally:
        signal.signal(signal.SIGINT, before)
        _watches.pop()


def told() -> None:
    """Note that the user hears what became of the interrupt."""
    for watch in _watches:
        watch.untold = False
