"""Compress the bands of each pixel to a few numbers by a reduced-rank regression over some of the pixels.

Rows are pixels. Columns are bands or pairs of bands, each scaled by its coefficient in the start curves (at least
`FLOOR` of the largest). A picture is then a row times the relative change of the curves, ρ = c c'/start. The first
numbers stored per pixel are s = row · Z, where Z is the ρ of the start curves. Pictures of the start curves, and of a
curve scaled by a constant, therefore have only rounding errors. In other edits, only the change itself is approximated.

The rest is row (1 − Z U), where U is the least-squares fit of the rows by s. Only its response to smooth changes
matters: rest · G, where G is a blur over `SMOOTH` of [0, π/2] plus a small share of the identity. The right singular
vectors V of rest · G come from one channel of some of the pixels. Every pixel stores a = [s, rest · G Vᵀ], and R = a ·
W ρ, where W reconstructs the rows of these pixels from their a by least squares.

The number of vectors is the smallest one whose pictures of trial edits are within `TOLERANCE` (relative RMS), at pixels
that were not used for the trial basis. Each trial edit changes one curve: it doubles the curve around one angle, or
raises it to the power ½.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from torch import Tensor

FLOOR, SMOOTH, ROUGH = 0.02, 4 / 256, 0.03
TOLERANCE = 3e-3
# What is tried, the fewest first, those of a line side by side.
RANKS = ((4, 8, 12, 16, 24, 32, 48, 64, 96, 128), (192, 256, 384, 512, 768))
# Places of [0, 1] about which trial edits double a curve, and how far about them; a pixel of so many is a trial's.
_PLACES, _WIDTH, _TRIED = (0.03, 0.15, 0.4, 0.75), 0.06, 8
# Starts of the channels that differ by less are one.
_ALIKE = 1e-4
_COLUMNS = 1024


@dataclass(frozen=True)
class Basis:
    """`inward` (J·K, r) maps a row to its a, and `outward`, W (r, J·K), maps a to the row, both float32.

    `scale` (C, J·K) has the factors of the columns. `reached` is the relative RMS error of the worst trial edit.
    """

    inward: np.ndarray
    outward: np.ndarray
    scale: np.ndarray
    reached: float

    @property
    def rank(self) -> int:
        """r."""
        return len(self.outward)

    def coefficients(self, block: np.ndarray) -> np.ndarray:
        """a (P, C, r) float32 of a block (P, C, J·K)."""
        rows = block.astype(np.float32)
        rows *= self.scale.astype(np.float32)
        return (rows.reshape(-1, rows.shape[2]) @ self.inward).reshape(*rows.shape[:2], -1)


def product_of(curves: Sequence[Tensor]) -> np.ndarray:
    """Return the coefficients (C, J·K), float64, of one curve (J, C) or of two."""
    value = curves[0].numpy().T.astype(np.float64)
    if len(curves) == 2:
        value = (value[:, :, None] * curves[1].numpy().T[:, None, :]).reshape(len(value), -1)
    return value


def scale_of(curves: Sequence[Tensor]) -> np.ndarray:
    """The scale (C, J·K) of columns: the starting coefficient, but no less than `FLOOR` of the channel's largest."""
    value = product_of(curves)
    return np.maximum(value, FLOOR * value.max(1, keepdims=True))


def blur(count: int) -> np.ndarray:
    """Return G (J, J) of one angle, float32: the blur plus `ROUGH` times the identity."""
    place = np.arange(count)
    bell = np.exp(-0.5 * ((place[:, None] - place) / max(SMOOTH * count, 0.3)) ** 2)
    return ((1 - ROUGH) * bell / bell.sum(1, keepdims=True) + ROUGH * np.eye(count)).astype(np.float32)


def trial_edits(curves: Sequence[Tensor]) -> list[list[Tensor]]:
    """Return trial curves: start curves with one curve doubled around an angle or raised to the power ½."""
    found = []
    for k, curve in enumerate(curves):
        place = (np.arange(len(curve)) + 0.5) / len(curve)
        changes = [1 + np.exp(-(((place - each) / _WIDTH) ** 2))[:, None] for each in _PLACES]
        edited = [curve * curve.new_tensor(change) for change in changes] + [curve.sqrt() * curve.amax().sqrt()]
        found += [[*curves[:k], each, *curves[k + 1 :]] for each in edited]
    return found


