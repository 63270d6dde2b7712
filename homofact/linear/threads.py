"""Threads for many small tasks: libraries use one thread, and independent tasks run in threads of homofact.

A fit solves thousands of systems of a few hundred unknowns. Solving each system with two threads of torch or BLAS gains
little on an idle machine. On a busy machine it is fifty times slower, since a spinning thread waits for a core that
another thread occupies. So libraries use one thread (`one_thread`), and whole tasks (ranges of samples, folds, mixes)
run in Python threads (`in_parallel`). The division into tasks does not depend on the number of threads, so results are
bit-identical for any number.
"""

import threading
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache, wraps
from typing import ParamSpec, TypeVar

import numba
import torch
from threadpoolctl import threadpool_limits

P = ParamSpec("P")
R = TypeVar("R")
T = TypeVar("T")
_inside = threading.local()


def one_thread(function: Callable[P, R]) -> Callable[P, R]:
    """Return the function with torch and BLAS set to one thread while it runs, and as before afterwards."""

    @wraps(function)
    def wrapped(*args: P.args, **kwargs: P.kwargs) -> R:
        # Asked for the first time, numba launches its threads and sets OpenMP's number, torch's too. That comes first.
        numba.get_num_threads()
        if torch.cuda.is_initialized():
            _load_linear_algebra()
        before = torch.get_num_threads()
        torch.set_num_threads(1)
        try:
            with threadpool_limits(limits=1, user_api="blas"):
                return function(*args, **kwargs)
        finally:
            torch.set_num_threads(before)

    return wrapped


def in_parallel(function: Callable[[T], R], pieces: Iterable[T]) -> list[R]:
    """Return [function(piece) …] in the order of the pieces, computed on numba's number of threads.

    A nested call of `in_parallel` within a piece runs its pieces one after the other. The functions only run faster in
    parallel if they release the interpreter's lock, as compiled kernels and LAPACK do.
    """
    listed = list(pieces)
    threads = numba.get_num_threads()
    if threads == 1 or len(listed) < 2 or getattr(_inside, "piece", False):
        return [function(piece) for piece in listed]

    def work(piece: T) -> R:
        _inside.piece = True
        return function(piece)

    return list(_workers(threads).map(work, listed))


@lru_cache(maxsize=1)
def _load_linear_algebra() -> None:
    """Let torch load its solvers for GPUs now: it loads them at their first use, and fails if threads do so at once."""
    torch.linalg.cholesky_ex(torch.ones(1, 1, device="cuda"))


@lru_cache(maxsize=1)
def _workers(threads: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(threads, thread_name_prefix="homofact")
