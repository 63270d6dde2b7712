"""T and U of all pixels in few numbers each: a truncated singular value decomposition across pixels.

Rows are pixels and channels, columns bands or pairs of bands, each divided by how large its coefficient is as the
curves start (above `FLOOR` of the largest), so that errors are errors of radiance. The right singular vectors V come
from some of the pixels, by subspace iteration (Halko, Martinsson and Tropp 2011, algorithm 4.4); every pixel is then
projected on them, and what is left over is measured pixel by pixel. R = a · (V (c ∘ c')) costs P·r products whatever
was edited, and changing over from one curve to the other nothing.

`error` is the relative RMS of R over the pixels that were set aside, the low rank against all bands, for the curves
that are shown now: edits that lift a curve far above its start lift its errors too, and are not foreseen.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from homofact.scene.editing.transport import Full, check_curves

FLOOR = 0.02
TOLERANCE, MOST_TERMS = 1e-3, 128
_OVERSAMPLED, _ITERATIONS = 16, 3


@dataclass(frozen=True)
class Basis:
    """`vectors` (r, J·K) float32 with orthonormal rows, and `scale` (C, J·K), what each column was multiplied by."""

    vectors: np.ndarray
    scale: np.ndarray

    @property
    def rank(self) -> int:
        """r."""
        return len(self.vectors)

    def coefficients(self, block: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(a (P, C, r) float32, squares (P, 2): left over, and in all) of a block (P, C, J·K)."""
        rows = block.astype(np.float32)
        rows *= self.scale.astype(np.float32)
        found = (rows.reshape(-1, rows.shape[2]) @ self.vectors.T).reshape(*rows.shape[:2], -1)
        whole = np.einsum("pcj,pcj->p", rows, rows)
        left = whole - np.einsum("pcr,pcr->p", found, found)
        return found, np.stack((np.maximum(left, 0), whole), 1).astype(np.float64)


def scale_of(curves: Sequence[Tensor]) -> np.ndarray:
    """The scale (C, J·K) of columns: the starting coefficient, but no less than `FLOOR` of the channel's largest."""
    value = curves[0].numpy().T
    if len(curves) == 2:
        value = (value[:, :, None] * curves[1].numpy().T[:, None, :]).reshape(len(value), -1)
    return np.maximum(value, FLOOR * value.max(1, keepdims=True))


def basis_of(blocks: np.ndarray, curves: Sequence[Tensor], tolerance: float = TOLERANCE, seed: int = 0) -> Basis:
    """The smallest basis that leaves at most `tolerance` (relative RMS) of some pixels' blocks (S, C, J·K)."""
    scale = scale_of(curves)
    rows = (blocks * scale.astype(np.float32)).reshape(-1, blocks.shape[2]).astype(np.float32)
    most = min(MOST_TERMS, *rows.shape)
    generator = np.random.default_rng(seed)
    sketch = generator.standard_normal((rows.shape[1], min(most + _OVERSAMPLED, *rows.shape))).astype(np.float32)
    for _ in range(_ITERATIONS):
        sketch = np.linalg.qr(rows.T @ np.linalg.qr(rows @ sketch)[0])[0]
    _, values, vectors = np.linalg.svd(rows @ sketch, full_matrices=False)
    total = float((rows.astype(np.float64) ** 2).sum())
    left = total - np.cumsum(values.astype(np.float64) ** 2)
    enough = np.flatnonzero(left <= tolerance**2 * total)
    rank = min(most, int(enough[0]) + 1 if len(enough) else most)
    return Basis(np.ascontiguousarray((vectors @ sketch.T)[:rank]), scale)


@dataclass(frozen=True)
class LowRank:
    """`coefficients` (P, C, r) float32 on a basis.

    `left` is the relative RMS of what the basis leaves over of all pixels' bands; `probes` holds the pixels `rows` (S,)
    in full.
    """

    coefficients: np.ndarray
    basis: Basis
    sizes: tuple[int, ...]
    left: float
    rows: np.ndarray
    probes: Full

    @property
    def bands(self) -> tuple[int, ...]:
        """(J,) or (J, K)."""
        return self.sizes

    @property
    def nbytes(self) -> int:
        """Bytes of coefficients and basis; those of the probes are not needed for a picture."""
        return self.coefficients.nbytes + self.basis.vectors.nbytes + self.basis.scale.nbytes

    def picture(self, curves: Sequence[Tensor]) -> Tensor:
        """R (P, C), float64."""
        held = self._held(curves)
        a = torch.from_numpy(self.coefficients)
        found = torch.stack([a[:, c] @ held[c] for c in range(a.shape[1])], 1)
        return found.to(torch.float64)

    def frozen(self, active: int, curves: Sequence[Tensor]) -> Tensor:
        """T (P, C, J or K) of the active curve."""
        check_curves(self.sizes, self.coefficients.shape[1], curves)
        vectors = torch.from_numpy(self.basis.vectors / self.basis.scale[:, None]).to(torch.float32)
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
        """V (c ∘ c')/scale (C, r), float32."""
        check_curves(self.sizes, self.coefficients.shape[1], curves)
        product = curves[0].T.to(torch.float64)
        if len(curves) == 2:
            product = (product[:, :, None] * curves[1].T.to(product)[:, None, :]).reshape(len(product), -1)
        scaled = (product / torch.from_numpy(self.basis.scale)).to(torch.float32)
        return scaled @ torch.from_numpy(self.basis.vectors).T
