"""Low-rank transports as integers for the page, with finer steps where they affect pictures more.

R = Σ_k a_k h_k, h = W ρ. Every column k of a has one step. The steps are chosen for random edits of the start curves,
with rounding treated as noise. Each k then contributes the same error to R, and all together contribute `QUIET` times
the RMS of R. Unimportant numbers become small integers, which deflate compresses well. No step is finer than 16 bits
need for the largest number of its column.

W keeps the codes and scales of the prepared scene. One step per row would not do: curves over several decades start at
ρ = 1e-5 in most bands, where W is large, and the error of rounding W to such a step showed as rings around highlights.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from torch import Tensor

from homofact.editing.basis import product_of
from homofact.editing.lowrank import LowRank

# A tenth of what a half float leaves of each value.
QUIET = 5e-5
_LARGEST, _EDITS = 32767, 8


@dataclass(frozen=True)
class Coded:
    """`numbers` (r, P, C) int16 times `steps` (r,) is a; `outward` (r, J·K) int16 times `rows` and `columns` is W."""

    numbers: np.ndarray
    steps: np.ndarray
    outward: np.ndarray
    rows: np.ndarray
    columns: np.ndarray


def coded(transport: LowRank, curves: Sequence[Tensor]) -> Coded:
    """Return a transport in whole numbers; `curves` are those of its sum as they start."""
    a = transport.coefficients.values().astype(np.float64)
    kept = transport.outward
    rho = product_of(curves) / transport.scale
    held = kept.values()[:, 0].astype(np.float64) @ np.concatenate(
        (rho.T, _edits(transport.bands) * rho.mean(0)[:, None]), 1
    )
    start, edits = held[:, : len(rho)], held[:, len(rho) :]
    picture = math.sqrt(float((np.einsum("pcr,rc->pc", a, start) ** 2).mean()))
    share = QUIET * math.sqrt(12) * picture / math.sqrt(len(held))
    steps = _steps(share / np.maximum(np.sqrt((edits**2).mean(1)), 1e-300), np.abs(a).max((0, 1)))
    numbers = np.rint(a.transpose(2, 0, 1) / steps[:, None, None]).astype(np.int16)
    return Coded(numbers, steps, kept.codes[:, 0], kept.rows[:, 0], kept.columns)


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
