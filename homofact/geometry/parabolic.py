"""The parabolic map of the hemisphere to the unit disc (Heidrich and Seidel 1998; thesis 1.1.3).

(u, v) = (ωx, ωy)/(1 + ωz). With s = u² + v² the inverse is ω = (2u, 2v, 1 − s)/(1 + s): the
stereographic projection from the south pole. Its area element is dω = 4/(1 + s)² du dv, so a texel
at the rim covers a quarter of the solid angle of one at the centre.
"""

import torch
from torch import Tensor


def to_disc(w: Tensor) -> Tensor:
    """Disc coordinates (..., 2) of unit vectors (..., 3) with z > −1; the upper hemisphere fills the unit disc."""
    return w[..., :2] / (1 + w[..., 2:])


def from_disc(uv: Tensor) -> Tensor:
    """Return unit vectors (..., 3) of points (..., 2) of the disc."""
    squared = (uv**2).sum(-1, keepdim=True)
    return torch.cat((2 * uv, 1 - squared), -1) / (1 + squared)
