"""Count the operations of one evaluation of a program from its expressions, as in section 3.3 of the thesis.

An operation is one operator or built-in function of the shading language, on a scalar or a vector. This is how the
thesis counts (dot products, sums, normalisations), for the GPU instructions of its time. `scalar` counts every
component separately, as current hardware executes them; a dot product of three components counts as five. Neither count
includes the transformation of ωi and ωo into the surface frame (six dot products), which the renderer does. Neither
includes fetches, constructors and swizzles, which only select registers.
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
    """Counts of one evaluation: operations by name, scalar operations, fetches, bytes of all textures."""

    operations: dict[str, int]
    scalar: int
    fetches: int
    nbytes: int

    @property
    def total(self) -> int:
        """The number of operations, with each operator or built-in counted once per use."""
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
    """Return the counts of a program whose textures have `nbytes` bytes."""
    operations, scalar, fetches = operations_of(program.statements, program.result)
    return EvaluationCost(operations, scalar, fetches, nbytes)


def operations_of(statements: Sequence[Let], result: Expression) -> tuple[dict[str, int], int, int]:
    """Return (operations by name, number of scalar operations, number of fetches) of statements and a result."""
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
