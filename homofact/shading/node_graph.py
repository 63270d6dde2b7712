"""Convert the program to a graph of Blender's Math and Vector Math nodes.

A node is one of: ("math", operation, …) for numbers, ("vector", operation, …) for vectors (3,), ("combine", x, y, z)
which makes a vector, ("separate", vector) which gives its components, and ("texture", number, place), where place (3,)
is (u, v, 0). Each operand … is a number, three numbers, or a reference. The references are "wi" and "wo" (unit vectors
(3,) in the surface frame), "n7" for the value of node 7, and "n7.x" for a component of node 7, which must be a
"separate" node. A number that is used as a vector has this number in all components.

Operations on vectors of three components use vector nodes if Blender has one; otherwise they are split into components.
Equal nodes are shared.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import e
from typing import Any

from homofact.geometry.expression import INFIX, Expression
from homofact.shading.languages import number
from homofact.shading.program import Program

Reference = str | float | tuple[float, ...]
Node = tuple[Any, ...]

_MATH = {
    "+": "ADD", "-": "SUBTRACT", "*": "MULTIPLY", "/": "DIVIDE", "sqrt": "SQRT", "abs": "ABSOLUTE", "exp": "EXPONENT",
    "cos": "COSINE", "sin": "SINE", "atan2": "ARCTAN2", "floor": "FLOOR", "fract": "FRACT", "max": "MAXIMUM",
    "min": "MINIMUM",
}  # fmt: skip
_VECTOR = {
    "+": "ADD", "-": "SUBTRACT", "*": "MULTIPLY", "/": "DIVIDE", "abs": "ABSOLUTE", "cos": "COSINE", "sin": "SINE",
    "floor": "FLOOR", "fract": "FRACTION", "max": "MAXIMUM", "min": "MINIMUM",
}  # fmt: skip


@dataclass(frozen=True)
class NodeGraph:
    """`nodes` are sorted so that each node follows its inputs; `result` refers to f in sr⁻¹, a vector or a number."""

    nodes: tuple[Node, ...]
    result: str


def node_graph(program: Program) -> NodeGraph:
    """Return the graph of a program for one material with one or three channels."""
    assert program.layers == 0, "layers: a graph has no arrays of textures"
    builder = _Builder({"wi": _Value(3, whole="wi"), "wo": _Value(3, whole="wo")})
    for statement in program.statements:
        builder.named[statement.name] = builder.value(statement.expression)
    value = builder.value(program.result)
    result = builder.whole(value) if value.dimension == 3 else builder.part(value, 0)
    assert isinstance(result, str), "the result reads no texture"
    return NodeGraph(tuple(builder.nodes), result)


@dataclass
class _Value:
    """The result of an expression: one vector, its components, or both if both are needed."""

    dimension: int
    whole: Reference | None = None
    parts: tuple[Reference, ...] | None = None


class _Builder:
    def __init__(self, named: Mapping[str, _Value]) -> None:
        self.named = dict(named)
        self.nodes: list[Node] = []
        self._made: dict[Node, str] = {}

    def node(self, *node: Any) -> str:
        """Return the reference of a node, made where there is none like it."""
        if node not in self._made:
            self._made[node] = f"n{len(self.nodes)}"
            self.nodes.append(node)
        return self._made[node]

    def part(self, value: _Value, k: int) -> Reference:
        """Component k; of a number the number, whatever k."""
        if value.parts is None:
            name = self.node("separate", value.whole)
            value.parts = tuple(f"{name}.{letter}" for letter in "xyz")
        return value.parts[k if value.dimension > 1 else 0]

    def whole(self, value: _Value) -> Reference:
        """Return a vector of three (or a number) as one reference."""
        if value.dimension == 1:
            return self.part(value, 0)
        if value.whole is None:
            assert value.parts is not None, "a value has one form or the other"
            parts = (*value.parts, 0.0)[:3]
            constant = all(isinstance(part, float) for part in parts)
            value.whole = parts if constant else self.node("combine", *parts)  # type: ignore[assignment]
        return value.whole  # type: ignore[return-value]

    def value(self, expression: Expression) -> _Value:
        """Return what the expression becomes, its nodes made."""
        kind, operands, dimension = expression.kind, expression.operands, expression.dimension
        if kind == "constant":
            return _Value(dimension, parts=tuple(_single(value) for value in expression.values))
        if kind == "name":
            return self.named[expression.text]
        if kind == "swizzle":
            inner = self.value(operands[0])
            return _Value(dimension, parts=tuple(self.part(inner, "xyzw".index(letter)) for letter in expression.text))
        given = [self.value(operand) for operand in operands]
        if kind == "vector":
            return _Value(
                dimension, parts=tuple(self.part(value, k) for value in given for k in range(value.dimension))
            )
        if kind == "fetch":
            place = _Value(3, parts=(self.part(given[0], 0), self.part(given[0], 1), 0.0))
            colour = _Value(3, whole=self.node("texture", int(expression.text), self.whole(place)))
            return colour if dimension == 3 else _Value(1, parts=(self.part(colour, 0),))
        if kind == "dot":
            return _Value(1, parts=(self._dot(*given),))
        if dimension == 3 and kind in _VECTOR:
            return _Value(3, whole=self.node("vector", _VECTOR[kind], *map(self.whole, given)))
        parts = (self._number(kind, [self.part(value, k) for value in given]) for k in range(dimension))
        return _Value(dimension, parts=tuple(parts))

    def _dot(self, left: _Value, right: _Value) -> Reference:
        if left.dimension == 2:
            products = [self._number("*", [self.part(left, k), self.part(right, k)]) for k in range(2)]
            return self._number("+", products)
        # Of a vector of four, three in one node and the last behind.
        first, second = (value if value.dimension == 3 else self._first_three(value) for value in (left, right))
        dot = self.node("vector", "DOT_PRODUCT", self.whole(first), self.whole(second))
        if left.dimension == 3:
            return dot
        return self._number("+", [dot, self._number("*", [self.part(left, 3), self.part(right, 3)])])

    def _first_three(self, value: _Value) -> _Value:
        return _Value(3, parts=tuple(self.part(value, k) for k in range(3)))

    def _number(self, kind: str, given: Sequence[Reference]) -> Reference:
        """A function of numbers; what is known already is no node."""
        if kind == "*" and 1.0 in given:
            return given[1 - list(given).index(1.0)]
        if kind in INFIX and kind != "/" and all(isinstance(number, float) for number in given):
            a, b = (float(number) for number in given)  # type: ignore[arg-type]
            return {"+": a + b, "-": a - b, "*": a * b}[kind]
        if kind == "log":
            return self.node("math", "LOGARITHM", given[0], e)
        if kind == "asinh":
            # Of y >= 0 as of y < 0 but for cancellation, which the axes that are stretched never meet: they are radii.
            square = self.node("math", "MULTIPLY", given[0], given[0])
            root = self.node("math", "SQRT", self.node("math", "ADD", square, 1.0))
            return self.node("math", "LOGARITHM", self.node("math", "ADD", given[0], root), e)
        if kind == "step":
            # 1 at the edge itself, as in the shading languages.
            return self.node("math", "SUBTRACT", 1.0, self.node("math", "LESS_THAN", given[1], given[0]))
        return self.node("math", _MATH[kind], *given)


def _single(value: float) -> float:
    """The shortest number that is the same in single precision."""
    return float(number(value))
