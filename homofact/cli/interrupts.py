"""Track whether Ctrl-C was pressed while a command ran, and whether the command reported it.

An interrupted search keeps its best result and reports it. But an interrupt can also be lost: in a callback or a
destructor of a library, Python's exception has no effect. The command must not end as if there had been no interrupt.
"""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType


@dataclass
class Watch:
    """A record of interrupts: `untold` is true after an interrupt that was not reported."""

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
    """Record that the command has reported the interrupt to the user."""
    for watch in _watches:
        watch.untold = False