def basis_of(blocks: np.ndarray, channels: np.ndarray, curves: Sequence[Tensor], tolerance: float = TOLERANCE) -> Basis:
    """Return the basis of rows (S, J·K): bands of some pixels, each in one channel (S,), at the start curves."""
    scale = scale_of(curves)
    rows = blocks * scale[channels].astype(np.float32)
    start = _starts(product_of(curves) / scale)
    tried = np.arange(len(rows)) % _TRIED == _TRIED - 1
    # A handful of pixels are known and tried alike.
    known, asked = (~tried, tried) if tried.any() else (~tried, ~tried)
    made = _Candidates.of(rows[known], start, [blur(len(curve)) for curve in curves])
    trials = [product_of(each) / scale for each in trial_edits(curves)]
    exact = np.stack([(rows.astype(np.float64) * each[channels]).sum(1) for each in trials], 1)
    inward, reached = _smallest(made, rows[known], exact[known], rows[asked], exact[asked], tolerance)
    rest = rows - (rows @ start) @ made.first
    a = (rest @ inward[:, start.shape[1] :]).astype(np.float64)
    found = np.linalg.pinv(a, rcond=1e-6).astype(np.float32) @ rest
    # Nothing of the rest shows at the start, by rounding either.
    found -= (found @ start) @ made.first
    return Basis(np.ascontiguousarray(inward), np.concatenate((made.first, found)), scale, reached)


def _starts(rho: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis Z (J·K, m) float32 of the channels' initial ρ (C, J·K)."""
    _, values, vectors = np.linalg.svd(rho, full_matrices=False)
    return np.ascontiguousarray(vectors[values > _ALIKE * values[0]].T, dtype=np.float32)


@dataclass(frozen=True)
class _Candidates:
    """Bases of any rank for some rows: `start` Z (J·K, m), `first` U (m, J·K), singular vectors of the remainder.

    The right singular vectors are computed from `blurred` (N, J·K), the left ones `left` (N, N), and the `values` (N,).
    """

    start: np.ndarray
    first: np.ndarray
    blurs: list[np.ndarray]
    blurred: np.ndarray
    left: np.ndarray
    values: np.ndarray

    @classmethod
    def of(cls, rows: np.ndarray, start: np.ndarray, blurs: list[np.ndarray]) -> "_Candidates":
        """Build the candidates from rows (N, J·K) and Z."""
        # U Z is the identity wherever there is light.
        first = np.linalg.pinv((rows @ start).astype(np.float64), rcond=1e-6).astype(np.float32) @ rows
        blurred = _blurred(rows - (rows @ start) @ first, blurs)
        products = np.zeros((len(rows), len(rows)))
        for begin in range(0, rows.shape[1], _COLUMNS):
            some = blurred[:, begin : begin + _COLUMNS]
            products += some @ some.T
        squares, left = np.linalg.eigh(products)
        return cls(start, first, blurs, blurred, left[:, ::-1], np.sqrt(np.maximum(squares[::-1], 0)))

    def inward(self, rank: int) -> np.ndarray:
        """Return [Z, (1 − Z U) G Vᵀ] (J·K, m + rank), float32."""
        some = self.values[:rank]
        divided = self.left[:, :rank] / np.where(some > 1e-7 * self.values[0], some, np.inf)
        vectors = _blurred(divided.T.astype(np.float32) @ self.blurred, [each.T for each in self.blurs]).T
        return np.concatenate((self.start, vectors - self.start @ (self.first @ vectors)), 1)


def _smallest(
    made: _Candidates, rows: np.ndarray, exact: np.ndarray, others: np.ndarray, wanted: np.ndarray, tolerance: float
) -> tuple[np.ndarray, float]:
    """Return the smallest `inward` (J·K, m + r) within the tolerance on the rows `others`, and its error."""
    most, size = min(rows.shape), np.sqrt((wanted**2).mean(0))
    inward, reached = made.start, np.inf
    for ranks in RANKS:
        inward = made.inward(min(ranks[-1], most))
        known, asked = (rows @ inward).astype(np.float64), (others @ inward).astype(np.float64)
        for rank in ranks:
            columns = min(made.start.shape[1] + rank, inward.shape[1])
            vectors = np.linalg.lstsq(known[:, :columns], exact, rcond=1e-6)[0]
            off = np.sqrt(((asked[:, :columns] @ vectors - wanted) ** 2).mean(0))
            reached = float(np.max(off / np.where(size > 0, size, 1)))
            if reached <= tolerance or rank >= most:
                return inward[:, :columns], reached
    return inward, reached


def _blurred(rows: np.ndarray, blurs: list[np.ndarray]) -> np.ndarray:
    """Return rows (N, J·K) times G, one angle after the other."""
    found = rows.reshape(len(rows), *(len(each) for each in blurs))
    found = np.einsum("nj...,jk->nk...", found, blurs[0], optimize=True)
    if len(blurs) == 2:
        found = found @ blurs[1]
    return np.ascontiguousarray(found.reshape(len(rows), -1))
