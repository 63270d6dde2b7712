"""Means of a reflectance over the bands of a Klems basis and over the cells of a tensor tree, as daylight programs
store them.

Both means weight directions by projected solid angle and use points of a Sobol sequence over the two directions. The
error of a Klems mean is half the difference between the means of the two halves of its points. If it exceeds 1%, as
near a narrow highlight, the mean is recomputed with sixteen times as many points.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from homofact.brdf.klems import KlemsBasis, KlemsTable, opposite
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.tensor_tree import to_disk

POINTS = 128
_MORE = 16
_CLOSE = 0.01
_CHUNK = 2**19
_LOWEST = 1e-4


@dataclass(frozen=True)
class BandMeans:
    """A table of means, and the 99th percentile of their relative errors, estimated from two halves of the points."""

    table: KlemsTable
    error: float


def klems_means(
    reflectance: Reflectance,
    basis: KlemsBasis,
    isotropic: bool,
    points: int = POINTS,
    progress: Callable[[int, int], object] | None = None,
) -> BandMeans:
    """Return the means over all pairs of patches; if `isotropic`, average entries of equal θi, θo and |Δφ|.

    `progress` is called with (parts done, number of parts). The first half of the parts are the first pass, the second
    half are the pairs that need more points.
    """
    rows, apart = [], []
    light, view = _inside(basis, points)
    for k in range(basis.size):
        if progress is not None:
            progress(k, 2 * basis.size)
        means, error = _halves(reflectance, light[k].expand(basis.size, points, 3), view)
        rows.append(means)
        apart.append(error)
    values, error = torch.stack(rows), torch.stack(apart)
    coarse = (error > _CLOSE * values.amax(2)).nonzero()
    if len(coarse):
        light, view = _inside(basis, _MORE * points)
        done, total = 0, len(coarse)
        for pairs in coarse.split(max(1, _CHUNK // (_MORE * points))):
            i, o = pairs.unbind(1)
            if progress is not None:
                progress(total + done, 2 * total)
            done += len(pairs)
            values[i, o], error[i, o] = _halves(reflectance, light[i], view[o])
    table = KlemsTable(basis, basis, values, reflectance.channels)
    relative = error / values.amax(2).clamp_min(1e-12)
    return BandMeans(table.averaged() if isotropic else table, float(relative.reshape(-1).quantile(0.99)))


def tree_means(
    reflectance: Reflectance,
    side: int,
    isotropic: bool,
    points: int = 16,
    progress: Callable[[int, int], object] | None = None,
) -> Tensor:
    """Return the means (side, side, side, C) over cells of the unit cube if `isotropic`, else over four dimensions.

    In three dimensions, values are averaged over the azimuth of the pair, and the half of the cube that no direction of
    the light reaches is 0. In four, the shape is (side, side, side, side, C).
    """
    draws = torch.quasirandom.SobolEngine(4, scramble=True, seed=1).draw(points, dtype=torch.float64)
    number = side // 2 if isotropic else side * side
    rows = []
    for k in range(number):
        if progress is not None:
            progress(k, number)
        cells = torch.arange(side * side)
        within = torch.stack((cells // side, cells % side), 1)[:, None].double()
        view = _lifted(to_disk(((within + draws[:, 2:]) / side).reshape(-1, 2)))
        if isotropic:
            radius = (1 - 2 * (k + draws[:, 0]) / side).clamp(0, 1)
            light = torch.stack((radius, torch.zeros_like(radius)), 1)
        else:
            light = to_disk((torch.tensor([k // side, k % side]) + draws[:, :2]) / side)
        light = _lifted(light).repeat(side * side, 1)
        if isotropic:
            turn = (2 * math.pi * draws[:, 1]).repeat(side * side)
            light, view = _turned(light, turn), _turned(view, turn)
        rows.append(_evaluated(reflectance, opposite(light), view).reshape(side * side, points, -1).mean(1))
    values = torch.stack(rows)
    if not isotropic:
        return values.reshape(side, side, side, side, -1)
    values = values.reshape(number, side, side, -1)
    values = (values + values.flip(2)) / 2
    return torch.cat((values, torch.zeros_like(values)))


def _inside(basis: KlemsBasis, points: int) -> tuple[Tensor, Tensor]:
    """Directions (size, points, 3) of the light and of the viewer, in pairs of a Sobol sequence."""
    draws = torch.quasirandom.SobolEngine(4, scramble=True, seed=0).draw(points, dtype=torch.float64)
    return opposite(basis.inside(draws[:, 0], draws[:, 1])), basis.inside(draws[:, 2], draws[:, 3])


def _halves(reflectance: Reflectance, light: Tensor, view: Tensor) -> tuple[Tensor, Tensor]:
    """(means (N, C), half the difference of both halves' means (N,)) of pairs (N, points, 3)."""
    values = _evaluated(reflectance, light.reshape(-1, 3), view.reshape(-1, 3)).reshape(*light.shape[:2], -1)
    half = light.shape[1] // 2
    return values.mean(1), (values[:, :half].mean(1) - values[:, half:].mean(1)).abs().amax(1) / 2


def _evaluated(reflectance: Reflectance, wi: Tensor, wo: Tensor) -> Tensor:
    wi, wo = (torch.cat((w[:, :2], w[:, 2:].clamp_min(_LOWEST)), 1) for w in (wi, wo))
    wi, wo = (w / w.norm(dim=1, keepdim=True) for w in (wi, wo))
    parts = [reflectance.evaluate(i, o).double() for i, o in zip(wi.split(_CHUNK), wo.split(_CHUNK), strict=True)]
    return torch.cat(parts)


def _lifted(disk: Tensor) -> Tensor:
    """Unit vectors (N, 3) above points of the unit disk (N, 2)."""
    return torch.cat((disk, (1 - (disk**2).sum(1, keepdim=True)).clamp_min(0).sqrt()), 1)


def _turned(w: Tensor, angle: Tensor) -> Tensor:
    cos, sin = torch.cos(angle), torch.sin(angle)
    return torch.stack((cos * w[:, 0] - sin * w[:, 1], sin * w[:, 0] + cos * w[:, 1], w[:, 2]), 1)
