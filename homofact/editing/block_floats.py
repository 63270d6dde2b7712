"""Numbers in 16 bits: integers with one scale per row and one per column (block floating point).

value = code · row · column. Columns are first divided by their root mean squares, so that the numbers of a row have
similar size. The largest number of a row is then stored as 32767. A dark pixel keeps as many digits as a bright one,
and rounding is at most 1.5e-5 of the row's largest number. Products with vectors are summed from the codes as they are.
"""

from dataclasses import dataclass

import numpy as np

from homofact.linear.kernels import kernel
from homofact.linear.threads import in_parallel

LARGEST = 32767
_PIECE = 4096


@dataclass(frozen=True)
class BlockFloats:
    """`codes` (P, M, r) int16 times `rows` (P, M) and `columns` (r,), both float32."""

    codes: np.ndarray
    rows: np.ndarray
    columns: np.ndarray

    @classmethod
    def of(cls, values: np.ndarray) -> "BlockFloats":
        """From numbers (P, M, r)."""
        sizes = np.sqrt(np.einsum("pmr,pmr->r", values, values, dtype=np.float64) / max(values[..., 0].size, 1))
        columns = np.where(sizes > 0, sizes, 1.0).astype(np.float32)
        rows = np.abs(values / columns).max(2, initial=0.0).astype(np.float32) / LARGEST
        steps = np.where(rows > 0, rows, np.float32(1))[..., None] * columns
        return cls(np.rint(values / steps).astype(np.int16), rows, columns)

    @property
    def nbytes(self) -> int:
        """Bytes of codes and scales."""
        return self.codes.nbytes + self.rows.nbytes + self.columns.nbytes

    def values(self, some: np.ndarray | slice = slice(None)) -> np.ndarray:
        """Return the numbers (P, M, r) of all rows or of some, float32."""
        return self.codes[some] * self.rows[some][..., None] * self.columns

    def times(self, vectors: np.ndarray) -> np.ndarray:
        """Sums (P, C) float32 over the columns: number [p, c] times vector c of (C, r), or [p, 0] where M is 1."""
        weights = np.ascontiguousarray(vectors, np.float32) * self.columns
        found = np.empty((len(self.codes), len(weights)), np.float32)
        starts = range(0, len(self.codes), _PIECE)

        def piece(start: int) -> None:
            own = slice(start, start + _PIECE)
            _times(self.codes[own], self.rows[own], weights, found[own])

        in_parallel(piece, starts)
        return found


@kernel(nogil=True, fastmath=True)
def _times(codes: np.ndarray, rows: np.ndarray, weights: np.ndarray, found: np.ndarray) -> None:  # pragma: no cover
    """Compute `BlockFloats.times`; `weights` (C, r) include the scales of the columns."""
    shared = codes.shape[1] == 1
    for p in range(len(codes)):
        for c in range(len(weights)):
            m = 0 if shared else c
            total = np.float32(0)
            for r in range(codes.shape[2]):
                total += np.float32(codes[p, m, r]) * weights[c, r]
            found[p, c] = total * rows[p, m]
