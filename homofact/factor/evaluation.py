"""How a fit is evaluated, as plain data: which textures are read at which places, and how the values combine.

Shaders, compiled code, renderers and `homofact.runtime` are made from that (`shading.program`) and need not know the
fit's kind. No torch is loaded here.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NoReturn, Protocol

import numpy as np

from homofact.brdf.log_transform import LogTransform
from homofact.errors import BadInput
from homofact.geometry.coordinates import CoordinateSystem, Scales
from homofact.linear.names import Shape

# The axes that do not change when both directions are turned about the normal.
_ISOTROPIC = {"theta_i", "theta_o", "theta_h", "theta_d", "phi_d", "delta_phi", "tilt"}


@dataclass(frozen=True)
class TextureLookup:
    """One fetch: texture number `texture` at (u, v) = `matrix` x in [−1, 1]², a (2, k) float64.

    x (k,) are the `axes` (`geometry.axes`), each factor · raw + offset of `scales`, stretched by a warp of the width
    `warp` if there is one. `words` describe this in a comment.
    """

    texture: int
    axes: tuple[str, ...]
    scales: Scales
    matrix: np.ndarray
    warp: float | None
    words: str


@dataclass(frozen=True)
class Product:
    """The product of the values of some `lookups`, by number, times `signs`, ±1 a channel."""

    lookups: tuple[int, ...]
    signs: tuple[float, ...]


@dataclass(frozen=True)
class Evaluation:
    """f as plain data: with s the sum of the products, max(0, s), or A max(0, exp(s) − ε) with a `transform`.

    Both are 0 where a direction is under the horizon.
    """

    lookups: tuple[TextureLookup, ...]
    products: tuple[Product, ...]
    transform: LogTransform | None

    @property
    def isotropic(self) -> bool:
        """Whether no texture's coordinates change when both directions are turned about the normal."""
        return all(set(lookup.axes) <= _ISOTROPIC for lookup in self.lookups)

    def of_channels(self, own: slice) -> "Evaluation":
        """Return the evaluation of some of the channels alone."""
        products = tuple(Product(each.lookups, each.signs[own]) for each in self.products)
        transform = self.transform and self.transform.of_channels(own)
        return Evaluation(self.lookups, products, transform)


class Evaluated(Protocol):
    """What may have an evaluation: every fit."""

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the C channels."""
        ...

    @property
    def provenance(self) -> Mapping[str, Any]:
        """What it was made from and by, JSON-able."""
        ...

    @property
    def evaluation(self) -> Evaluation | None:
        """How values come from its textures; None for a model without."""
        ...


def evaluation_of(fitted: Evaluated) -> Evaluation:
    """Return how values come from the textures of a fit. Raises BadInput for a model without textures."""
    if fitted.evaluation is None:
        refuse_model(fitted)
    return fitted.evaluation


def refuse_model(fitted: object) -> NoReturn:
    """Raise BadInput for a model without textures, where these are wanted."""
    raise BadInput("has no textures", where=repr(fitted), expected="a fit by search, cole, mccool, svd, nmf or ggx")


@dataclass(frozen=True)
class Indexed:
    """What indexes one texture of a product: the matrix of every lookup, conjugates included, and the flat size."""

    name: str
    system: CoordinateSystem
    matrices: Sequence[np.ndarray]
    warp: float | None
    shape: Shape


def evaluation_of_product(textures: Sequence[Indexed], transform: LogTransform) -> Evaluation:
    """Return a (exp Σ lookups − ε); a conjugate is a lookup of its own."""
    lookups = []
    for k, each in enumerate(textures):
        (rows, columns), system = each.shape, each.system
        words = f"texture {k}: {each.name} on {system.name}, {columns} x {rows} texels"
        for matrix in each.matrices:
            lookups.append(TextureLookup(k, system.axes, system.scales, matrix, each.warp, words))
            words = "reciprocity: the directions swapped"
    ones = (1.0,) * len(transform.mean)
    return Evaluation(tuple(lookups), tuple(Product((k,), ones) for k in range(len(lookups))), transform)
