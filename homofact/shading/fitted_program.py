"""The textures and the program of a fit of either kind, in the order in which fetches number them."""

from collections.abc import Sequence

from torch import Tensor

from homofact.errors import BadInput
from homofact.factor.factorization import Factorization
from homofact.factor.fitted import Fitted
from homofact.separable.separable import Separable
from homofact.shading.encoding import Encoded
from homofact.shading.program import Program, program_of
from homofact.shading.separable_program import separable_program


def textures_of(fitted: Fitted) -> list[Tensor]:
    """The textures (rows, columns, C) of a fit, flat (`Term.flat`).

    Raises BadInput for one that is neither a product nor a sum.
    """
    if isinstance(fitted, Factorization):
        return [term.flat().texture for term in fitted.terms]
    if isinstance(fitted, Separable):
        return [texture for term in fitted.terms for texture in term.textures]
    raise BadInput(f"shading: found a {type(fitted).__name__}, expected a factorization or a separable one")


def fitted_program(fitted: Fitted, textures: Sequence[Encoded]) -> Program:
    """The program that reads `textures`, stored as they are. Raises BadInput as `textures_of` and `program_of`."""
    if isinstance(fitted, Separable):
        return separable_program(fitted, textures)
    if isinstance(fitted, Factorization):
        return program_of(fitted, textures)
    raise BadInput(f"shading: found a {type(fitted).__name__}, expected a factorization or a separable one")
