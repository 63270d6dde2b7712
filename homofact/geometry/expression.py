"""Expressions: the formulas of an evaluation, independent of the language in which they are printed or run.

The coordinates (`axes`) and the shading programs are made of them. An `Expression` is a tree over scalars and vectors
of up to four components, built with Python's operators. A program is a list of `Let` statements, each naming one
expression, and a result. `interpret` evaluates them on arrays, and the modules of the languages print them. C has no
vectors, so its printer uses `component`. The cost model counts the nodes.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

INFIX = ("+", "-", "*", "/")
# Functions of one or two arguments; those that work on vectors work component by component, dot excepted.
FUNCTIONS = (
    "sqrt", "abs", "exp", "log", "asinh", "cos", "sin", "atan2", "floor", "fract", "dot", "max", "min", "step",
)  # fmt: skip
_AXES = "xyzw"
# By name, the rows of tables of constants: one for each layer.
Tables = tuple[tuple[str, tuple[tuple[float, ...], ...]], ...]


@dataclass(frozen=True)
class Expression:
    """A node: `kind` is "constant", "name", "swizzle", "vector", "fetch", "cube", "table", an operator or a function.

    `dimension` is 1 for a scalar, else the number of components. `values` are the numbers of a constant. `text` is a
    name, the letters of a swizzle, or the number of a texture. A fetch reads its texture at its one operand; a cube has
    two operands, the direction and the level. For a table, `text` is its name, and it is read at the current layer. If
    a table was split into components, `values[0]` is the component.
    """

    kind: str
    dimension: int
    operands: tuple["Expression", ...] = ()
    values: tuple[float, ...] = ()
    text: str = ""

    def __add__(self, other: "Expression | float") -> "Expression":
        """The sum, component by component; a scalar counts for each."""
        return _infix("+", self, _expression(other))

    def __radd__(self, other: float) -> "Expression":
        """The sum with a number on the left."""
        return _infix("+", _expression(other), self)

    def __rsub__(self, other: float) -> "Expression":
        """The difference with a number on the left."""
        return _infix("-", _expression(other), self)

    def __sub__(self, other: "Expression | float") -> "Expression":
        """The difference."""
        return _infix("-", self, _expression(other))

    def __mul__(self, other: "Expression | float") -> "Expression":
        """The product, component by component."""
        return _infix("*", self, _expression(other))

    def __rmul__(self, other: float) -> "Expression":
        """The product with a number on the left."""
        return _infix("*", _expression(other), self)

    def __rtruediv__(self, other: float) -> "Expression":
        """The quotient with a number on the left."""
        return _infix("/", _expression(other), self)

    def __truediv__(self, other: "Expression | float") -> "Expression":
        """The quotient."""
        return _infix("/", self, _expression(other))

    def __getattr__(self, letters: str) -> "Expression":
        """Components by letter: v.x, v.xy, v.rgb is not among them."""
        if not letters or set(letters) - set(_AXES[: self.dimension]):
            raise AttributeError(letters)
        return Expression("swizzle", len(letters), (self,), text=letters)


@dataclass(frozen=True)
class Let:
    """One statement: the expression gets a name; `comment` is printed above it where there is one."""

    name: str
    expression: Expression
    comment: str = ""


def constant(*values: float) -> Expression:
    """Return a scalar, or the vector of several values."""
    return Expression("constant", len(values), values=tuple(float(value) for value in values))


def variable(name: str, dimension: int) -> Expression:
    """Return the value of a parameter or an earlier statement called `name`."""
    return Expression("name", dimension, text=name)


def vector(*parts: Expression) -> Expression:
    """Return the vector of scalars and shorter vectors, in order; a single one is returned unchanged."""
    if len(parts) == 1:
        return parts[0]
    return Expression("vector", sum(part.dimension for part in parts), parts)


def call(name: str, *arguments: Expression | float) -> Expression:
    """Return a function of `FUNCTIONS`; dot gives a scalar."""
    parts = tuple(_expression(argument) for argument in arguments)
    return Expression(name, 1 if name == "dot" else max(part.dimension for part in parts), parts)


def fetch(texture: int, uv: Expression, channels: int) -> Expression:
    """Return the texture's value at uv in [0, 1]² (or [0, 1]³, for one in three dimensions), linear and clamped."""
    return Expression("fetch", channels, (uv,), text=str(texture))


def cube(texture: int, direction: Expression, level: Expression, channels: int) -> Expression:
    """Return the cube map's value in a direction (3,) of any length above 0, linear also between its levels."""
    return Expression("cube", channels, (direction, level), text=str(texture))


def table(name: str, dimension: int) -> Expression:
    """Return the row of a program's table that belongs to the layer."""
    return Expression("table", dimension, text=name)


def _expression(value: Expression | float) -> Expression:
    return value if isinstance(value, Expression) else constant(value)


def _infix(operator: str, left: Expression, right: Expression) -> Expression:
    return Expression(operator, max(left.dimension, right.dimension), (left, right))


def component(expression: Expression, k: int) -> Expression:
    """Return the scalar expression of component k: names become swizzles, everything else is split.

    A fetch or cube cannot be split: its statement is printed as a whole.
    """
    kind, operands = expression.kind, expression.operands
    if expression.dimension == 1 and kind != "dot":
        k = 0
    if kind == "constant":
        return constant(expression.values[k])
    if kind == "name":
        return expression if expression.dimension == 1 else Expression("swizzle", 1, (expression,), text=_AXES[k])
    if kind == "table":
        return Expression("table", 1, values=(float(k),), text=expression.text)
    if kind == "swizzle":
        return component(operands[0], _AXES.index(expression.text[k]))
    if kind == "vector":
        for part in operands:
            if k < part.dimension:
                return component(part, k)
            k -= part.dimension
    if kind == "dot":
        left, right = operands
        products = [component(left, i) * component(right, i) for i in range(left.dimension)]
        return _sum(products)
    return Expression(kind, 1, tuple(component(operand, k) for operand in operands))


def _sum(parts: Sequence[Expression]) -> Expression:
    total = parts[0]
    for part in parts[1:]:
        total = total + part
    return total


def nodes(expression: Expression) -> Iterator[Expression]:
    """Yield every node of the tree, the root first."""
    yield expression
    for operand in expression.operands:
        yield from nodes(operand)


def needed(statements: Sequence[Let], result: Expression) -> tuple[Let, ...]:
    """Return only the statements that the result depends on, in their order."""
    wanted = {node.text for node in nodes(result) if node.kind == "name"}
    kept = []
    for statement in reversed(statements):
        if statement.name in wanted:
            kept.append(statement)
            wanted |= {node.text for node in nodes(statement.expression) if node.kind == "name"}
    return tuple(reversed(kept))


def substituted(expression: Expression, values: Mapping[str, tuple[float, ...] | Expression]) -> Expression:
    """Replace names by constants or expressions; a component of a constant becomes a constant."""
    if expression.kind == "name" and expression.text in values:
        value = values[expression.text]
        return value if isinstance(value, Expression) else constant(*value)
    operands = tuple(substituted(operand, values) for operand in expression.operands)
    if expression.kind == "swizzle" and operands[0].kind == "constant":
        return constant(*(operands[0].values[_AXES.index(letter)] for letter in expression.text))
    return replace(expression, operands=operands)
