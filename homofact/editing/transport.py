"""The light towards the viewer as a linear function of one curve or a bilinear function of two (eq. 6, 23).

R (P, C) = Σ_j c_j T_j, or Σ_jk c^A_j c^B_k U_jk, for the P pixels that one term of one object has in a view. There are
two forms with one interface. `FullTransport` stores every band of every pixel and is exact. `lowrank.LowRank` stores a
few numbers per pixel and reports its error.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from homofact.editing.wavelets import transformed
from homofact.errors import BadInput


@dataclass(frozen=True)
class FullTransport:
    """Every band of every pixel: `table` (P, C, J, K) float32, K = 1 where there is one curve."""

    table: np.ndarray
    curves: int

    @property
    def bands(self) -> tuple[int, ...]:
        """(J,) or (J, K)."""
        return tuple(self.table.shape[2 : 2 + self.curves])

    @property
    def nbytes(self) -> int:
        """Bytes of the table."""
        return self.table.nbytes

    def picture(self, curves: Sequence[Tensor]) -> Tensor:
        """Return R (P, C), float64."""
        held = self.frozen(0, curves).to(torch.float64)
        return torch.einsum("pcj,jc->pc", held, curves[0].to(torch.float64))

    def frozen(self, active: int, curves: Sequence[Tensor]) -> Tensor:
        """Return T (P, C, J or K) of the active curve."""
        check_curves(self.bands, int(self.table.shape[1]), curves)
        table = torch.from_numpy(self.table)
        if self.curves == 1:
            return table[:, :, :, 0]
        held = curves[1 - active].to(table)
        return torch.einsum("pcjk,kc->pcj" if active == 0 else "pcjk,jc->pck", table, held)

    def wavelets(self, active: int, curves: Sequence[Tensor]) -> Tensor:
        """Return S T (C, J or K, P) float32 of the active curve."""
        return transformed(self.frozen(active, curves)).permute(1, 2, 0).contiguous()


def check_curves(bands: tuple[int, ...], channels: int, curves: Sequence[Tensor]) -> None:
    """Raise BadInput where curves (J, C) do not fit the bands."""
    found = [tuple(curve.shape) for curve in curves]
    expected = [(count, channels) for count in bands]
    if found != expected:
        raise BadInput(where="curves", found=f"the shapes {found}", expected=expected)
