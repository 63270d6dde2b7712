"""Limits on the size of a system: when matrices are dense, how much memory they need, and how much is available.

The dense normal matrix of T texels has T² numbers, and its factor has as many. Up to `MOST_DENSE` texels, each needs at
most half a gigabyte, and a direct solve takes seconds. Larger systems are sparse (`linear.sparse_solve`).
"""

import contextlib
import os
import sys
from pathlib import Path

from homofact.errors import BadInput

MOST_DENSE = 8192
ROWS = 1024  # of a large matrix that are worked on at a time
_GIGABYTE = 2**30
# Interpreter, libraries and the sources' own tables.
_BESIDE = 0.6 * _GIGABYTE
_CGROUP = Path("/sys/fs/cgroup/memory.max")


def is_dense(unknowns: int) -> bool:
    """Return whether a system with this number of unknowns is dense."""
    return unknowns <= MOST_DENSE


def memory_of_machine() -> int | None:
    """Return the most bytes that this process may use, by machine, control group or process limit; None if unknown."""
    limits = []
    if hasattr(os, "sysconf") and "SC_PHYS_PAGES" in os.sysconf_names:
        limits.append(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    # None, or "max".
    with contextlib.suppress(OSError, ValueError):
        limits.append(int(_CGROUP.read_text()))
    if sys.platform != "win32":
        import resource

        limit = resource.getrlimit(resource.RLIMIT_AS)[0]
        if limit != resource.RLIM_INFINITY:
            limits.append(limit)
    return min((bound for bound in limits if bound > 0), default=None)


def room_in_memory() -> float | None:
    """Return the bytes of memory that are left for arrays besides the libraries; None if unknown."""
    has = memory_of_machine()
    return None if has is None else has - _BESIDE


def refuse_beyond_memory(what: str, nbytes: float, instead: str) -> None:
    """Raise BadInput if arrays of `nbytes` do not fit into the memory that is left besides the libraries.

    For the message, `what` states the setting and its value, and `instead` the expected value.
    """
    has, room = memory_of_machine(), room_in_memory()
    if has is not None and room is not None and nbytes > room:
        needed, there = ((nbytes + _BESIDE) / _GIGABYTE, has / _GIGABYTE)
        raise BadInput(f"{what} needs about {needed:.1f} GB of memory, and {there:.1f} GB are there; {instead}")
