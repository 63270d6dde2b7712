"""The data that `rendering.filtered` needs of a material: the flux of its lobe in patches, and a table of the rest.

They are the same for every light. A material is evaluated at a grid of normals, with the viewer in the xz-plane of
each.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from homofact.geometry.directions import from_spherical
from homofact.rendering.surface import sphere_frames

Shade = Callable[[Tensor, Tensor], Tensor]
STEEPEST = math.radians(89.5)
WINDOW = (math.radians(3.0), math.radians(10.0))
_CORE = 4  # of so many rings of patches one is in the middle, a single patch
# Averages reach so many powers of two beyond their patch, which hides the gaps between round ones.
_OVERLAP = 0.5
_BATCH = 1 << 17


class PatchGrid(NamedTuple):
    """The numbers of θo (`levels`) and azimuths around the view (`turns`) of a material's grid, and its fineness.

    There are `rings` × `spokes` patches around the lobe, with `finer` values per patch along the radius. `rest` has the
    numbers of steps of θh/θmax and φh.
    """

    levels: int
    turns: int
    rings: int
    spokes: int
    finer: int
    rest: int

    def angles(self) -> Tensor:
        """Return θo (L,) of the levels."""
        return torch.linspace(0, STEEPEST, self.levels, dtype=torch.float64)


class Fineness(NamedTuple):
    """The grids of a material, and `cells` and `azimuths` of the light that `rendering.filtered` sums."""

    isotropic: PatchGrid
    anisotropic: PatchGrid
    cells: tuple[int, int]
    azimuths: int


# A fit and its source are drawn on the same grid: at the middle of a narrow highlight the grids' own errors, of some
# percent, have either sign.
FULL = Fineness(PatchGrid(64, 1, 28, 36, 4, 48), PatchGrid(24, 36, 28, 36, 2, 32), (32, 128), 192)
# For spheres of some 200 pixels: under a smooth light, and a lobe under any, within a percent of the full picture.
DRAFT = Fineness(PatchGrid(32, 1, 16, 16, 3, 32), PatchGrid(16, 24, 16, 16, 3, 24), (16, 64), 96)
# For errors of a fit: alike on both sides, what they have in common cancels.
COARSE = Fineness(PatchGrid(36, 1, 16, 16, 2, 24), PatchGrid(12, 12, 12, 12, 2, 16), (16, 64), 48)


class PatchedLobe(NamedTuple):
    """J patches per level: `flux` (L, A, J, 3), their directions, and the widths of their averages of light.

    `towards` (L, J, 3) are in the frame (e, e × v, v), v towards the viewer, e ⟂ v to the normal's side; `size` (L, J)
    is half the binary logarithm of a solid angle.
    """

    flux: np.ndarray
    towards: np.ndarray
    size: np.ndarray


class PatchedMaterial(NamedTuple):
    """A material to draw: f, its grid, the viewer's azimuths φo (L, A), and whether half of the grid suffices."""

    shade: Shade
    grid: PatchGrid
    turns: Tensor
    mirrored: bool

    def asked(self, wi: Tensor, wo: Tensor, use: Tensor) -> Tensor:
        """Evaluate f (A, L, R, S, 3) where `use` (L, R, S) is true, else 0, at directions (L, R, S, 3)."""
        values = torch.zeros(self.turns.shape[1], *wi.shape, dtype=torch.float64)
        for number, turn in enumerate(self.turns.unbind(1)):
            angle = turn[:, None, None].expand(use.shape)[use]
            pairs = [_turned(w[use], angle).split(_BATCH) for w in (wi, wo)]
            values[number][use] = torch.cat([self.shade(*pair) for pair in zip(*pairs, strict=True)]).expand(-1, 3)
        return values


def turns_of(grid: PatchGrid, axes: Tensor) -> Tensor:
    """φo (L, A) in the frames of the sphere at the grid's normals; 0 where there is one azimuth."""
    if grid.turns == 1:
        return torch.zeros(grid.levels, 1, dtype=torch.float64)
    azimuth = torch.arange(grid.turns, dtype=torch.float64) * (2 * math.pi / grid.turns)
    # At the middle of the picture the normal is the view, and its azimuth that of the normals beside it.
    theta = grid.angles().clamp_min(1e-6)[:, None].expand(-1, grid.turns)
    normal = from_spherical(theta, azimuth.expand_as(theta)).reshape(-1, 3)
    _, wo = sphere_frames(normal @ axes, axes[2])
    return torch.atan2(wo[:, 1], wo[:, 0]).reshape(theta.shape)


def _turned(w: Tensor, angle: Tensor) -> Tensor:
    """Directions (N, 3) turned about the normal by `angle` (N,)."""
    cos, sin = torch.cos(angle), torch.sin(angle)
    return torch.stack((cos * w[:, 0] - sin * w[:, 1], sin * w[:, 0] + cos * w[:, 1], w[:, 2]), 1)


def _limit(theta: Tensor, turn: Tensor) -> Tensor:
    """θmax (L, S) of `geometry.quadrature` for θo (L,) and φh (S,)."""
    sine, cosine = torch.sin(theta)[:, None], torch.cos(theta)[:, None]
    return (math.pi / 2 + torch.atan2(sine * torch.cos(turn), cosine)) / 2


