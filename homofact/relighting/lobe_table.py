"""A material's lobe as a table, separate from the rest of it: f = lobe + rest, where the rest needs few in-out factors.

A sharp lobe needs hundreds of in-out factors. What is left without it is smooth. The lobe is

    lobe(ωi, ωo) = T(θo, φo, s)/(cosθi cosθo),    s = (hx, hy)/hz,    h = ωi + ωo,

with h turned so that the viewer's azimuth is 0: T is linear between the nodes of a grid (`slope_grid`). In terms of the
half vector, highlights stay in place for all θo, so a few nodes of θo suffice. The nodes are densest near the horizon,
θ = STEEPEST (1 − (1 − t)^1.5) at even t; views beyond STEEPEST are raised to it. An isotropic material has one φo.

T is (f − b) cosθi cosθo, where b is the least f for this ωo. The base b stays in the rest. The two cosines cancel the
growth of f towards the horizon. Below the horizon T is 0. The node values are fitted for linear interpolation.

The rest is f − lobe, so that lobe and rest always add up to f. What the grid misses is part of the rest, and the in-out
factors approximate the rest.

For suns, tables represent all of f (`sun_tables`): the table of the lobe, and a table of the rest on a broad grid. The
latter stores f cosθo without cosθi, because a broad grid would smooth the kink of cosθi at the horizon. Below the
horizon it continues f.
"""

import math
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
import torch
from torch import Tensor

from homofact.brdf.in_kind import answering_in_kind
from homofact.brdf.reflectance import Derived, Reflectance
from homofact.brdf.symmetry import find_symmetry
from homofact.brdf.tinted import Tinted
from homofact.geometry.directions import from_spherical
from homofact.relighting.slope_grid import fitted, node_slopes, places_of

STEEPEST = math.radians(89.7)
CROWDING = 1.5  # of the nodes of θo towards the horizon: 1 is even
# Nodes of θo, along the slope and around it; with several φo, which make a table large, of a whole circle.
SIZE = (56, 96, 44)
TURNS, TURNED_SIZE = 24, (40, 36, 47)
_WIDTHS = 3.0  # w, in widths of the lobe at half height
_BROAD = 0.5  # a grid of a larger width holds what is not of the lobe too
# Tables of all of a material: their sizes, and what one may err by at pairs of directions up to this angle.
_SIZES, _SMALL, _NEARLY = ((6, 7, 7), (12, 13, 13), (20, 21, 21), (40, 41, 41)), 0.01, 1.2
_PAIRS, _ASKED = 2000, math.radians(85)
_HORIZON = 0.02  # the least cosθi at which f is asked for a broad grid
_BASE_COSINE = 0.2  # the least f is looked for at larger cosθi
_SLOPES = torch.logspace(-3, 0.5, 400, dtype=torch.float64)
_HALF_VIEW, _HALF_AZIMUTHS = 0.5, 8


