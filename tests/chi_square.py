"""Pearson's chi-square test of drawn directions against a density, on cells round the mirror direction."""

import math
from collections.abc import Callable

import numpy as np
import torch
from scipy.stats import chi2
from torch import Tensor

from homofact.geometry.directions import normalize

CELLS, FINER = (20, 16), 12


def p_value(found: Tensor, wo: Tensor, density: Callable[[Tensor, Tensor], Tensor], finer: int = FINER) -> float:
    """How likely draws (N, 3) for the viewer `wo` (3,) would be less like `density`, in sr⁻¹, than these are.

    Cells are even in the root of the angle to the mirror direction and in the azimuth round it, so that a lobe has
    many; each one's share is integrated on `finer`² points. Cells of fewer than 5 expected draws are one, and so are
    directions under the horizon, which the density does not have; of these together at least 5 are expected.
    """
    axes = _frame(wo)
    rows, columns = CELLS
    t = (torch.arange(rows * finer, dtype=torch.float64) + 0.5) / (rows * finer)
    phi = (torch.arange(columns * finer, dtype=torch.float64) + 0.5) * (2 * math.pi / (columns * finer))
    angle, turn = torch.meshgrid(math.pi * t**2, phi, indexing="ij")
    local = torch.stack((angle.sin() * turn.cos(), angle.sin() * turn.sin(), angle.cos()), -1).reshape(-1, 3)
    jacobian = (angle.sin() * 2 * math.sqrt(math.pi) * angle.sqrt()).reshape(-1)
    area = 1 / (rows * finer) * (2 * math.pi / (columns * finer))
    wi = local @ axes
    shares = density(wi, wo.expand_as(wi)) * jacobian * area
    expected = shares.reshape(rows, finer, columns, finer).sum((1, 3)).reshape(-1).numpy() * len(found)
    above = found[found[:, 2] > 0] @ axes.T
    place = (torch.acos(above[:, 2].clamp(-1, 1)) / math.pi).sqrt()
    round_it = torch.remainder(torch.atan2(above[:, 1], above[:, 0]), 2 * math.pi) / (2 * math.pi)
    cell = (place * rows).long().clamp_max(rows - 1) * columns + (round_it * columns).long().clamp_max(columns - 1)
    counted = np.bincount(cell.numpy(), minlength=rows * columns).astype(float)
    few = expected < 5
    others = max(expected[few].sum() + max(len(found) - expected.sum(), 0.0), 5.0)
    counted = np.array([*counted[~few], counted[few].sum() + len(found) - len(above)])
    expected = np.array([*expected[~few], others])
    statistic = float(((counted - expected) ** 2 / expected).sum())
    return float(chi2.sf(statistic, len(counted) - 1))


def _frame(wo: Tensor) -> Tensor:
    """Rows: two axes across, and the mirror direction of `wo`."""
    mirror = wo * wo.new_tensor((-1, -1, 1))
    across = normalize(torch.linalg.cross(mirror, wo.new_tensor((0.3, 1.0, 0.2)))[None])[0]
    return torch.stack((across, torch.linalg.cross(mirror, across), mirror))
