"""Encode arrays for an HTML page: group their bytes, deflate them, and write base64.

The bytes of an element are stored separately: first the lowest byte of all elements, then the next (little-endian). The
high bytes of neighbouring numbers are similar and the low bytes are noise, so deflate compresses them better
separately. The page decodes them in `data.js`.
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
    """Return `array`, of a type in TYPES, as JSON: type, shape, and bytes in C order."""
    if array.dtype.name not in TYPES:
        raise ValueError(f"an array of {array.dtype.name}, expected one of {', '.join(TYPES)}")
    plain = np.ascontiguousarray(array, array.dtype.newbyteorder("<"))
    grouped = plain.view(np.uint8).reshape(-1, plain.itemsize).T.tobytes() if plain.size else b""
    data = base64.b64encode(zlib.compress(grouped, 6)).decode("ascii")
    return {"type": array.dtype.name, "shape": list(array.shape), "data": data}


def without_repeats(data: dict[str, Any]) -> dict[str, Any]:
    """Return a page's data with repeated packed arrays moved to the list "repeated" and referenced by index.

    The page restores them with `restored` of `data.js`.
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
    """Return differences of successive elements along each of `axes`, keeping the first; integers wrap around."""
    for axis in axes:
        first = np.take(array, [0], axis)
        array = np.concatenate((first, np.diff(array, axis=axis)), axis).astype(array.dtype)
    return array


def boxed(positions: np.ndarray) -> dict[str, Any]:
    """Quantize positions (V, 3) to 1/65535 of their box: return its `low` corner, `step` per axis, and codes."""
    low, high = positions.min(0), positions.max(0)
    step = np.maximum(high - low, 1e-12) / 65535
    codes = np.rint((positions - low) / step).astype(np.uint16)
    return {"low": low.tolist(), "step": step.tolist(), "positions": pack(codes)}


def halves(values: np.ndarray) -> tuple[np.ndarray, float]:
    """Return (float16, scale) whose product equals each value within 2⁻¹¹, or within 1e-12 of the largest value."""
    scale = float(np.float32(max(float(np.nanmax(np.abs(values), initial=0.0)), 1e-30) / _LARGEST))
    return (values / scale).astype(np.float16), scale
