"""T and U of all pixels in few numbers each: a reduced-rank regression across pixels.

Rows are pixels and channels, columns bands or pairs of bands, each times how large its coefficient is as the curves
start (above `FLOOR` of the largest), so that a picture is a row times how much the curves changed, ρ = c c'/start.
Changes are smooth over γ more than they are not: with G, a blur over `SMOOTH` of [0, π/2] and a little of what is not
blurred, what matters of the rows is rows · G. Its right singular vectors V come from some of the pixels, by subspace
iteration (Halko, Martinsson and Tropp 2011, algorithm 4.4). Every pixel keeps a = row · G Vᵀ, and R = a · W ρ, where W
gives those pixels' rows back from their a with the least squares. An edit of any size costs P · r products, and
changing over from one curve to the other nothing.

`error` is the relative RMS of R over pixels that were set aside, against all bands, for the curves that are shown now:
edits that lift a curve far above its start, or are rougher than G, lift their errors too.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from homofact.scene.editing.transport import Full, check_curves

FLOOR, SMOOTH, ROUGH = 0.02, 4 / 256, 0.03
TOLERANCE = 3e-3
# What is tried, the fewest first; of two curves the more.
RANKS = (128, 384)
_OVERSAMPLED, _ITERATIONS = 16, 2


@dataclass(frozen=True)
class Basis:
    """`inward` G Vᵀ (J·K, r) and `outward` W (r, J·K), float32; `scale` (C, J·K), what columns were multiplied by."""

    inward: np.ndarray
    outward: np.ndarray
    scale: np.ndarray

    @property
    def rank(self) -> int:
        """r."""
        return len(self.outward)

    def coefficients(self, block: np.ndarray) -> np.ndarray:
        """a (P, C, r) float32 of a block (P, C, J·K)."""
        rows = block.astype(np.float32)
        rows *= self.scale.astype(np.float32)
        return (rows.reshape(-1, rows.shape[2]) @ self.inward).reshape(*rows.shape[:2], -1)


def scale_of(curves: Sequence[Tensor]) -> np.ndarray:
    """The scale (C, J·K) of columns: the starting coefficient, but no less than `FLOOR` of the channel's largest."""
    value = curves[0].numpy().T
    if len(curves) == 2:
        value = (value[:, :, None] * curves[1].numpy().T[:, None, :]).reshape(len(value), -1)
    return np.maximum(value, FLOOR * value.max(1, keepdims=True))


def blur(count: int) -> np.ndarray:
    """G (J, J) of one angle, float32: the blur, and `ROUGH` of the identity."""
    place = np.arange(count)
    bell = np.exp(-0.5 * ((place[:, None] - place) / max(SMOOTH * count, 0.3)) ** 2)
    return ((1 - ROUGH) * bell / bell.sum(1, keepdims=True) + ROUGH * np.eye(count)).astype(np.float32)


def basis_of(blocks: np.ndarray, curves: Sequence[Tensor], tolerance: float = TOLERANCE, seed: int = 0) -> Basis:
    """The smallest basis that leaves at most `tolerance` (relative RMS, blurred) of some pixels' blocks (S, C, J·K)."""
    scale = scale_of(curves)
    rows = (blocks * scale.astype(np.float32)).reshape(-1, blocks.shape[2]).astype(np.float32)
    blurs = [blur(len(curve)) for curve in curves]
    blurred = _blurred(rows, blurs)
    total = float((blurred.astype(np.float64) ** 2).sum())
    rank, vectors = 1, np.zeros((1, rows.shape[1]), np.float32)
    for most in RANKS if len(curves) == 1 else RANKS[1:]:
        values, vectors = _singular(blurred, min(most, *rows.shape), seed)
        left = total - np.cumsum(values.astype(np.float64) ** 2)
        enough = np.flatnonzero(left <= tolerance**2 * total)
        rank = int(enough[0]) + 1 if len(enough) else len(values)
        if len(enough) or most >= min(rows.shape):
            break
    inward = _blurred(vectors[:rank], [each.T for each in blurs]).T
    a = (rows @ inward).astype(np.float64)
    outward = np.linalg.pinv(a, rcond=1e-6).astype(np.float32) @ rows
    return Basis(np.ascontiguousarray(inward), np.ascontiguousarray(outward), scale)