@dataclass(frozen=True)
class LobeTable:
    """T as `values` (levels, turns, along, around, 3) float32 in sr⁻¹; `width` is w; φo has the `period` in radians.

    The axis around covers a `whole` circle, or half a circle for a lobe that is symmetric about the plane of incidence.
    `cosine` is true if T includes cosθi. `tinted` (levels, 3) float32 is the part of each channel that the base colour
    of a texture multiplies, linear between the nodes of θo; None without a texture. The table is a `Reflectance` of
    three channels: the lobe.
    """

    values: np.ndarray
    width: float
    period: float
    whole: bool
    channels: tuple[str, ...] = ("R", "G", "B")
    cosine: bool = True
    tinted: np.ndarray | None = None

    @property
    def turns(self) -> int:
        """Return the number of nodes of φo."""
        return self.values.shape[1]

    @property
    def nbytes(self) -> int:
        """Bytes of the table."""
        return self.values.nbytes

    @property
    def fetches(self) -> int:
        """Return the bilinear lookups: at two θo, and for an anisotropic material at two φo each."""
        return 2 if self.turns == 1 else 4

    @property
    def half_width(self) -> float:
        """Return the slope of the half vector at which the lobe has half of its height."""
        return self.width / _WIDTHS

    @property
    def in_parts(self) -> Reflectance:
        """The table as a reflectance: in two parts where there is a texture."""
        return self if self.tinted is None else Tinted(self.times(self.tinted), self.times(1 - self.tinted))

    def times(self, parts: np.ndarray) -> "LobeTable":
        """Return the table with its channels multiplied by numbers (levels, 3), without `tinted`."""
        return replace(self, values=self.values * parts[:, None, None, None].astype(np.float32), tinted=None)

    def under(self, tint: np.ndarray, wo: np.ndarray) -> np.ndarray:
        """Return the factors (S, 3) of the table's light towards views (S, 3), at points with tints (S, 3)."""
        if self.tinted is None:
            return np.ones_like(tint)
        levels = len(self.tinted)
        level = _level_of(torch.acos(torch.from_numpy(wo[:, 2]).double().clamp(0, 1)), levels).clamp(0, levels - 1)
        at, nodes = level.numpy(), np.arange(levels)
        part = np.stack([np.interp(at, nodes, self.tinted[:, c]) for c in range(3)], 1)
        return 1 + part * (tint - 1)

    def record(self) -> dict[str, Any]:
        """Return the JSON form of all fields except `values`."""
        tinted = None if self.tinted is None else self.tinted.tolist()
        numbers = {"width": self.width, "period": self.period, "whole": self.whole, "cosine": self.cosine}
        return {**numbers, "tinted": tinted}

    @answering_in_kind
    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Values (N, 3) of the lobe in sr⁻¹, without the cosine; 0 under the horizon."""
        shown = (wi[:, 2] > 0) & (wo[:, 2] > 0)
        wi, wo = wi.double(), _raised(wo.double())
        levels, turns, *nodes = self.values.shape[:4]
        rows = torch.from_numpy(self.values).reshape(-1, 3)
        level = _level_of(torch.acos(wo[:, 2].clamp(0, 1)), levels).clamp(0, levels - 1)
        low = level.long().clamp_max(levels - 2)
        across = wo[:, :2].norm(dim=1)
        c = torch.where(across > 1e-9, wo[:, 0] / across, 1.0)
        s = torch.where(across > 1e-9, wo[:, 1] / across, 0.0)
        h = wi + wo
        slope = h[:, :2] / h[:, 2:].clamp_min(1e-9)
        slope = torch.stack((c * slope[:, 0] + s * slope[:, 1], c * slope[:, 1] - s * slope[:, 0]), 1)
        at = [place * (n - 1) for place, n in zip(places_of(slope, self.width, self.whole), nodes, strict=True)]
        i, j = (each.long().clamp_max(n - 2) for each, n in zip(at, nodes, strict=True))
        x, y = at[0] - i, at[1] - j
        turn = (torch.atan2(wo[:, 1], wo[:, 0]) / self.period % 1) * turns
        first, over, up = turn.long() % turns, turn - turn.long(), level - low
        # Of one turn, both neighbours are the same.
        around = ((first, 1 - over), ((first + 1) % turns, over)) if turns > 1 else ((0 * first, torch.ones_like(up)),)
        found = torch.zeros(len(wi), 3, dtype=torch.float64)
        for k, share in around:
            for above in (0, 1):
                own = share * (up if above else 1 - up)
                corner = (((low + above) * turns + k) * nodes[0] + i) * nodes[1] + j
                for a in (0, 1):
                    for b in (0, 1):
                        w = own * (x if a else 1 - x) * (y if b else 1 - y)
                        # By one index: torch gathers rows by four much slower.
                        found += w[:, None] * rows.index_select(0, corner + (nodes[1] * a + b))
        found /= wo[:, 2:] * (wi[:, 2:].clamp_min(1e-3) if self.cosine else 1.0)
        return torch.where(shown[:, None], found, 0.0)


@dataclass(frozen=True)
class Rest(Derived):
    """A reflectance minus its `lobe`, in three channels."""

    lobe: LobeTable

    @property
    def channels(self) -> tuple[str, ...]:
        """Return the channels of the lobe."""
        return self.lobe.channels

    @answering_in_kind
    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Values (N, 3) in sr⁻¹ without the cosine, below 0 too."""
        return self.base.evaluate(wi, wo).double().expand(-1, 3) - self.lobe.evaluate(wi, wo)


