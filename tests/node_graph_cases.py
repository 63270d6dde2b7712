"""A graph of math nodes run in numpy, with the arithmetic of Blender's nodes."""

from typing import Any

import numpy as np

from homofact.shading.node_graph import NodeGraph

# As Blender's manual has them: quotients by 0, and roots and logarithms of what has none, are 0.
MATH: dict[str, Any] = {
    "ADD": np.add, "SUBTRACT": np.subtract, "MULTIPLY": np.multiply, "SQRT": lambda a: np.sqrt(np.maximum(a, 0)),
    "DIVIDE": lambda a, b: np.where(b == 0, 0, a / np.where(b == 0, 1, b)), "ABSOLUTE": np.abs, "EXPONENT": np.exp,
    "COSINE": np.cos, "SINE": np.sin, "ARCTAN2": np.arctan2, "FLOOR": np.floor, "FRACT": lambda a: a - np.floor(a),
    "MAXIMUM": np.maximum, "MINIMUM": np.minimum, "LESS_THAN": lambda a, b: np.where(a < b, 1.0, 0.0),
    "LOGARITHM": lambda a, b: np.where(a > 0, np.log(np.where(a > 0, a, 1)) / np.log(b), 0),
}  # fmt: skip
VECTOR = {name: MATH[name] for name in ("ADD", "SUBTRACT", "MULTIPLY", "DIVIDE", "ABSOLUTE", "COSINE", "SINE", "FLOOR")}
VECTOR |= {name: MATH[name] for name in ("MAXIMUM", "MINIMUM")} | {"FRACTION": MATH["FRACT"]}


def lookup(texels: np.ndarray, place: np.ndarray) -> np.ndarray:
    """(3, N): bilinear, clamped to the edge; one channel is in all three."""
    rows, columns, channels = texels.shape
    x = np.clip(place[0] * columns - 0.5, 0, columns - 1)
    y = np.clip(place[1] * rows - 0.5, 0, rows - 1)
    j, i = (np.minimum(np.floor(each).astype(int), most - 1).clip(0) for each, most in ((x, columns), (y, rows)))
    u, v = (x - j)[:, None], (y - i)[:, None]
    right, above = np.minimum(j + 1, columns - 1), np.minimum(i + 1, rows - 1)
    low = (1 - u) * texels[i, j] + u * texels[i, right]
    high = (1 - u) * texels[above, j] + u * texels[above, right]
    return np.broadcast_to(((1 - v) * low + v * high).T, (3, len(u))) if channels in (1, 3) else low


def run(graph: NodeGraph, given: dict[str, np.ndarray], textures: list[np.ndarray]) -> np.ndarray:
    """The result (3, N) or (N,) of vectors (3, N) by name."""
    count = next(iter(given.values())).shape[1]
    values: dict[str, np.ndarray] = dict(given)

    def number(each: Any) -> np.ndarray:
        found = values[each] if isinstance(each, str) else np.full(count, float(each))
        assert found.ndim == 1, f"{each}: a vector where a number goes"
        return found

    def whole(each: Any) -> np.ndarray:
        found = values[each] if isinstance(each, str) else np.asarray(each, float)
        return np.broadcast_to(found[:, None] if found.shape == (3,) else found, (3, count))

    for k, (kind, *rest) in enumerate(graph.nodes):
        if kind == "separate":
            values |= {f"n{k}.{letter}": whole(rest[0])[i] for i, letter in enumerate("xyz")}
        elif kind == "combine":
            values[f"n{k}"] = np.stack([number(each) for each in rest])
        elif kind == "texture":
            values[f"n{k}"] = lookup(textures[rest[0]], whole(rest[1]))
        elif rest[0] == "DOT_PRODUCT":
            values[f"n{k}"] = (whole(rest[1]) * whole(rest[2])).sum(0)
        elif kind == "vector":
            values[f"n{k}"] = VECTOR[rest[0]](*map(whole, rest[1:]))
        else:
            assert kind == "math", kind
            values[f"n{k}"] = MATH[rest[0]](*map(number, rest[1:]))
    return values[graph.result]
