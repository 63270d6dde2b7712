"""The non-parametric factor model of Bagher, Snyder and Nowrouzezahrai (2016): one-dimensional tables and a constant.

π f = d + s D(θh) F(θd) G(θi) G(θo)/(cosθi cosθo)

Each channel has its own constants d and s and its own tables. D has `BINS` bins of equal width in √θh; F and G have as
many of equal width in θ. A table gives the values at the centres of the bins. Values are interpolated linearly between
centres, and are constant beyond the outermost ones.
"""

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from homofact.brdf.analytic.common import AnalyticModel, grazing
from homofact.errors import BadInput
from homofact.geometry.coordinates import axes_of
from homofact.geometry.namespace import like, namespace, whole

if TYPE_CHECKING:
    from torch import Tensor

BINS = 90
_AXES = ("theta_h", "theta_d", "theta_i", "theta_o")


@dataclass(frozen=True)
class FactoredBrdf(AnalyticModel):
    """The model of the module docstring: the rows of `table` (2 + 3 BINS, C) are d, s, D, G and F.

    Raises BadInput for other shapes and numbers that are not finite.
    """

    table: "Tensor | np.ndarray"

    def __post_init__(self) -> None:
        """Refuse other shapes and numbers that are not finite."""
        expected = (2 + 3 * BINS, len(self.channels))
        if tuple(self.table.shape) != expected or not bool(namespace(self.table).isfinite(self.table).all()):
            raise BadInput(
                where="table", found=f"the shape {tuple(self.table.shape)}", expected=f"{expected} of finite numbers"
            )

    @property
    def nbytes(self) -> int:
        """Return the bytes of 272 float32 numbers per channel."""
        return 4 * int(np.prod(self.table.shape))

    @property
    def fetches(self) -> int:
        """Four tables are looked up."""
        return 4

    def formula(self, wi: "Tensor", wo: "Tensor") -> "Tensor":
        """Return the model's values at the angles of the pairs, with negative values set to 0."""
        parts = _parts(like(self.table, wi))
        low, share = bins_of(wi, wo)
        values = factored_values(parts, low, share)
        cosines = grazing(wi[:, 2]) * grazing(wo[:, 2])
        return namespace(wi).clip((parts[0] + parts[1] * values / cosines[:, None]) / math.pi, 0, None)


def bins_of(wi: "Tensor", wo: "Tensor") -> "tuple[Tensor, Tensor]":
    """Return (the lower bin, the weight of the upper bin), (N, 4) each, for θh, θd, θi and θo."""
    angles = axes_of(_AXES, wi, wo) / (math.pi / 2)
    library = namespace(wi)
    theta_h, *others = (angles[:, k] for k in range(len(_AXES)))
    angles = library.stack((library.sqrt(library.clip(theta_h, 0, None)), *others), -1)
    place = library.clip(angles * BINS - 0.5, 0, BINS - 1)
    low = whole(library.clip(library.floor(place), None, BINS - 2))
    return low, place - low


def _parts(table: Any) -> Any:
    """d, s, D, G and F of a table."""
    ends = (0, 1, 2, 2 + BINS, 2 + 2 * BINS, 2 + 3 * BINS)
    return tuple(table[begin:end] for begin, end in pairwise(ends))


def factored_values(parts: "tuple[Tensor, ...]", low: "Tensor", share: "Tensor") -> "Tensor":
    """Return D F G G (N, C) from the parts d, s, D, G and F of a table, at bins from `bins_of`."""
    tables = (parts[2], parts[4], parts[3], parts[3])
    product = None
    for k, table in enumerate(tables):
        s = share[:, k : k + 1]
        value = (1 - s) * table[low[:, k]] + s * table[low[:, k] + 1]
        product = value if product is None else product * value
    assert product is not None
    return product