def without_lobe(reflectance: Reflectance, lobe: LobeTable) -> Reflectance:
    """Return a reflectance minus a lobe; for a textured material, each part minus its part of the lobe."""
    if not isinstance(reflectance, Tinted):
        return Rest(reflectance, lobe)
    assert lobe.tinted is not None
    of_tinted, of_plain = lobe.times(lobe.tinted), lobe.times(1 - lobe.tinted)
    return Tinted(Rest(reflectance.tinted, of_tinted), Rest(reflectance.plain, of_plain))


def lobe_table(reflectance: Reflectance) -> LobeTable:
    """The lobe of a reflectance of 1 or 3 channels."""
    table = _tabulated(reflectance, _WIDTHS * half_width(reflectance), lobe=True)
    return (
        replace(table, tinted=_tinted_parts(reflectance, len(table.values)))
        if isinstance(reflectance, Tinted)
        else table
    )


def sun_tables(reflectance: Reflectance, lobe: LobeTable | None = None) -> tuple[LobeTable, ...]:
    """Return tables that add up to a reflectance of 1 or 3 channels: one, or two if it has a sharp lobe.

    A material with a texture has one more, since each of its parts has its own table. `lobe` is its lobe, if known.
    """
    broad = lobe is None and _WIDTHS * half_width(reflectance) > _BROAD
    if not broad and lobe is None:
        lobe = lobe_table(reflectance)
    rest = reflectance if lobe is None else without_lobe(reflectance, lobe)
    parts = [(rest.tinted, 1.0), (rest.plain, 0.0)] if isinstance(rest, Tinted) else [(rest, 0.0)]
    if lobe is None:
        made = [(_small_table(part, _WIDTHS * half_width(part)), tinted) for part, tinted in parts]
    else:
        # As fine as the lobe's: what that misses between its nodes would fill the cells of a coarser grid.
        made = [(_tabulated(part, _WIDTHS, lobe=False), tinted) for part, tinted in parts]
    if isinstance(rest, Tinted):
        made = [(replace(each, tinted=np.full((len(each.values), 3), part, np.float32)), part) for each, part in made]
    return (*(() if lobe is None else (lobe,)), *(each for each, _ in made))


