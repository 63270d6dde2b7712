"""Low-rank transports as integers for the page, with finer steps where they affect pictures more.

R = Σ_k a_k h_k, h = W ρ. Every column k of a and every row of W has one step. The steps are chosen for random edits ρ,
with rounding treated as noise. Each k then contributes the same error to R, and all together contribute `QUIET` times
the RMS of R. Unimportant numbers become small integers, which deflate compresses well. No step is finer than 16 bits
need for the largest number of its column.
"""

import math
from dataclasses import dataclass

import numpy as np

from homofact.editing.lowrank import LowRank

# A tenth of what a half float leaves of each value, for a and for W each.
QUIET = 5e-5
_LARGEST, _EDITS = 32767, 8


@dataclass(frozen=True)
class Coded:
    """`numbers` (r, P, C) int16 times `steps` (r,) is a; `outward` (r, J·K) int16 times `outward_steps` (r,) is W."""

    numbers: np.ndarray
    steps: np.ndarray
    outward: np.ndarray
    outward_steps: np.ndarray


def coded(transport: LowRank) -> Coded:
    """Return a transport in whole numbers."""
    a = transport.coefficients.values().astype(np.float64)
    rows = transport.outward.values()[:, 0].astype(np.float64)
    # The picture as the curves start, up to the scale's floor: ρ = 1.
    picture = math.sqrt(float(((a @ rows.sum(1)) ** 2).mean()))
    each = np.sqrt((a**2).mean((0, 1)))
    held = np.sqrt(((rows @ _edits(transport.bands)) ** 2).mean(1))
    share = QUIET * math.sqrt(12) * picture / math.sqrt(len(rows))
    steps = _steps(share / np.maximum(held, 1e-300), np.abs(a).max((0, 1)))
    outward_steps = _steps(share / math.sqrt(rows.shape[1]) / np.maximum(each, 1e-300), np.abs(rows).max(1))
    numbers = np.rint(a.transpose(2, 0, 1) / steps[:, None, None]).astype(np.int16)
    return Coded(numbers, steps, np.rint(rows / outward_steps[:, None]).astype(np.int16), outward_steps)


def _edits(bands: tuple[int, ...]) -> np.ndarray:
    """Return ρ (J·K, n) of random edits by factors of ½ to 2: of eighths of each angle, and of single bands."""
    generator = np.random.default_rng(0)
    found = []
    for steps in (*[min(8, *bands)] * _EDITS, *[0] * _EDITS):
        rho = np.ones(1)
        for count in bands:
            own = generator.uniform(0.5, 2.0, steps or count)
            rho = np.multiply.outer(rho, own.repeat(count // len(own))).ravel()
        found.append(rho)
    return np.stack(found, 1)


def _steps(wanted: np.ndarray, largest: np.ndarray) -> np.ndarray:
    """Return quantization steps for which 16 bits suffice; 1 for columns of zeros."""
    found = np.maximum(wanted, largest / _LARGEST)
    return np.where(found > 0, found, 1.0)
