"""Evaluate expressions on arrays of torch, Dr.Jit or any library with the same functions.

A value is the list of its components, each an array (or a plain number, for a constant); The evaluation never inspects
an array, so it works for any shape, type and device, and can be traced. `NUMPY` is the table of functions for arrays;
that for tensors is in `torch_functions`, since this module loads no torch.
"""

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np

from homofact.geometry.expression import INFIX, Expression, Let

Value = list[Any]
Fetch = Callable[[int, Value], Value]
_OPERATORS: dict[str, Callable[[Any, Any], Any]] = {
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
    "*": lambda a, b: a * b,
    "/": lambda a, b: a / b,
}


def interpret(
    statements: Iterable[Let],
    values: dict[str, Value],
    functions: Mapping[str, Callable[..., Any]],
    fetch: Fetch | None = None,
) -> dict[str, Value]:
    """Evaluate statements; return `values` of the parameters by name, with those of the statements added.

    `functions` is a table for all of `FUNCTIONS` that the statements use, on single components; dot needs none.
    `fetch` gives the channels of a texture, by its number, at a place; of a cube map the place is the direction with
    the level behind it.
    """
    for statement in statements:
        values[statement.name] = value_of(statement.expression, values, functions, fetch)
    return values


def value_of(
    expression: Expression,
    values: Mapping[str, Value],
    functions: Mapping[str, Callable[..., Any]],
    fetch: Fetch | None = None,
) -> Value:
    """Return the components of one expression over named values; arguments as `interpret`."""
    kind = expression.kind
    if kind == "constant":
        return list(expression.values)
    if kind == "name":
        return values[expression.text]
    parts = [value_of(operand, values, functions, fetch) for operand in expression.operands]
    if kind == "swizzle":
        return [parts[0]["xyzw".index(letter)] for letter in expression.text]
    if kind == "vector":
        return [component for part in parts for component in part]
    if kind in ("fetch", "cube"):
        assert fetch is not None, "a program with textures needs a way to read them"
        return fetch(int(expression.text), [component for part in parts for component in part])
    if kind == "dot":
        total, *products = (a * b for a, b in zip(*parts, strict=True))
        for product in products:
            total = total + product
        return [total]
    function = _OPERATORS[kind] if kind in INFIX else functions[kind]
    # A scalar counts for each component.
    return [function(*(part[k if len(part) > 1 else 0] for part in parts)) for k in range(expression.dimension)]


NUMPY: dict[str, Callable[..., Any]] = {
    "sqrt": np.sqrt,
    "abs": np.abs,
    "exp": np.exp,
    "log": np.log,
    "asinh": np.arcsinh,
    "cos": np.cos,
    "sin": np.sin,
    "atan2": np.arctan2,
    "floor": np.floor,
    "fract": lambda x: x - np.floor(x),
    "max": np.maximum,
    "min": np.minimum,
    "step": lambda edge, x: (x >= edge).astype(x.dtype),
}
