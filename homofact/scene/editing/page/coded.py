"""Transports at low rank as whole numbers for the page: fine steps where a picture feels them, coarse ones elsewhere.

R = Σ_k a_k h_k, h = W ρ. Every column k of a and every row of W has one step. A step is chosen so that its rounding,
were it noise, adds the same to R for all k, and `QUIET` of R's root mean square in all: numbers of what matters little
are then small, and deflate makes them short. No step is finer than 16 bits need for the largest number of its column.
"""

import math
from dataclasses import dataclass

import numpy as np

from homofact.scene.editing.lowrank import LowRank

# A tenth of what a half float leaves of each value, for a and for W each.
QUIET = 5e-5
_LARGEST = 32767


@dataclass(frozen=True)
class Coded:
    """`numbers` (r, P, C) int16 times `steps` (r,) is a; `outward` (r, J·K) int16 times `outward_steps` (r,) is W."""

    numbers: np.ndarray
    steps: np.ndarray
    outward: np.ndarray
    outward_steps: np.ndarray

    @property
    def coefficients(self) -> np.ndarray:
        """a (P, C, r), float64, as the page has it."""
        return (self.numbers * self.steps[:, None, None]).transpose(1, 2, 0)

    @property
    def rows(self) -> np.ndarray:
        """W (r, J·K), float64, as the page has it."""
        return self.outward * self.outward_steps[:, None]


def coded(transport: LowRank) -> Coded:
    """A transport in whole numbers."""
    a, rows = transport.coefficients.astype(np.float64), transport.outward.astype(np.float64)
    # The picture as the curves start, up to the scale's floor: ρ = 1.
    held = rows.sum(1)
    picture = math.sqrt(float(((a @ held) ** 2).mean()))
    each = np.sqrt((a**2).mean((0, 1)))
    noise = QUIET * math.sqrt(12)
    own = np.linalg.norm(each) / math.sqrt(len(rows))
    step = noise * min(own, picture / max(float(np.linalg.norm(held)), 1e-300))
    steps = _steps(np.full(len(rows), step), np.abs(a).max((0, 1)))
    share = noise * picture / math.sqrt(rows.size)
    outward_steps = _steps(share / np.maximum(each, 1e-300), np.abs(rows).max(1))
    numbers = np.rint(a.transpose(2, 0, 1) / steps[:, None, None]).astype(np.int16)
    return Coded(numbers, steps, np.rint(rows / outward_steps[:, None]).astype(np.int16), outward_steps)


def _steps(wanted: np.ndarray, largest: np.ndarray) -> np.ndarray:
    """Steps that 16 bits are enough for; a column of zeros has 1."""
    found = np.maximum(wanted, largest / _LARGEST)
    return np.where(found > 0, found, 1.0)
