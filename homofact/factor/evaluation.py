"""Describe the evaluation of a fit as plain data: which textures are read where, and how the values are combined.

Shaders, compiled code, renderers and `homofact.runtime` use this description (`shading.program`), so they do not depend
on the kind of fit. This module does not import torch.
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

    x (k,) are the coordinates named in `axes` (`geometry.axes`). Each is factor · raw + offset with the numbers of
    `scales`, then stretched by a warp of width `warp` if there is one. `words` describes the lookup, for comments in
    shaders.
    """

    texture: int
    axes: tuple[str, ...]
    scales: Scales
    matrix: np.ndarray
    warp: float | None
    words: str


@dataclass(frozen=True)
class Product:
    """The product of the values of some `lookups` (indices), times `signs`, ±1 per channel."""

    lookups: tuple[int, ...]
    signs: tuple[float, ...]


@dataclass(frozen=True)
class Evaluation:
    """f as plain data: with s the sum of the products, max(0, s), or A max(0, exp(s) − ε) with a `transform`.

    The value is 0 if a direction is below the horizon.
    """

    lookups: tuple[TextureLookup, ...]
    products: tuple[Product, ...]
    transform: LogTransform | None

    @property
    def isotropic(self) -> bool:
        """Whether no texture's coordinates change when both directions are turned about the normal."""
        return all(set(lookup.axes) <= _ISOTROPIC for lookup in self.lookups)

    def of_channels(self, own: slice) -> "Evaluation":
        """Return the evaluation restricted to some channels."""
        products = tuple(Product(each.lookups, each.signs[own]) for each in self.products)
        transform = self.transform and self.transform.of_channels(own)
        return Evaluation(self.lookups, products, transform)


class Evaluated(Protocol):
    """The interface of all objects that can have an evaluation, which every fit implements."""

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the C channels."""
        ...

    @property
    def provenance(self) -> Mapping[str, Any]:
        """The record of how the fit was made (method, settings, seed, source), JSON-able."""
        ...

    @property
    def evaluation(self) -> Evaluation | None:
        """The description of how to evaluate the textures; None for a model without textures."""
        ...


def evaluation_of(fitted: Evaluated) -> Evaluation:
    """Return the evaluation of a fit's textures. Raises BadInput for a model without textures."""
    if fitted.evaluation is None:
        refuse_model(fitted)
    return fitted.evaluation


def refuse_model(fitted: object) -> NoReturn:
    """Raise BadInput for a model without textures, in places that need textures."""
    raise BadInput("has no textures", where=repr(fitted), expected="a fit by search, cole, mccool, svd, nmf or ggx")


@dataclass(frozen=True)
class Indexed:
    """The lookups of one texture of a product: their matrices, conjugates included, and the size as in `Term.flat`."""

    name: str
    system: CoordinateSystem
    matrices: Sequence[np.ndarray]
    warp: float | None
    shape: Shape


def evaluation_of_product(textures: Sequence[Indexed], transform: LogTransform) -> Evaluation:
    """Return the evaluation A (exp Σ lookups − ε), in which a conjugate is a separate lookup."""
    lookups = []
    for k, each in enumerate(textures):
        (rows, columns), system = each.shape, each.system
        words = f"texture {k}: {each.name} on {system.name}, {columns} x {rows} texels"
        for matrix in each.matrices:
            lookups.append(TextureLookup(k, system.axes, system.scales, matrix, each.warp, words))
            words = "reciprocity: the directions swapped"
    ones = (1.0,) * len(transform.mean)
    return Evaluation(tuple(lookups), tuple(Product((k,), ones) for k in range(len(lookups))), transform)
