"""The common interface of the fits of all methods: a reflectance that you can inspect, save, export and load.

A fit describes its evaluation as plain data (`factor.evaluation`).
"""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, Self

import numpy as np

from homofact.brdf.log_transform import LogTransform
from homofact.brdf.reflectance import Reflectance
from homofact.factor.evaluation import Evaluation
from homofact.linear.arrays import Held, as_arrays


@dataclass(frozen=True)
class QuantizationGrid:
    """The values of a quantized texture: low + k · step per channel (C,), k = 0 … `levels`."""

    low: Held
    step: Held
    levels: int

    def __post_init__(self) -> None:
        """Keep both as arrays."""
        as_arrays(self, "low", "step")


@dataclass(frozen=True)
class Texture:
    """One texture of a fit.

    `texels` (rows, columns, C) is float64. `mask` (rows, columns) is False for texels that no pair of directions reads.
    `name` is for file names ("texture_0"), and `caption` names the coordinates that index the texture, in mathematical
    notation, for people. `quantity` is "log" for the textures of a product and "factor" for those of a sum of products.
    `grid` and `deviation` are as in `Term`. `components` names the channels of the texels if they differ from those of
    the fit, as with a spectral basis.
    """

    name: str
    caption: str
    quantity: str
    texels: Held
    mask: Held
    grid: QuantizationGrid | None = None
    deviation: Held | None = None
    components: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Keep texels, mask and deviation as arrays."""
        as_arrays(self, "texels", "mask", "deviation")

    @property
    def size(self) -> tuple[int, int]:
        """(rows, columns)."""
        return int(self.texels.shape[0]), int(self.texels.shape[1])


class Fitted(Reflectance, Protocol):
    """A `Reflectance` made by a fit.

    It is a product of textures (`Factorization`, or `SpectralFit` of many bands) or a sum of products (`Separable`).
    """

    @property
    def terms(self) -> Sequence[Any]:
        """The terms; reports call their number the number of textures."""
        ...

    @property
    def transform(self) -> LogTransform:
        """The ε and A of the fit's log transform, which the Cole error uses."""
        ...

    @property
    def provenance(self) -> dict[str, Any]:
        """The record of how the fit was made (method, seed, settings, version), JSON-able."""
        ...

    @property
    def textures(self) -> tuple[Texture, ...]:
        """All textures, in the order of the texture numbers in lookups."""
        ...

    @property
    def evaluation(self) -> Evaluation | None:
        """The evaluation of the textures; None for a model without textures, which `evaluation_of` rejects."""
        ...

    def with_textures(
        self,
        texels: Sequence[Any],
        grids: Sequence[QuantizationGrid | None] | None = None,
        facts: Mapping[str, Any] | None = None,
    ) -> Self:
        """Return the fit with other texels of the same sizes and optional `grids`; adds `facts` to the provenance."""
        ...

    def describe(self) -> dict[str, Any]:
        """Return the kind and terms of the fit for a manifest, JSON-able, without texels and transform."""
        ...

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write one .npz file that loads bit-identically. Raises BadInput if the file cannot be written."""
        ...


def bits(mask: np.ndarray) -> list[str]:
    """Return a mask (rows, columns) as one string a row, 1 where it is True."""
    return ["".join("1" if texel else "0" for texel in row) for row in mask.tolist()]
