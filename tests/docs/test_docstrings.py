"""The functions and methods of the package's interface begin their docstrings with a verb."""

import inspect
import re
from collections.abc import Callable, Iterator
from typing import Any

import pytest

import homofact

# What a function does. Attributes, properties and classes are described by noun phrases (PEP 257).
VERBS = {
    "Choose", "Describe", "Draw", "Factor", "Find", "Fit", "Make", "Measure", "Precompute", "Predict", "Read",
    "Return", "Run", "Say", "Write",
}  # fmt: skip


def public() -> Iterator[tuple[str, Callable[..., Any]]]:
    """Yield (name, function) of `homofact.__all__` and of the methods of its classes."""
    for name in sorted(homofact.__all__):
        found = getattr(homofact, name)
        if inspect.isfunction(found):
            yield name, found
        elif inspect.isclass(found):
            for method, value in vars(found).items():
                function = getattr(value, "__func__", value)
                if not method.startswith("_") and inspect.isfunction(function):
                    yield f"{name}.{method}", function


FUNCTIONS = dict(public())


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_docstring_begins_with_a_verb(name: str) -> None:
    first = (inspect.getdoc(FUNCTIONS[name]) or "").split("\n")[0]
    # A verb that is missing here belongs into `VERBS`.
    assert first.split(" ")[0] in VERBS, first
    assert re.search(r"[.:]$", first), "the first line is a sentence"


def test_functions_and_methods_are_found() -> None:
    assert {"fit", "factorize", "Fit.evaluate", "Samples.split"} <= FUNCTIONS.keys()
    assert "Fit.nbytes" not in FUNCTIONS
