"""What one evaluation of a program costs, counted on its expressions, in the manner of section 3.3 of the thesis.

An operation is one operator or built-in function of the shading language, on a scalar or a vector alike: a GPU's
instruction set of the thesis's time, and what it counts (dot products, sums, normalisations). `scalar` counts every
component by itself (a dot product of three is five), as today's hardware issues them. Moving ωi and ωo into the
surface frame, six dot products, is the renderer's and counted in neither; nor are fetches, constructors and swizzles,
which select registers.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any

from homofact.geometry.expression import Expression, Let, nodes
from homofact.shading.program import Program

_FREE = {"constant", "name", "swizzle", "vector", "fetch", "cube", "table"}


@dataclass(frozen=True)
class EvaluationCost:
    """Counts of one evaluation: operations by name, their number, scalar ones, fetches; bytes of all textures."""

    operations: dict[str, int]
    scalar: int
    fetches: int
    nbytes: int

    @property
    def total(self) -> int:
        """Operations, each operator or built-in once."""
        return sum(self.operations.values())

    def record(self) -> dict[str, Any]:
        """Return the JSON form."""
        return {
            "operations": self.total,
            "scalar_operations": self.scalar,
            "by_name": dict(self.operations),
            "fetches": self.fetches,
            "bytes": self.nbytes,
        }


def cost_of(program: Program, nbytes: int) -> EvaluationCost:
    """Return the counts of a program whose textures take `nbytes`."""
    operations, scalar, fetches = operations_of(program.statements, program.result)
    return EvaluationCost(operations, scalar, fetches, nbytes)


def operations_of(statements: Sequence[Let], result: Expression) -> tuple[dict[str, int], int, int]:
    """Return (operations by name, on scalars, fetches) of statements and a result."""
    expressions = [*(statement.expression for statement in statements), result]
    operations: Counter[str] = Counter()
    fetches = scalar = 0
    for node in chain.from_iterable(map(nodes, expressions)):
        if node.kind in ("fetch", "cube"):
            fetches += 1
        elif node.kind not in _FREE:
            operations[node.kind] += 1
            scalar += 2 * node.operands[0].dimension - 1 if node.kind == "dot" else node.dimension
    return dict(sorted(operations.items())), scalar, fetches
