"""What the tests of the programs in scripts/ share."""

import importlib
from collections.abc import Callable, Iterator
from types import ModuleType

import numba
import pytest
import torch


@pytest.fixture
def script() -> Callable[[str], ModuleType]:
    """Imports a program of scripts/ by its name, "accuracy.seeds"."""
    return lambda name: importlib.import_module(f"scripts.{name}")


@pytest.fixture
def one_thread() -> Iterator[None]:
    """Problems so small only wait for their threads, and a sum's last bit must not hang on how they share it."""
    before = torch.get_num_threads(), numba.get_num_threads()
    torch.set_num_threads(1)
    numba.set_num_threads(1)
    yield
    torch.set_num_threads(before[0])
    numba.set_num_threads(before[1])
