"""T and U of all pixels in few numbers each (`basis`), kept in 16 bits (`block_floats`).

R = a · W ρ, with a of every pixel and ρ by how much the curves changed. An edit of any size costs P · r products, and
switching from one curve to another is almost free.

`error` is the relative RMS of R against all bands, over pixels that are stored for this purpose, for the current
curves. Edits that raise a curve far above its start, or that are rougher than the basis expects, have larger errors.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch
from torch import Tensor

from homofact.editing.basis import product_of
from homofact.editing.block_floats import BlockFloats
from homofact.editing.transport import FullTransport, check_curves
from homofact.editing.wavelets import transformed

# Pixels whose wavelets are made at a time.
_PIECE = 4096


@dataclass(frozen=True)
class LowRank:
    """`coefficients` a (P, C, r), `outward` W (r, 1, J·K), `scale` (C, J·K) as in `Basis`, and `bands` (J,) or (J, K).

    `probes` stores all bands of the pixels `rows` (S,).
    """

    coefficients: BlockFloats
    outward: BlockFloats
    scale: np.ndarray
    bands: tuple[int, ...]
    rows: np.ndarray
    probes: FullTransport

    @property
    def rank(self) -> int:
        """r."""
        return len(self.outward.codes)

    @property
    def channels(self) -> int:
        """C."""
        return len(self.scale)

    @property
    def nbytes(self) -> int:
        """Bytes of coefficients, W and scale; those of the probes are not needed for a picture."""
        return self.coefficients.nbytes + self.outward.nbytes + self.scale.nbytes

    def picture(self, curves: Sequence[Tensor]) -> Tensor:
        """Return R (P, C), float64."""
        return torch.from_numpy(self.coefficients.times(self._held(curves))).to(torch.float64)

    def frozen(self, active: int, curves: Sequence[Tensor]) -> Tensor:
        """Return T (P, C, J or K) of the active curve."""
        vectors = self._vectors(active, curves)
        return torch.einsum("pcr,crj->pcj", torch.from_numpy(self.coefficients.values()), vectors)

    def wavelets(self, active: int, curves: Sequence[Tensor]) -> Tensor:
        """Return S T (C, J or K, P) float32 of the active curve, by transforming W and not every pixel."""
        vectors = transformed(self._vectors(active, curves)).transpose(1, 2).contiguous()
        pixels = len(self.coefficients.codes)
        found = torch.empty(self.channels, vectors.shape[1], pixels)
        for begin in range(0, pixels, _PIECE):
            own = slice(begin, begin + _PIECE)
            a = torch.from_numpy(self.coefficients.values(own))
            for c in range(self.channels):
                found[c, :, own] = vectors[c] @ a[:, c].T
        return found

    def error(self, curves: Sequence[Tensor]) -> float:
        """Return relative RMS of R over the probes: against all their bands."""
        exact = self.probes.picture(curves).numpy()
        found = np.einsum("pcr,cr->pc", self.coefficients.values(self.rows), self._held(curves))
        size = float((exact**2).mean())
        return math.sqrt(float(((found - exact) ** 2).mean()) / size) if size > 0 else 0.0

    def _held(self, curves: Sequence[Tensor]) -> np.ndarray:
        """Return W ρ (C, r), float32."""
        check_curves(self.bands, self.channels, curves)
        return self.outward.times(product_of(curves) / self.scale).T

    def _vectors(self, active: int, curves: Sequence[Tensor]) -> Tensor:
        """Return W with the other curve fixed, (C, r, J or K) float32."""
        check_curves(self.bands, self.channels, curves)
        if len(self.bands) == 1:
            return torch.from_numpy(self._rows * self._inverse[:, None])
        table = self._rows.reshape(-1, *self.bands)
        held = curves[1 - active].T.numpy().astype(np.float32)
        weights = self._inverse.reshape(-1, *self.bands) * (held[:, None] if active == 0 else held[:, :, None])
        words = "rjk,jk->rj" if active == 0 else "rjk,jk->rk"
        return torch.from_numpy(np.stack([np.einsum(words, table, each) for each in weights]))

    @cached_property
    def _rows(self) -> np.ndarray:
        """W (r, J·K), float32."""
        return self.outward.values()[:, 0]

    @cached_property
    def _inverse(self) -> np.ndarray:
        """1/scale (C, J·K), float32."""
        return (1 / self.scale).astype(np.float32)


CurveTransport = FullTransport | LowRank
