"""BRDF tables with one grid per angle of incidence, as optical design programs exchange them.

The axes of a grid are a polar angle and an azimuth of the viewer, counted from the normal or from the mirror direction.
Values are bilinear within a grid and constant beyond its last polar angle. Between two incidences, both tables are read
at the same position relative to the mirror direction, and their values are interpolated linearly in θi. So a highlight
moves with the mirror direction instead of fading from one place to another. If this position is below the horizon in
one table, that table is ignored. Beyond the first and last incidence, the nearest table is read in the same way.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
import torch
from torch import Tensor

from homofact.brdf.in_kind import answering_in_kind
from homofact.brdf.table import TableAxis
from homofact.errors import BadInput
from homofact.geometry.directions import from_spherical, to_spherical

# Points of the Gauss-Legendre rule between two polar angles of a grid.
_POINTS = 6
_SLACK = 1e-9


@dataclass(frozen=True)
class IncidenceTable:
    """The grid of one incidence.

    Attributes
    ----------
    theta_i, turn : angle of incidence and azimuth of the light in radians.
    polar : (P,) rising angles in radians from the normal or the mirror direction.
    azimuth : (A,) rising angles in radians: a whole turn, with or without its end, or half of it where the grid is
        mirrored at the plane of incidence. About the normal, 0 is the side of the mirror direction; about the mirror
        direction, 0 is the side of the normal.
    values : (P, A, C) in sr⁻¹ without the cosine.

    Raises BadInput if shapes disagree, if angles do not increase, or if the azimuths cover neither a whole turn nor
    half a turn.
    """

    theta_i: float
    turn: float
    polar: Tensor
    azimuth: Tensor
    values: Tensor

    def __post_init__(self) -> None:
        """Refuse what cannot be interpolated."""
        for name, angles in (("polar angles", self.polar), ("azimuths", self.azimuth)):
            if angles.ndim != 1 or not len(angles) or bool((angles.diff() <= 0).any()):
                raise BadInput(f"{name} do not rise", expected="rising angles")
        if tuple(self.values.shape[:2]) != (len(self.polar), len(self.azimuth)):
            raise BadInput(
                f"{tuple(self.values.shape[:2])} values", expected=f"({len(self.polar)}, {len(self.azimuth)})"
            )
        span = float(self.azimuth[-1] - self.azimuth[0])
        widest = float(self.azimuth.diff().max()) if len(self.azimuth) > 1 else 0.0
        if not self.mirrored and not 2 * math.pi - 1.5 * widest - _SLACK <= span <= 2 * math.pi + 1e-6:
            raise BadInput(f"azimuths over {math.degrees(span):g} degrees", expected="180 or 360")

    @property
    def mirrored(self) -> bool:
        """Whether the azimuths cover half a turn from 0."""
        return (
            len(self.azimuth) > 1
            and abs(float(self.azimuth[0])) < 1e-6
            and abs(float(self.azimuth[-1]) - math.pi) < 1e-6
        )

    @cached_property
    def _axes(self) -> tuple[TableAxis, TableAxis]:
        closed = float(self.azimuth[-1] - self.azimuth[0]) > 2 * math.pi - 1e-6
        return TableAxis(self.polar), TableAxis(self.azimuth, periodic=not (closed or self.mirrored))

    def at(self, polar: Tensor, azimuth: Tensor) -> Tensor:
        """Return values (N, C) at angles (N,) in radians; azimuths may be outside [0, 2π)."""
        if self.mirrored:
            azimuth = (torch.remainder(azimuth + math.pi, 2 * math.pi) - math.pi).abs()
        else:
            azimuth = torch.remainder(azimuth - self.azimuth[0], 2 * math.pi) + self.azimuth[0]
        (low, high, across), (left, right, along) = (
            axis.locate(angle) for axis, angle in zip(self._axes, (polar, azimuth), strict=True)
        )
        across, along = across[:, None], along[:, None]
        near = self.values[low, left] * (1 - along) + self.values[low, right] * along
        far = self.values[high, left] * (1 - along) + self.values[high, right] * along
        return near * (1 - across) + far * across


@dataclass(frozen=True)
class IncidenceTables:
    """A `Reflectance` of tables by incidence; see the module's head.

    Attributes
    ----------
    tables : for each azimuth of the light (one where the material is isotropic) the tables by rising θi.
    about_mirror : whether the grids are about the mirror direction.
    channels : names of the C channels.

    Raises BadInput for no tables, azimuths of the light or incidences that do not rise, and another number of channels.
    """

    tables: tuple[tuple[IncidenceTable, ...], ...]
    about_mirror: bool
    channels: tuple[str, ...]

    def __post_init__(self) -> None:
        """Refuse what has no order."""
        if not self.tables or not all(self.tables):
            raise BadInput("no incidence", expected="at least one")
        turns = [row[0].turn for row in self.tables]
        if any(after <= before for before, after in pairwise(turns)):
            raise BadInput("rotations of the sample do not rise", expected="rising angles")
        for row in self.tables:
            angles = [table.theta_i for table in row]
            if any(after <= before for before, after in pairwise(angles)):
                raise BadInput("angles of incidence do not rise", expected="rising angles")
            if any(table.values.shape[2] != len(self.channels) for table in row):
                raise BadInput("tables with other channels", expected=", ".join(self.channels))

    @property
    def isotropic(self) -> bool:
        """Whether there is one azimuth of the light."""
        return len(self.tables) == 1

    @property
    def nbytes(self) -> int:
        """Bytes of all values and angles."""
        every = [table for row in self.tables for table in row]
        return sum(x.nbytes for each in every for x in (each.polar, each.azimuth, each.values))

    @property
    def fetches(self) -> int:
        """Nodes read for one value: four in each of two tables, and twice as many if there are several rotations."""
        return 8 if self.isotropic else 16

    @answering_in_kind
    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Return BRDF values (N, C) in sr⁻¹, without the cosine; 0 where a direction is under the horizon."""
        total = torch.zeros(len(wi), len(self.channels), dtype=torch.float64)
        above = ((wi[:, 2] >= 0) & (wo[:, 2] >= 0)).nonzero()[:, 0]
        light, view = wi[above].double(), wo[above].double()
        theta, phi = to_spherical(light)
        # The plane of incidence becomes that of x and z, with the mirror direction on the side of x.
        cos, sin = torch.cos(phi + math.pi), torch.sin(phi + math.pi)
        turned = torch.stack((cos * view[:, 0] + sin * view[:, 1], cos * view[:, 1] - sin * view[:, 0], view[:, 2]), 1)
        if self.isotropic:
            found = self._of_rotation(0, theta, turned)
        else:
            rotations = TableAxis(torch.tensor([row[0].turn for row in self.tables], dtype=torch.float64), True)
            low, high, share = rotations.locate(phi)
            found = torch.zeros(len(theta), len(self.channels), dtype=torch.float64)
            for k in range(len(self.tables)):
                part = torch.where(low == k, 1 - share, 0.0) + torch.where(high == k, share, 0.0)
                rows = (part > 0).nonzero()[:, 0]
                found[rows] += part[rows, None] * self._of_rotation(k, theta[rows], turned[rows])
        total[above] = found
        return total.to(wi)

    def _of_rotation(self, index: int, theta: Tensor, view: Tensor) -> Tensor:
        """Values (N, C) for θi (N,) and views (N, 3) in the plane of incidence's frame."""
        row = self.tables[index]
        low, high, share = TableAxis(torch.tensor([table.theta_i for table in row], dtype=torch.float64)).locate(theta)
        x = torch.cos(theta) * view[:, 0] - torch.sin(theta) * view[:, 2]
        z = torch.sin(theta) * view[:, 0] + torch.cos(theta) * view[:, 2]
        about = torch.stack((x, view[:, 1], z), 1)
        total = torch.zeros(len(theta), len(self.channels), dtype=torch.float64)
        seen, weight, hidden = torch.zeros_like(theta), torch.zeros_like(theta), torch.zeros_like(total)
        for k, table in enumerate(row):
            part = torch.where(low == k, 1 - share, 0.0) + torch.where((high == k) & (high != low), share, 0.0)
            part = torch.where((low == k) & (high == k), 1.0, part)
            rows = (part > 0).nonzero()[:, 0]
            values, above = self._in_table(table, about[rows])
            total[rows] += (part[rows] * above)[:, None] * values
            seen[rows] += part[rows] * above
            weight[rows] += part[rows]
            hidden[rows] += part[rows, None] * values
        return torch.where(seen[:, None] > 0, total / seen.clamp_min(1e-300)[:, None], hidden / weight[:, None])

    def _in_table(self, table: IncidenceTable, about: Tensor) -> tuple[Tensor, Tensor]:
        """(values (N, C), whether above the horizon (N,)) of views (N, 3) in the mirror direction's frame."""
        cos, sin = math.cos(table.theta_i), math.sin(table.theta_i)
        x, y, z = about.unbind(1)
        height = cos * z - sin * x
        if self.about_mirror:
            polar, azimuth = to_spherical(torch.stack((-x, -y, z), 1))
        else:
            polar, azimuth = to_spherical(torch.stack((cos * x + sin * z, y, height), 1))
            polar = polar.clamp_max(math.pi / 2)
        return table.at(polar, azimuth), (height >= -_SLACK).double()

    def nodes(self) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """Return (wi, wo, values, weights) of the grids' nodes above the horizon: (N, 3), (N, 3), (N, C), (N,).

        Weights are products of the solid angles of light and viewer, scaled to mean 1. All nodes at polar angle 0 have
        the same direction, so only one of them is returned.
        """
        parts = [self._nodes(table, share) for row in self.tables for table, share in _shares(row)]
        wi, wo, values, weights = (torch.cat(each) for each in zip(*parts, strict=True))
        return wi, wo, values, weights / weights.mean()

    def _nodes(self, table: IncidenceTable, share: float) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        wo, polar = directions(table, self.about_mirror), table.polar.repeat_interleave(len(table.azimuth))
        first = torch.zeros(len(table.polar), len(table.azimuth), dtype=torch.bool)
        first[:, 0] = True
        closing = torch.zeros_like(first)
        closing[:, -1] = float(table.azimuth[-1] - table.azimuth[0]) > 2 * math.pi - 1e-6
        keep = (wo[:, 2] >= -_SLACK) & ((polar > 0) | first.reshape(-1)) & ~closing.reshape(-1)
        rings = _bands(table.polar) / (len(table.azimuth) - int(closing.any()))
        weights = torch.where(polar > 0, rings.repeat_interleave(len(table.azimuth)), float(_bands(table.polar)[0]))
        wo = wo[keep]
        wo = torch.cat((wo[:, :2], wo[:, 2:].clamp_min(0)), 1)
        wi = from_spherical(
            torch.tensor(table.theta_i, dtype=torch.float64), torch.tensor(table.turn, dtype=torch.float64)
        )
        wi = torch.cat((wi[:2], wi[2:].clamp_min(0)))
        values = table.values.reshape(-1, len(self.channels))[keep]
        return (
            wi.expand(len(wo), 3),
            wo / wo.norm(dim=1, keepdim=True),
            values,
            share * weights[keep].clamp_min(1e-12),
        )


