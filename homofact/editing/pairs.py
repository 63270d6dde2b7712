"""Pairs of directions on which curves are found, edits solved for, and both judged."""

import torch
from torch import Tensor

from homofact.editing.angles import RIGHT_ANGLE
from homofact.geometry.directions import draw_in_discs, from_half_difference, from_spherical


def pairs_of(count: int, seed: int) -> tuple[Tensor, Tensor]:
    """Return pairs (N, 3) for solving and for measuring: half over the discs, half near small θh (highlights)."""
    generator = torch.Generator().manual_seed(seed)
    everywhere = draw_in_discs(count - count // 2, generator)
    u = torch.rand(2 * count, 4, dtype=torch.float64, generator=generator)
    h = from_spherical(RIGHT_ANGLE * u[:, 0] ** 3, 4 * RIGHT_ANGLE * u[:, 1])
    d = from_spherical(RIGHT_ANGLE * u[:, 2], 4 * RIGHT_ANGLE * u[:, 3])
    wi, wo = from_half_difference(h, d)
    above = ((wi[:, 2] > 0) & (wo[:, 2] > 0)).nonzero()[: count // 2, 0]
    return torch.cat((everywhere[0], wi[above])), torch.cat((everywhere[1], wo[above]))
