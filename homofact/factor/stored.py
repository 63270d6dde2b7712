"""A saved product of textures read back into arrays, every entry checked. No torch is loaded here.

`Factorization.load` makes its tensors of it, `homofact.runtime` evaluates it as it is.
"""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from homofact.errors import BadInput
from homofact.factor.evaluation import Evaluation, Exponential, Indexed, evaluation_of_product
from homofact.factor.rows import axes_of_rows, check_rows, lookup_matrices
from homofact.files.fields import Fields
from homofact.files.saved import SavedFit
from homofact.geometry.coordinates import COORDINATES, CoordinateSystem, check_half_axes
from homofact.linear.names import CLAMPED, Axes, Axis

FORMAT = "homofact factorization"
FORMAT_VERSION = 1
# What a saved fit may hold at most: more is no fit's.
MOST_CHANNELS, MOST_TERMS, MOST_LEVELS = 4096, 1000, 65535
LEAST_MEAN, LEAST_WARP = 1e-30, 1e-9


@dataclass(frozen=True)
class StoredTerm:
    """One texture and what indexes it, as `factorization.Term` and `Projection` have them, in arrays.

    `quaternions` (1 or 2, 4) are those of a searched projection, `warp` a width; `grid` (2, C) holds the low end and
    the step of each channel's `levels`.
    """

    coordinates: str
    matrix: np.ndarray
    reciprocal: bool
    name: str
    texture: np.ndarray
    mask: np.ndarray
    quaternions: np.ndarray | None = None
    warp: float | None = None
    deviation: np.ndarray | None = None
    grid: np.ndarray | None = None
    levels: int = 0

    @property
    def system(self) -> CoordinateSystem:
        """The coordinates that the matrix acts on."""
        return COORDINATES[self.coordinates]

    @property
    def flat(self) -> np.ndarray:
        """The texels as a clamping sampler reads them: `factorization.Term.flat`."""
        texels = self.texture
        for dimension, axis in enumerate(axes_of_rows(self.matrix, self.system)):
            if axis is Axis.PERIODIC:
                texels = np.concatenate((texels, texels.take([0], dimension)), dimension)
        return texels

    @property
    def indexed(self) -> Indexed:
        """What an evaluation needs beside the texels."""
        matrices = lookup_matrices(self.matrix, self.system, self.reciprocal, self.quaternions is not None)
        rows, columns = self.flat.shape[:2]
        return Indexed(self.name, self.system, matrices, self.warp, (rows, columns))


def channels_and_transform(saved: SavedFit) -> tuple[tuple[str, ...], Exponential]:
    """The channels of a saved fit, and the ε and A (C,) of its logarithms. Raises BadInput for what cannot be meant."""
    channels = tuple(saved.fields.texts("channels", MOST_CHANNELS))
    mean = saved.floats("mean", (len(channels),), least=LEAST_MEAN)
    return channels, Exponential(saved.fields.number("epsilon", above=0), mean)


@dataclass(frozen=True)
class StoredProduct:
    """A saved factorization: its terms, ε and A (C,), channels and provenance."""

    terms: tuple[StoredTerm, ...]
    transform: Exponential
    channels: tuple[str, ...]
    provenance: dict[str, Any]

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> "StoredProduct":
        """Read what `save` wrote. Raises BadInput for a file that is none, is damaged, or is from a newer version."""
        saved = SavedFit.read(path, FORMAT, FORMAT_VERSION)
        fields = saved.fields
        channels, transform = channels_and_transform(saved)
        described = enumerate(fields.inners("terms", MOST_TERMS))
        terms = tuple(stored_term(entry, saved, j, len(channels)) for j, entry in described)
        return cls(terms, transform, channels, fields.inner("provenance").found)

    @property
    def texels(self) -> tuple[np.ndarray, ...]:
        """The textures (rows, columns, C) of logarithms, flat, in the order in which lookups number them."""
        return tuple(term.flat for term in self.terms)

    @property
    def evaluation(self) -> Evaluation:
        """How values come from the textures."""
        return evaluation_of_product([term.indexed for term in self.terms], self.transform)


def stored_term(fields: Fields, saved: SavedFit, j: int, channels: int) -> StoredTerm:
    """Term number `j`. Raises BadInput for what no fit could have saved."""
    name = fields.text("coordinates", COORDINATES)
    system = COORDINATES[name]
    quaternions, warp, grid, deviation, levels = None, None, None, None, 0
    if f"rotation_{j}" in saved:
        shape = (2, 4) if system.dimension == 4 else (4,)
        quaternions = saved.floats(f"rotation_{j}", shape).reshape(-1, 4)
        if (np.abs(np.linalg.norm(quaternions, axis=1) - 1) > 1e-3).any():
            raise BadInput(f"{saved.path}: rotation_{j} has another length than 1, expected unit quaternions")
    if fields.found.get("warp") is not None:
        warp = fields.number("warp", above=LEAST_WARP)
    matrix = saved.floats(f"matrix_{j}", (2, system.dimension))
    reciprocal, called = fields.flag("reciprocal"), fields.text("name")
    try:
        check_rows(matrix, system)
        if warp is not None:
            check_half_axes(system.axes)
    except BadInput as error:
        raise BadInput(f"{saved.path}: term {j}: {error}") from error
    expected = names_of_axes(axes_of_rows(matrix, system))
    if fields.found.get("axes", names_of_axes(CLAMPED)) != expected:
        fields.refuse("axes", f"{expected}, which {called} has")
    texture = saved.floats(f"texture_{j}", (None, None, channels))
    rows, columns = texture.shape[:2]
    mask = saved.flags(f"mask_{j}", (rows, columns))
    if f"deviation_{j}" in saved:
        deviation = saved.floats(f"deviation_{j}", (rows, columns, channels), least=0)
    if f"grid_{j}" in saved:
        grid = saved.floats(f"grid_{j}", (2, channels))
        levels = fields.whole("levels", 1, MOST_LEVELS)
    return StoredTerm(name, matrix, reciprocal, called, texture, mask, quaternions, warp, deviation, grid, levels)


def names_of_axes(axes: Sequence[Axis] | Axes) -> list[str]:
    """The kinds of a texture's axes, along its rows and along its columns, by name."""
    return [axis.value for axis in axes]
