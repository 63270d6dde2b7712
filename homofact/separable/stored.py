"""A saved sum of products read back into arrays, every entry checked, and its evaluation. No torch is loaded here.

`Separable.load` makes its tensors of it, `homofact.runtime` evaluates it as it is.
"""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from homofact.errors import BadInput
from homofact.factor.evaluation import Evaluation, Exponential, Lookup, Product
from homofact.factor.stored import MOST_LEVELS, MOST_TERMS, channels_and_transform
from homofact.files.saved import SavedFit
from homofact.geometry.axes import map_axes
from homofact.linear.names import Shape
from homofact.separable.names import MAP_NAMES, MAP_SCALES, SIDES

FORMAT = "homofact separable factorization"
FORMAT_VERSION = 1
# Letters of the two sides' axes.
LETTERS = {"in-out": ("i", "o"), "half-diff": ("h", "d")}


@dataclass(frozen=True)
class StoredPair:
    """One product, as `separable.SeparableTerm` has it, in arrays; `grids` (1 or 2, 2, C) are low ends and steps."""

    first: np.ndarray
    second: np.ndarray | None
    signs: np.ndarray
    grids: np.ndarray | None = None

    @property
    def textures(self) -> tuple[np.ndarray, ...]:
        """The one or two textures that are stored."""
        return (self.first,) if self.second is None else (self.first, self.second)


@dataclass(frozen=True)
class StoredSum:
    """A saved sum of products, as `Separable` has it; ε and A (C,) are those by which its error is measured."""

    terms: tuple[StoredPair, ...]
    map: str
    parameterization: str
    read: np.ndarray
    transform: Exponential
    levels: int
    channels: tuple[str, ...]
    provenance: dict[str, Any]

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> "StoredSum":
        """Read what `save` wrote. Raises BadInput for a file that is none, is damaged, or is from a newer version."""
        saved = SavedFit.read(path, FORMAT, FORMAT_VERSION)
        fields = saved.fields
        channels, transform = channels_and_transform(saved)
        read = saved.flags("read", (None, None))
        shared = "second_0" not in saved
        shape = (*read.shape, len(channels))
        terms = tuple(_restore(saved, k, shape, shared) for k in range(fields.whole("terms", 1, MOST_TERMS)))
        name, kind = fields.text("map", MAP_NAMES), fields.text("parameterization", SIDES)
        whole = any(term.grids is not None for term in terms)
        levels = fields.whole("levels", 1, MOST_LEVELS) if whole else 0
        return cls(terms, name, kind, read, transform, levels, channels, fields.inner("provenance").found)

    @property
    def texels(self) -> tuple[np.ndarray, ...]:
        """The textures (rows, columns, C), in the order in which lookups number them."""
        return tuple(texture for term in self.terms for texture in term.textures)

    @property
    def evaluation(self) -> Evaluation:
        """How values come from the textures."""
        rows, columns = self.read.shape
        signs = [(tuple(term.signs.tolist()), len(term.textures)) for term in self.terms]
        return evaluation_of_sum(self.map, self.parameterization, signs, (rows, columns))


def evaluation_of_sum(
    name: str, parameterization: str, terms: Sequence[tuple[tuple[float, ...], int]], shape: Shape
) -> Evaluation:
    """max(0, Σ signs · first lookup · second lookup) on the map `name`; `terms` are (signs, stored textures)."""
    rows, columns = shape
    lookups, products, texture = [], [], 0
    for signs, stored in terms:
        for j, letter in enumerate(LETTERS[parameterization]):
            what = letter if letter in "hd" else f"w{letter}"
            words = f"{what} on the {name} map, {columns} x {rows} texels"
            number = texture + (j if stored == 2 else 0)
            lookups.append(Lookup(number, map_axes(name, letter), MAP_SCALES[name], np.eye(2), None, words))
        texture += stored
        products.append(Product((len(lookups) - 2, len(lookups) - 1), signs))
    return Evaluation(tuple(lookups), tuple(products), None)


def _restore(saved: SavedFit, k: int, shape: tuple[int, ...], shared: bool) -> StoredPair:
    """Term number `k`. Raises BadInput for what no fit could have saved."""
    if shared and f"second_{k}" in saved:
        raise BadInput(f"{saved.path}: holds second_{k} and no second_0, expected as many textures in every term")
    signs = saved.floats(f"signs_{k}", shape[2:])
    if not (np.abs(signs) == 1).all():
        raise BadInput(f"{saved.path}: signs_{k} holds other numbers, expected 1 or -1 a channel")
    factors = [saved.floats(f"{name}_{k}", shape) for name in (("first",) if shared else ("first", "second"))]
    grids = None
    if f"grids_{k}" in saved:
        grids = saved.floats(f"grids_{k}", (len(factors), 2, shape[2]))
    return StoredPair(factors[0], None if shared else factors[1], signs, grids)
