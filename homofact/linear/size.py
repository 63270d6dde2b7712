"""How large a system may be: what is made dense, what memory it takes, and what the machine has.

A dense normal matrix of T texels has T² numbers, and its factor as many. Up to `MOST_DENSE` that is half a gigabyte
each and the exact answer costs seconds; above it systems stay sparse (`linear.sparse_solve`).
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
    """Return whether systems of so many unknowns are made dense."""
    return unknowns <= MOST_DENSE


def memory_of_machine() -> int | None:
    """Bytes that this process may use at most: the machine's, its control group's or its own limit; None if unknown."""
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
    """Return bytes of arrays that fit beside the libraries into the machine's memory; None where it is unknown."""
    has = memory_of_machine()
    return None if has is None else has - _BESIDE


def refuse_beyond_memory(what: str, nbytes: float, instead: str) -> None:
    """Raise BadInput where `nbytes` of arrays do not fit beside the libraries into the machine's memory.

    `what` names the setting and what was found, `instead` what is expected.
    """
    has, room = memory_of_machine(), room_in_memory()
    if has is not None and room is not None and nbytes > room:
        needed, there = ((nbytes + _BESIDE) / _GIGABYTE, has / _GIGABYTE)
        raise BadInput(f"{what} needs about {needed:.1f} GB of memory, and {there:.1f} GB are there; {instead}")
