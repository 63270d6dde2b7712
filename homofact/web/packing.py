"""Arrays in an HTML page: bytes grouped, deflated, in base64.

An element's bytes are stored apart: first the lowest byte of all elements, then the next (little-endian). The high
bytes of neighbouring numbers are alike, the low ones are noise, and deflate does better with each by itself. The
page undoes it in `data.js`.
"""

import base64
import zlib
from collections import Counter
from typing import Any

import numpy as np

# Largest number in a half float, less a little.
_LARGEST = 60000.0

TYPES = ("float32", "float16", "uint8", "uint16", "int16", "uint32", "int32")


def pack(array: np.ndarray) -> dict[str, Any]:
    """Return `array`, of one of TYPES, as JSON: its type, its shape, and its bytes, the last axis fastest."""
    if array.dtype.name not in TYPES:
        raise ValueError(f"an array of {array.dtype.name}, expected one of {', '.join(TYPES)}")
    plain = np.ascontiguousarray(array, array.dtype.newbyteorder("<"))
    grouped = plain.view(np.uint8).reshape(-1, plain.itemsize).T.tobytes() if plain.size else b""
    data = base64.b64encode(zlib.compress(grouped, 6)).decode("ascii")
    return {"type": array.dtype.name, "shape": list(array.shape), "data": data}


def without_repeats(data: dict[str, Any]) -> dict[str, Any]:
    """Return a page's data with each packed array once: equal ones are in the list "repeated", named by their index.

    The page undoes it by `restored` of `data.js`.
    """
    counts: Counter[tuple[Any, ...]] = Counter()

    def count(node: Any) -> None:
        if _is_packed(node):
            counts[_identity(node)] += 1
            return
        for each in _children(node):
            count(each)

    count(data)
    places = {key: place for place, key in enumerate(key for key, number in counts.items() if number > 1)}
    repeated: list[dict[str, Any]] = [{}] * len(places)

    def replaced(node: Any) -> Any:
        if _is_packed(node):
            place = places.get(_identity(node))
            if place is None:
                return node
            repeated[place] = node
            return {"repeated": place}
        if isinstance(node, dict):
            return {name: replaced(each) for name, each in node.items()}
        return [replaced(each) for each in node] if isinstance(node, list) else node

    return {**replaced(data), "repeated": repeated}


def _is_packed(node: Any) -> bool:
    return isinstance(node, dict) and node.keys() == {"type", "shape", "data"}


def _identity(packed: dict[str, Any]) -> tuple[Any, ...]:
    return packed["type"], *packed["shape"], packed["data"]


def _children(node: Any) -> list[Any]:
    if isinstance(node, dict):
        return list(node.values())
    return node if isinstance(node, list) else []


def differences(array: np.ndarray, axes: tuple[int, ...]) -> np.ndarray:
    """Return each element less the one before it along each of `axes`, the first as it is; integers wrap around."""
    for axis in axes:
        first = np.take(array, [0], axis)
        array = np.concatenate((first, np.diff(array, axis=axis)), axis).astype(array.dtype)
    return array


def boxed(positions: np.ndarray) -> dict[str, Any]:
    """Positions (V, 3) rounded to 1/65535 of their box: its `low` corner, the `step` along each axis, and the codes."""
    low, high = positions.min(0), positions.max(0)
    step = np.maximum(high - low, 1e-12) / 65535
    codes = np.rint((positions - low) / step).astype(np.uint16)
    return {"low": low.tolist(), "step": step.tolist(), "positions": pack(codes)}


def halves(values: np.ndarray) -> tuple[np.ndarray, float]:
    """(float16, scale): what is stored of values; their product is within 2⁻¹¹ of each, or 1e-12 of the largest."""
    scale = float(np.float32(max(float(np.nanmax(np.abs(values), initial=0.0)), 1e-30) / _LARGEST))
    return (values / scale).astype(np.float16), scale
