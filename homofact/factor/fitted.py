"""What every fit ends in, whatever its method: a reflectance whose parts can be looked at, stored, exported, read back.

A fit says as plain data how it is evaluated (`factor.evaluation`).
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
    """The values that a texture of whole numbers can hold: low + k · step per channel (C,), k = 0 … `levels`."""

    low: Held
    step: Held
    levels: int

    def __post_init__(self) -> None:
        """Keep both as arrays."""
        as_arrays(self, "low", "step")


@dataclass(frozen=True)
class Texture:
    """One texture of a fit.

    `texels` (rows, columns, C) float64; `mask` (rows, columns) is False where no pair of directions reads. `name` is
    for its files ("texture_0"), `caption` for people: what it is indexed by, in the field's letters. `quantity` says
    what the texels are: "log" of a product's, "factor" of a sum's. `grid` and `deviation` as in `Term`. `components`
    name the channels of the texels where they are not the fit's own, as those of a spectral basis.
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
        """The terms; how many there are is what reports call the number of textures."""
        ...

    @property
    def transform(self) -> LogTransform:
        """The fit's ε and A, by which its error in log space is measured."""
        ...

    @property
    def provenance(self) -> dict[str, Any]:
        """What it was made from and by (method, seed, settings, version), JSON-able."""
        ...

    @property
    def textures(self) -> tuple[Texture, ...]:
        """All its textures, in the order in which lookups number them."""
        ...

    @property
    def evaluation(self) -> Evaluation | None:
        """How values come from the textures; None for a model without (`evaluation.evaluation_of` refuses it)."""
        ...

    def with_textures(
        self,
        texels: Sequence[Any],
        grids: Sequence[QuantizationGrid | None] | None = None,
        facts: Mapping[str, Any] | None = None,
    ) -> Self:
        """The same fit with other texels of the same sizes, on `grids` where given; `facts` join the provenance."""
        ...

    def describe(self) -> dict[str, Any]:
        """Return what a manifest says of it beside texels and transform, JSON-able: its kind and its terms."""
        ...

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the one .npz file that reads back bit-identical. Raises BadInput for an unwritable place."""
        ...


def bits(mask: np.ndarray) -> list[str]:
    """Return a mask (rows, columns) as one string a row, 1 where it is True."""
    return ["".join("1" if texel else "0" for texel in row) for row in mask.tolist()]
