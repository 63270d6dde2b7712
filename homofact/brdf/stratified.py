"""Draw a smaller sample set by cells, so that it still covers the highlight and grazing angles.

A dense measurement has most of its samples where the BRDF hardly changes. Each of 12 × 6 × 4 cells of (√θh, θd, φd),
which are finer in θh towards the highlight, contributes the same number of samples, or all of its samples if it has
fewer. The weights of the drawn samples of a cell are scaled so that their sum is that of all samples of the cell. A fit
to the subset then minimises an estimate of the same objective. If `count` is smaller than the number of occupied cells,
the grid is made coarser first, so that no cell is left out.
"""

from dataclasses import replace

import torch
from torch import Tensor

from homofact.brdf.quality.coverage import occupied_cells
from homofact.brdf.samples import Samples
from homofact.errors import BadInput
from homofact.geometry.coordinates import coordinate_system

GRIDS = ((12, 6, 4), (6, 3, 2), (3, 2, 1), (2, 1, 1), (1, 1, 1))


def stratified_subset(samples: Samples, count: int, seed: int) -> Samples:
    """Return at most `count` samples, drawn by cells without replacement by `seed`, in their original order.

    provenance["subset"] records the original number of samples and the cells. If there are at most `count` samples,
    they are returned unchanged. Raises BadInput for a count below 1.
    """
    if count < 1:
        raise BadInput(where="subset", found=count, expected="at least 1 sample")
    if count >= len(samples):
        return samples
    place = (coordinate_system("isotropic-half-diff").evaluate(samples.wi, samples.wo) + 1) / 2
    place[:, 0] = place[:, 0].clamp_min(0).sqrt()
    grid, cell, sizes = _cells(place, count)
    generator = torch.Generator().manual_seed(seed)
    order = torch.randperm(len(samples), generator=generator).to(cell.device)
    order = order[cell[order].argsort(stable=True)]
    # Samples lie cell by cell now, at random inside each; the first of each cell are taken.
    first = sizes.cumsum(0) - sizes
    rank = torch.arange(len(samples), device=cell.device) - first[cell[order]]
    index = order[rank < _quotas(sizes, count, generator)[cell[order]]].sort().values
    weights = _carried(samples.weights, cell, index, len(sizes))
    facts = {
        "of": len(samples),
        "samples": len(index),
        "cells": len(sizes),
        "grid": {"sqrt_theta_h": grid[0], "theta_d": grid[1], "phi_d": grid[2]},
        "seed": seed,
    }
    provenance = samples.provenance | {"subset": facts}
    return replace(samples.select(index), weights=weights, provenance=provenance)


def _cells(place: Tensor, count: int) -> tuple[tuple[int, int, int], Tensor, Tensor]:
    """The first of `GRIDS` with at most `count` cells occupied, each sample's cell, and each cell's size."""
    for grid in GRIDS:
        _, cell, sizes = torch.unique(occupied_cells(place, grid), return_inverse=True, return_counts=True)
        if len(sizes) <= count:
            return grid, cell, sizes
    raise AssertionError("the last grid is one cell")


def _quotas(sizes: Tensor, count: int, generator: torch.Generator) -> Tensor:
    """How many each cell gives: one level for all, less where a cell has less, `count` together."""
    low, high = 0, count
    while low < high:
        middle = (low + high + 1) // 2
        low, high = (middle, high) if int(sizes.clamp_max(middle).sum()) <= count else (low, middle - 1)
    quotas = sizes.clamp_max(low)
    richer = (sizes > low).nonzero()[:, 0]
    left = count - int(quotas.sum())
    chosen = torch.randperm(len(richer), generator=generator)[:left].to(sizes.device)
    quotas[richer[chosen]] += 1
    return quotas


def _carried(weights: Tensor, cell: Tensor, index: Tensor, cells: int) -> Tensor:
    """The weights of the drawn samples, scaled so that each cell's sum is what it was."""

    def totals(where: Tensor, values: Tensor) -> Tensor:
        return torch.zeros(cells, dtype=values.dtype, device=values.device).index_add_(0, where, values)

    drawn, here = weights[index], cell[index]
    whole, part = totals(cell, weights)[here], totals(here, drawn)[here]
    # A cell whose drawn samples all weigh nothing is carried by them alike.
    alike = whole / totals(here, torch.ones_like(drawn))[here]
    return torch.where(part > 0, drawn * whole / part.clamp_min(torch.finfo(weights.dtype).tiny), alike)
