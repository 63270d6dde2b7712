"""Few spectral basis vectors for the logarithms of many bands. No torch is loaded here; `spectral_choice` makes them.

A product's logarithms f̃ (W bands) are a linear function of its texels, band by band, and all bands have the same
projections. So where f̃ ≈ Σk sk bk + b0 for a few vectors bk over the bands, the textures of the numbers sk have R
channels instead of W, and they are the textures of all bands times one matrix: nothing is fitted again.
"""

from dataclasses import dataclass

import numpy as np

from homofact.linear.arrays import Held, as_arrays


@dataclass(frozen=True)
class SpectralBasis:
    """R vectors over W bands: f̃ = s · `vectors` + `offset` of coordinates s (..., R).

    `vectors` (R, W) and `offset` (W,) evaluate; `dual` (W, R) gives the coordinates of f̃: f̃ · `dual`, up to a
    constant that the offset makes good.
    """

    vectors: Held
    offset: Held
    dual: Held

    def __post_init__(self) -> None:
        """Keep all three as arrays."""
        as_arrays(self, "vectors", "offset", "dual")

    @property
    def rank(self) -> int:
        """R."""
        return len(self.vectors)

    @property
    def nbytes(self) -> int:
        """Bytes of what an evaluation reads, as float32."""
        return 4 * (self.vectors.size + self.offset.size)

    def first(self, rank: int, mean: np.ndarray) -> "SpectralBasis":
        """Return the basis of the first `rank` vectors; what the others add at `mean` (W,) joins the offset."""
        vectors, dual = self.vectors[:rank], self.dual[:, :rank]
        return SpectralBasis(vectors, mean - mean @ dual @ vectors, dual)

    def coordinates(self, logs: np.ndarray) -> np.ndarray:
        """Return coordinates (..., R) of logarithms (..., W)."""
        return logs @ self.dual

    def logs(self, coordinates: np.ndarray) -> np.ndarray:
        """Logarithms (..., W) of coordinates (..., R)."""
        return coordinates @ self.vectors + self.offset