def _small_table(reflectance: Reflectance, width: float) -> LobeTable:
    """Return the smallest table of a smooth reflectance with error `_SMALL`, or nearly that of the largest."""
    angles = torch.rand(4, _PAIRS, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    wi, wo = (from_spherical(_ASKED * angles[k], 2 * math.pi * angles[k + 2]) for k in (0, 1))
    cosines = (wi[:, 2] * wo[:, 2])[:, None]
    exact = reflectance.evaluate(wi, wo).double() * cosines
    found: list[tuple[float, LobeTable]] = []
    for size in _SIZES:
        table = _tabulated(reflectance, width, False, size)
        found.append((float((table.evaluate(wi, wo) * cosines - exact).norm() / exact.norm()), table))
        if found[-1][0] <= _SMALL:
            return table
    return next(table for error, table in found if error <= _NEARLY * found[-1][0])


def _tabulated(
    reflectance: Reflectance, width: float, lobe: bool, size: tuple[int, int, int] | None = None
) -> LobeTable:
    """Tabulate T on the grid of a width: the `lobe` minus the least f, or all of f without cosθi."""
    symmetry = find_symmetry(reflectance)
    turns, whole = 1 if symmetry.isotropic else TURNS, not (symmetry.isotropic and symmetry.mirrored)
    levels, along, around = (SIZE if turns == 1 else TURNED_SIZE) if size is None else size
    if whole and turns == 1:
        around = 2 * around - 1
    period = math.pi if symmetry.half_turn and turns > 1 else 2 * math.pi
    slope = node_slopes(along, around, width, whole)
    theta = _angles(levels)
    values = torch.zeros(levels, turns, along, around, 3, dtype=torch.float64)
    for level, angle in enumerate(theta.tolist()):
        wo = from_spherical(*torch.tensor([angle, 0.0], dtype=torch.float64))
        wi = _mirrored(slope, wo).reshape(-1, 3)
        if not lobe:
            wi = _raised(wi, _HORIZON)
        cosine = wi[:, 2].clamp_min(0).reshape(along, around) if lobe else torch.ones(along, around).double()
        for turn in range(turns):
            phi = turn * period / turns
            asked = [_turned(w, phi) for w in (wi, wo.expand(len(wi), 3))]
            f = reflectance.evaluate(*asked).double().expand(-1, 3)
            least = f[wi[:, 2] > _BASE_COSINE].amin(0) if lobe else 0.0
            values[level, turn] = (f - least).reshape(along, around, 3) * (cosine * wo[2])[..., None]
    held = fitted(values, whole).float().numpy()
    return LobeTable(held, width, period, whole, _channels(reflectance), cosine=lobe)


def half_width(reflectance: Reflectance) -> float:
    """Return the least |s| over 8 azimuths where the lobe, seen from 29°, is half as high above the least f."""
    wo = from_spherical(*torch.tensor([_HALF_VIEW, 0.0], dtype=torch.float64))[None]
    found = []
    for k in range(_HALF_AZIMUTHS):
        turn = 2 * math.pi * k / _HALF_AZIMUTHS
        slope = _SLOPES[:, None] * torch.tensor([math.cos(turn), math.sin(turn)], dtype=torch.float64)
        wi = _mirrored(slope, wo[0])
        f = reflectance.evaluate(wi, wo.expand_as(wi)).double().mean(1)[wi[:, 2] > 0.1]
        below = (f - f.min() < (f[0] - f.min()) / 2).nonzero()
        found.append(float(_SLOPES[int(below[0, 0])]) if len(below) else 1.0)
    return min(found)


def _tinted_parts(reflectance: Tinted, levels: int) -> np.ndarray:
    """Return the tinted part's share (levels, 3) of the lobe's height above the least f, per node of θo."""
    found = np.zeros((levels, 3), np.float32)
    for level, theta in enumerate(_angles(levels).tolist()):
        wo = from_spherical(*torch.tensor([theta, 0.0], dtype=torch.float64))
        # Across the plane of incidence, where the light stays above the horizon longest.
        wi = _mirrored(_SLOPES[:, None] * torch.tensor([0.0, 1.0], dtype=torch.float64), wo)
        wi = wi[wi[:, 2] > 0]
        heights = []
        for part in (reflectance.tinted, reflectance.plain):
            f = part.evaluate(wi, wo.expand_as(wi)).double().expand(-1, 3)
            heights.append((f[0] - f.amin(0)).clamp_min(0))
        found[level] = (heights[0] / (heights[0] + heights[1]).clamp_min(1e-300)).numpy()
    return found


def _angles(levels: int) -> Tensor:
    """Return θo of the nodes, in radians."""
    return STEEPEST * (1 - (1 - torch.linspace(0, 1, levels, dtype=torch.float64)) ** CROWDING)


def _level_of(theta: Tensor, levels: int) -> Tensor:
    return (1 - (1 - theta / STEEPEST).clamp_min(0) ** (1 / CROWDING)) * (levels - 1)


def _raised(w: Tensor, least: float = math.cos(STEEPEST)) -> Tensor:
    """Return directions (N, 3) with cosines of at least `least`, raising lower ones."""
    z = w[:, 2:].clamp_min(least)
    across = w[:, :2].norm(dim=1, keepdim=True)
    return torch.cat((w[:, :2] * ((1 - z**2).sqrt() / across.clamp_min(1e-12)).clamp_max(1e6), z), 1)


def _mirrored(slope: Tensor, wo: Tensor) -> Tensor:
    """Return ωi (..., 3), the mirror images of ωo (3,) about half vectors with the slopes (..., 2)."""
    h = torch.cat((slope, torch.ones_like(slope[..., :1])), -1)
    h = h / h.norm(dim=-1, keepdim=True)
    return 2 * (h @ wo)[..., None] * h - wo


def _turned(w: Tensor, phi: float) -> Tensor:
    c, s = math.cos(phi), math.sin(phi)
    return torch.stack((c * w[:, 0] - s * w[:, 1], s * w[:, 0] + c * w[:, 1], w[:, 2]), 1)


def _channels(reflectance: Reflectance) -> tuple[str, ...]:
    names = tuple(reflectance.channels)
    return cast("tuple[str, ...]", names * 3 if len(names) == 1 else names)