def directions(table: IncidenceTable, about_mirror: bool) -> Tensor:
    """Return the viewer's directions (P · A, 3) at all nodes of a grid in the surface frame, also below the horizon."""
    polar, azimuth = (x.reshape(-1) for x in torch.meshgrid(table.polar, table.azimuth, indexing="ij"))
    x, y, z = from_spherical(polar, azimuth).unbind(1)
    if about_mirror:
        cos, sin = math.cos(table.theta_i), math.sin(table.theta_i)
        x, y, z = sin * z - cos * x, -y, cos * z + sin * x
    # From the frame of the plane of incidence, whose x is on the mirror direction's side, to the surface's.
    cos, sin = math.cos(table.turn + math.pi), math.sin(table.turn + math.pi)
    return torch.stack((cos * x - sin * y, sin * x + cos * y, z), 1)


def reflected(table: IncidenceTable) -> Tensor:
    """Return ∫ f cosθo dωo (C,) of a grid about the normal, constant beyond its last polar angle."""
    edges = table.polar.double().clamp(0, math.pi / 2)
    edges = torch.cat((edges.new_zeros(1), edges, edges.new_full((1,), math.pi / 2))).unique()
    nodes, weights = (torch.from_numpy(x) for x in np.polynomial.legendre.leggauss(_POINTS))
    low, width = edges[:-1, None], edges.diff()[:, None]
    theta = (low + width * (nodes + 1) / 2).reshape(-1).double()
    weight = (width * weights / 2).reshape(-1).double() * torch.sin(theta) * torch.cos(theta)
    azimuth = table.azimuth.double()
    gaps = azimuth.diff()
    if table.mirrored:
        shares = 2 * _trapezoid(gaps)
    elif float(azimuth[-1] - azimuth[0]) > 2 * math.pi - 1e-6:
        shares = _trapezoid(gaps)
    else:
        around = torch.cat((gaps, (2 * math.pi - gaps.sum())[None]))
        shares = (around + around.roll(1)) / 2
    low_node, high_node, share = TableAxis(table.polar.double()).locate(theta)
    rings = table.values[low_node] * (1 - share)[:, None, None] + table.values[high_node] * share[:, None, None]
    return torch.einsum("t,a,tac->c", weight, shares, rings)


def _trapezoid(gaps: Tensor) -> Tensor:
    zero = torch.zeros(1, dtype=gaps.dtype)
    return (torch.cat((gaps, zero)) + torch.cat((zero, gaps))) / 2


def _bands(angles: Tensor) -> Tensor:
    """Solid angle over 2π of the ring round each polar angle (n,), bounded halfway between them, up to π."""
    if len(angles) == 1:
        return torch.ones_like(angles)
    middle = (angles[1:] + angles[:-1]) / 2
    last = (2 * angles[-1] - middle[-1]).clamp_max(math.pi)
    edges = torch.cat((torch.zeros(1, dtype=angles.dtype), middle, last[None]))
    return torch.cos(edges[:-1]) - torch.cos(edges[1:])


def _shares(row: tuple[IncidenceTable, ...]) -> list[tuple[IncidenceTable, float]]:
    angles = torch.tensor([table.theta_i for table in row], dtype=torch.float64)
    return list(zip(row, _bands(angles).clamp_min(1e-6).tolist(), strict=True))
