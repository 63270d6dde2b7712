"""Threads for work in many small pieces: one for every library, and our own for pieces that stand by themselves.

A fit solves thousands of systems of a few hundred unknowns. Handing each to two threads of torch or BLAS
gains little on an idle machine and loses a factor of fifty on a busy one, where a spinning worker waits for
a core that its partner holds. So libraries work on one thread (`one_thread`), and whole pieces (ranges of samples,
folds, mixes to be judged) are given to plain threads (`in_parallel`). What a piece is never depends on how many threads
there are, so neither does any bit of a result.
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
    """[function(piece) …] in the order of the pieces, on as many threads as numba is given.

    A piece that is parallel itself works through its own pieces in turn. The functions must let go of the
    interpreter's lock (compiled kernels, LAPACK) to gain anything.
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
