"""Cases of a parametrized test that run with `-m slow` alone, beside those that always run."""

from collections.abc import Iterable
from typing import Any

import pytest


def slow_among(cases: Iterable[Any], *slow: Any) -> list[Any]:
    """The cases in their order, those of `slow` marked so; a case of several values is named by its first.

    Raises ValueError if there is no such case, or no other: then mark the test itself.
    """
    given = list(cases)
    first = [case[0] if isinstance(case, tuple) else case for case in given]
    if absent := [name for name in slow if name not in first]:
        raise ValueError(f"no such case: {absent}, expected some of {first}")
    if all(name in slow for name in first):
        raise ValueError("every case is slow: mark the test itself")
    return [
        pytest.param(*(case if isinstance(case, tuple) else (case,)), marks=pytest.mark.slow if name in slow else ())
        for case, name in zip(given, first, strict=True)
    ]