def _mirrored(theta: Tensor, polar: Tensor, turn: Tensor) -> tuple[Tensor, Tensor]:
    """(ωi, ωo) (L, R, S, 3): ωo at θo (L,), azimuth 0, mirrored at h of polar angles (L, R, S) and azimuths (S,)."""
    h = from_spherical(polar, turn.expand_as(polar))
    wo = from_spherical(theta, torch.zeros_like(theta))[:, None, None].expand_as(h)
    return 2 * (h * wo).sum(-1, keepdim=True) * h - wo, wo


def _window(theta: Tensor) -> Tensor:
    x = ((WINDOW[1] - theta) / (WINDOW[1] - WINDOW[0])).clamp(0, 1)
    return x * x * (3 - 2 * x)


def base_of(material: PatchedMaterial) -> Tensor:
    """Return the base of f under the lobe (A, L, 1, 1, 3): its least value where the window ends."""
    theta, spokes = material.grid.angles(), material.grid.spokes
    turn = (torch.arange(spokes, dtype=torch.float64) + 0.5) * (2 * math.pi / spokes)
    polar = torch.full((len(theta), 1, spokes), WINDOW[1], dtype=torch.float64)
    wi, wo = _mirrored(theta, polar, turn)
    use = wi[..., 2] > 0
    if material.mirrored:
        use[:, :, spokes // 2 :] = False
    values = material.asked(wi, wo, use)
    return torch.where(use[..., None], values, values.new_tensor(math.inf)).amin((2, 3), keepdim=True)


def lobe_of(material: PatchedMaterial, base: Tensor) -> PatchedLobe:
    """Return the patches of (f − base) m, m the window."""
    grid = material.grid
    theta, rings, spokes, finer = grid.angles(), grid.rings, grid.spokes, grid.finer
    fine = rings * finer
    t = (torch.arange(fine, dtype=torch.float64) + 0.5) / fine
    turn = (torch.arange(spokes, dtype=torch.float64) + 0.5) * (2 * math.pi / spokes)
    limit = _limit(theta, turn)[:, None]
    polar = limit * t[:, None] ** 4
    wi, wo = _mirrored(theta, polar, turn)
    cosine = ((1 + (wi * wo).sum(-1)) / 2).clamp_min(0).sqrt()
    solid = 4 * cosine * torch.sin(polar) * limit * 4 * t[:, None] ** 3 * (2 * math.pi / spokes / fine)
    inside = _window(polar)
    use = (inside > 0) & (wi[..., 2] > 0)
    half = spokes // 2
    if material.mirrored:
        use[:, :, half:] = False
    values = material.asked(wi, wo, use)
    if material.mirrored:
        values[..., half:, :] = values[..., :half, :].flip(-2)
    values = torch.where((wi[..., 2] > 0)[..., None], values - base, values)
    flux = values * (solid * inside * wi[..., 2])[..., None]
    shape, core = (len(theta), rings, finer, spokes), rings // _CORE
    flux, solid = flux.reshape(-1, *shape, 3).sum(3), solid.reshape(shape).sum(2)
    middle = wi.reshape(*shape, 3)[:, :, finer // 2]

    def joined(values: Tensor, single: Tensor) -> Tensor:
        """The patches beyond the core, flat, behind the `single` one of the core."""
        return torch.cat((single[:, None], values[:, core:].flatten(1, 2)), 1)

    flux = torch.stack([joined(patches, patches[:, :core].sum((1, 2))) for patches in flux], 1)
    towards = joined(middle, from_spherical(-theta, torch.zeros_like(theta)))
    size = torch.log2(joined(solid, solid[:, :core].sum((1, 2)))) / 2 + _OVERLAP
    # From the frame of the normal, ωo in its xz-plane, to that of the view.
    sine, cosine = torch.sin(theta)[:, None], torch.cos(theta)[:, None]
    x, y, z = towards.unbind(-1)
    turned = torch.stack((z * sine - x * cosine, y, x * sine + z * cosine), -1)
    return PatchedLobe(*(tensor.to(torch.float32).contiguous().numpy() for tensor in (flux, turned, size)))


def rest_of(material: PatchedMaterial, base: Tensor) -> np.ndarray:
    """cosθi (f (1 − m) + base m) (A, L, R, S, 3) at even steps of θh/θmax, both ends included, and of φh."""
    theta, steps = material.grid.angles(), material.grid.rest
    part = torch.linspace(0, 1, steps, dtype=torch.float64)
    turn = torch.arange(steps, dtype=torch.float64) * (2 * math.pi / steps)
    polar = _limit(theta, turn)[:, None] * part[:, None]
    wi, wo = _mirrored(theta, polar, turn)
    inside, cosine = _window(polar)[..., None], wi[..., 2:].clamp_min(0)
    use = ((1 - inside) * cosine)[..., 0] > 1e-9
    half = steps // 2
    if material.mirrored:
        use[:, :, half + 1 :] = False
    values = material.asked(wi, wo, use)
    if material.mirrored:
        values[..., half + 1 :, :] = values[..., 1:half, :].flip(-2)
    return (cosine * (values * (1 - inside) + base * inside)).to(torch.float32).numpy()
