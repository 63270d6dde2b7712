"""One thread for work in many small pieces.

A fit solves thousands of systems of a few hundred unknowns. Handing each to two threads of torch or BLAS
gains little on an idle machine and loses a factor of fifty on a busy one, where a spinning worker waits for
a core that its partner holds. The accumulation over samples has plain threads of its own.
"""

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

import torch
from threadpoolctl import threadpool_limits

P = ParamSpec("P")
R = TypeVar("R")


def one_thread(function: Callable[P, R]) -> Callable[P, R]:
    """The function with torch and BLAS set to one thread while it runs, and as before afterwards."""

    @wraps(function)
    def wrapped(*args: P.args, **kwargs: P.kwargs) -> R:
        before = torch.get_num_threads()
        torch.set_num_threads(1)
        try:
            with threadpool_limits(limits=1, user_api="blas"):
                return function(*args, **kwargs)
        finally:
            torch.set_num_threads(before)

    return wrapped
