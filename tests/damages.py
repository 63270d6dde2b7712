"""Damage to the arrays and the header of an archive, one at a time, as a careless or a hostile hand makes it."""

import copy
import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

VALUES = (None, -1, 0, 1e999, math.nan, 10**18, "", "x", [], {}, True, [[]], "9" * 5000)


def _with(array: np.ndarray, value: float) -> np.ndarray:
    changed = array.copy()
    if changed.size:
        changed.reshape(-1)[changed.size // 2] = value
    return changed


def _least(array: np.ndarray) -> np.ndarray:
    return _with(array, math.nan) if array.dtype.kind == "f" else _with(array, np.iinfo(array.dtype).min)


def _most(array: np.ndarray) -> np.ndarray:
    return _with(array, math.inf) if array.dtype.kind == "f" else _with(array, np.iinfo(array.dtype).max)


ARRAYS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "empty": lambda a: a[:0],
    "a number": lambda a: np.array(3.0),
    "deep": lambda a: a.reshape(-1)[:, None, None, None, None],
    "one fewer": lambda a: a[:-1],
    "doubled": lambda a: np.concatenate([a, a]),
    "turned": lambda a: a.T.copy(),
    "of other floats": lambda a: a.astype(np.float64 if a.dtype != np.float64 else np.float32),
    "of other numbers": lambda a: a.astype(np.int64 if a.dtype != np.int64 else np.int8),
    "of booleans": lambda a: a.astype(bool),
    "big-endian": lambda a: a.astype(a.dtype.newbyteorder(">")),
    "text": lambda a: np.array("text"),
    "negative": lambda a: _with(a, -5) if a.dtype.kind != "u" else a[:0],
    "most": _most,
    "least": _least,
    "huge": lambda a: _with(a, {"f": 1e38, "i": 99, "u": 99}[a.dtype.kind]),
    "all zero": np.zeros_like,
}


def array_damages(arrays: dict[str, np.ndarray]) -> Iterator[tuple[str, dict[str, np.ndarray]]]:
    """(what, the arrays) with every damage to every array, and without each."""
    for name, array in arrays.items():
        yield f"{name} gone", {key: each for key, each in arrays.items() if key != name}
        for what, damage in ARRAYS.items():
            yield f"{name} {what}", arrays | {name: damage(array)}


def _places(value: Any, place: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    if place:
        yield place
    entries = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in entries:
        yield from _places(inner, (*place, key))


def header_damages(header: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """(what, the header) with every entry replaced by what nobody means, and without each."""
    for place in _places(header):
        for value in (*VALUES, ...):
            changed = copy.deepcopy(header)
            inner: Any = changed
            for key in place[:-1]:
                inner = inner[key]
            if value is ...:
                del inner[place[-1]]
            else:
                inner[place[-1]] = value
            yield f"{place} {str(value)[:20]}", changed
