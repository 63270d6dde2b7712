"""A spectral basis: a few vectors for the logarithms of many bands. This module does not import torch.

A product's logarithms f̃ (W bands) are a linear function of its texels, band by band, and all bands have the same
projections. So if f̃ ≈ Σk sk bk + b0 for R vectors bk over the bands, textures of the coordinates sk need R channels
instead of W. They are the textures of all bands times one matrix, so no new fit is needed. `spectral_choice` chooses
the vectors.
"""

from dataclasses import dataclass

import numpy as np

from homofact.linear.arrays import Held, as_arrays


@dataclass(frozen=True)
class SpectralBasis:
    """R vectors over W bands: f̃ = s · `vectors` + `offset` with coordinates s (..., R).

    `vectors` (R, W) and `offset` (W,) serve for evaluation. `dual` (W, R) gives the coordinates f̃ · `dual` of f̃, up
    to a constant for which the offset compensates.
    """

    vectors: Held
    offset: Held
    dual: Held

    def __post_init__(self) -> None:
        """Keep all three as arrays."""
        as_arrays(self, "vectors", "offset", "dual")

    @property
    def rank(self) -> int:
        """The number R of vectors."""
        return len(self.vectors)

    @property
    def nbytes(self) -> int:
        """Bytes of `vectors` and `offset`, as float32."""
        return 4 * (self.vectors.size + self.offset.size)

    def first(self, rank: int, mean: np.ndarray) -> "SpectralBasis":
        """Return the basis of the first `rank` vectors; adds the others at `mean` (W,) to the offset."""
        vectors, dual = self.vectors[:rank], self.dual[:, :rank]
        return SpectralBasis(vectors, mean - mean @ dual @ vectors, dual)

    def coordinates(self, logs: np.ndarray) -> np.ndarray:
        """Return coordinates (..., R) of logarithms (..., W)."""
        return logs @ self.dual

    def logs(self, coordinates: np.ndarray) -> np.ndarray:
        """Logarithms (..., W) of coordinates (..., R)."""
        return coordinates @ self.vectors + self.offset
