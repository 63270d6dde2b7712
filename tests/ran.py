"""How a command of the program ended, for the tests of commands (`run` in tests/cli/conftest.py)."""

from typing import NamedTuple


class Ran(NamedTuple):
    """How a command ended."""

    code: int
    out: str
    err: str
