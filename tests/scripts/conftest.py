"""What the tests of the programs in scripts/ share."""

import importlib
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import numba
import pytest
import torch

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"


@pytest.fixture
def script(monkeypatch: pytest.MonkeyPatch) -> Callable[[str], ModuleType]:
    """Imports a program by its name."""
    monkeypatch.syspath_prepend(str(SCRIPTS))
    return importlib.import_module


@pytest.fixture
def one_thread() -> Iterator[None]:
    """Problems so small only wait for their threads, and a sum's last bit must not hang on how they share it."""
    before = torch.get_num_threads(), numba.get_num_threads()
    torch.set_num_threads(1)
    numba.set_num_threads(1)
    yield
    torch.set_num_threads(before[0])
    numba.set_num_threads(before[1])
