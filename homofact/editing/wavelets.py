"""Daubechies 4 wavelets of curves and their transport, and pictures by increments (Ben-Artzi et al. 2006, 6 and B).

The transform S is periodic and orthonormal: at each level the coarse half of the coefficients is divided into low-pass
[d1 d2 d3 d4] and high-pass [d4 −d3 d2 −d1] again, down to two of each. Curves and T are both transformed, so that
T · c = (S T) · (S c).

An incremental picture stores the coefficients that it shows, c_effective. Each frame adds the few largest missing
coefficients,

    c_diff = c_perfect − c_effective (29),   R += T · c̃_diff (30),   c_effective += c̃_diff (31),

and goes on while nothing is edited, until nothing is lacking. A shown coefficient is set to its target value instead of
incremented, so that rounding does not accumulate in c_effective. Only the rounding of R accumulates, 1e-7 of each
change, and `refresh` removes it.
"""

import math
from dataclasses import dataclass, field

import torch
from torch import Tensor

from homofact.errors import BadInput

_ROOT = math.sqrt(3)
# d1 … d4 of appendix B in closed form.
LOW = tuple(x / (4 * math.sqrt(2)) for x in (1 + _ROOT, 3 + _ROOT, 3 - _ROOT, 1 - _ROOT))
HIGH = (LOW[3], -LOW[2], LOW[1], -LOW[0])
COARSEST = 4
# The terms that the paper spends on a frame.
TERMS = 30


def transformed(values: Tensor) -> Tensor:
    """S values along the last axis, its length a power of two of at least 4: coarse first, then detail by level."""
    length = values.shape[-1]
    if length < COARSEST or length & (length - 1):
        raise BadInput(where="wavelets", found=f"{length} values", expected=f"a power of two of at least {COARSEST}")
    found, end = values.clone(), length
    while end >= COARSEST:
        found[..., :end] = torch.cat(_step(found[..., :end]), -1)
        end //= 2
    return found


def _step(values: Tensor) -> tuple[Tensor, Tensor]:
    """Return the low-pass and high-pass halves of one wavelet step."""
    shifted = [torch.roll(values, -k, -1)[..., ::2] for k in range(4)]
    low = sum((LOW[k] * shifted[k] for k in range(4)), torch.zeros_like(shifted[0]))
    high = sum((HIGH[k] * shifted[k] for k in range(4)), torch.zeros_like(shifted[0]))
    return low, high


def largest(coefficients: Tensor, count: int) -> Tensor:
    """Return the indices (n,) int64, ascending, of the `count` largest coefficients (J,) that are not 0."""
    order = torch.argsort(coefficients.abs(), descending=True, stable=True)[:count]
    return order[coefficients[order] != 0].sort().values


@dataclass
class Incremental:
    """The picture of one curve by increments.

    `transport` (C, J, P) float32 is S T, with the pixels of a coefficient contiguous. `shown` is R (P, C) float64 of
    the coefficients `effective` (J, C). Use `started` or `of` to make one.
    """

    transport: Tensor
    effective: Tensor
    shown: Tensor
    perfect: Tensor = field(default_factory=lambda: torch.zeros(0))

    @classmethod
    def of(cls, table: Tensor, curve: Tensor) -> "Incremental":
        """From T (P, C, J) and the curve (J, C) that is shown first, in full."""
        return cls.started(transformed(table.to(torch.float32)).permute(1, 2, 0).contiguous(), curve)

    @classmethod
    def started(cls, transport: Tensor, curve: Tensor) -> "Incremental":
        """From S T (C, J, P) and the curve (J, C) that is shown first, in full."""
        effective = transformed(curve.T.to(torch.float64)).T.contiguous()
        shown = torch.zeros(transport.shape[2], transport.shape[0], dtype=torch.float64)
        made = cls(transport, torch.zeros_like(effective), shown)
        made.perfect = effective
        made.refresh()
        return made

    def set_curve(self, curve: Tensor) -> None:
        """Edit: the curve (J, C) that is wanted from now on."""
        self.perfect = transformed(curve.T.to(torch.float64)).T.contiguous()

    @property
    def settled(self) -> bool:
        """Return whether the shown coefficients equal the target ones."""
        return bool(torch.equal(self.perfect, self.effective))

    def update(self, terms: int = TERMS) -> int:
        """Add up to `terms` largest missing coefficients, as one frame; return how many were added.

        A coefficient counts once for all channels, by the largest of them.
        """
        lacking = self.perfect - self.effective
        numbers = largest(lacking.abs().amax(1), terms)
        if len(numbers):
            change = lacking[numbers].to(self.transport)
            for c in range(change.shape[1]):
                # Rows side by side: memory is read once, a coefficient after the other.
                self.shown[:, c] += (change[:, c] @ self.transport[c, numbers]).to(torch.float64)
            self.effective[numbers] = self.perfect[numbers]
        return len(numbers)

    def refresh(self) -> None:
        """Recompute R from all target coefficients."""
        self.effective = self.perfect.clone()
        self.shown = self.full()

    def full(self) -> Tensor:
        """Return the whole sum (P, C), float64, of the target coefficients."""
        curve = self.perfect.to(self.transport)
        return torch.stack([curve[:, c] @ self.transport[c] for c in range(curve.shape[1])], 1).to(torch.float64)

    @property
    def nbytes(self) -> int:
        """Bytes of the transformed transport."""
        return self.transport.numel() * 4


def non_linear(table: Tensor, curve: Tensor, terms: int = TERMS) -> Tensor:
    """Return R (P, C) from the `terms` largest coefficients of the curve (J, C) itself, a baseline for increments."""
    coefficients = transformed(curve.T.to(torch.float64)).T
    kept = torch.zeros_like(coefficients)
    numbers = largest(coefficients.abs().amax(1), terms)
    kept[numbers] = coefficients[numbers]
    return torch.einsum("pcj,jc->pc", transformed(table.to(torch.float64)), kept)