def _blurred(rows: np.ndarray, blurs: list[np.ndarray]) -> np.ndarray:
    """Rows (N, J·K) times G, an angle after the other."""
    found = rows.reshape(len(rows), *(len(each) for each in blurs))
    found = np.einsum("nj...,jk->nk...", found, blurs[0], optimize=True)
    if len(blurs) == 2:
        found = found @ blurs[1]
    return np.ascontiguousarray(found.reshape(len(rows), -1))


def _singular(rows: np.ndarray, count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """The largest `count` singular values and right vectors (count, ·) of rows."""
    generator = np.random.default_rng(seed)
    sketch = generator.standard_normal((rows.shape[1], min(count + _OVERSAMPLED, *rows.shape))).astype(np.float32)
    for _ in range(_ITERATIONS):
        sketch = np.linalg.qr(rows.T @ np.linalg.qr(rows @ sketch)[0])[0]
    _, values, vectors = np.linalg.svd(rows @ sketch, full_matrices=False)
    return values[:count], (vectors @ sketch.T)[:count]


@dataclass(frozen=True)
class LowRank:
    """`coefficients` (P, C, r), `outward` W (r, J·K), float32, and `scale` (C, J·K), as in `Basis`.

    `probes` holds the pixels `rows` (S,) in full.
    """

    coefficients: np.ndarray
    outward: np.ndarray
    scale: np.ndarray
    sizes: tuple[int, ...]
    rows: np.ndarray
    probes: Full

    @property
    def rank(self) -> int:
        """r."""
        return len(self.outward)

    @property
    def bands(self) -> tuple[int, ...]:
        """(J,) or (J, K)."""
        return self.sizes

    @property
    def nbytes(self) -> int:
        """Bytes of coefficients, W and scale; those of the probes are not needed for a picture."""
        return self.coefficients.nbytes + self.outward.nbytes + self.scale.nbytes

    def picture(self, curves: Sequence[Tensor]) -> Tensor:
        """R (P, C), float64."""
        held = self._held(curves)
        a = torch.from_numpy(self.coefficients)
        found = torch.stack([a[:, c] @ held[c] for c in range(a.shape[1])], 1)
        return found.to(torch.float64)

    def frozen(self, active: int, curves: Sequence[Tensor]) -> Tensor:
        """T (P, C, J or K) of the active curve."""
        check_curves(self.sizes, self.coefficients.shape[1], curves)
        vectors = torch.from_numpy(self.outward / self.scale[:, None]).to(torch.float32)
        if len(self.sizes) == 2:
            table = vectors.reshape(len(vectors), -1, *self.sizes)
            held = curves[1 - active].to(table)
            vectors = torch.einsum("crjk,kc->crj" if active == 0 else "crjk,jc->crk", table, held)
        return torch.einsum("pcr,crj->pcj", torch.from_numpy(self.coefficients), vectors)

    def error(self, curves: Sequence[Tensor]) -> float:
        """Relative RMS of R over the probes: against all their bands."""
        exact = self.probes.picture(curves)
        held = self._held(curves)
        a = torch.from_numpy(self.coefficients[self.rows])
        found = torch.einsum("pcr,cr->pc", a, held)
        size = float((exact**2).mean())
        return math.sqrt(float(((found - exact) ** 2).mean()) / size) if size > 0 else 0.0

    def _held(self, curves: Sequence[Tensor]) -> Tensor:
        """W ρ (C, r), float32."""
        check_curves(self.sizes, self.coefficients.shape[1], curves)
        product = curves[0].T.to(torch.float64)
        if len(curves) == 2:
            product = (product[:, :, None] * curves[1].T.to(product)[:, None, :]).reshape(len(product), -1)
        scaled = (product / torch.from_numpy(self.scale)).to(torch.float32)
        return scaled @ torch.from_numpy(self.outward).T
