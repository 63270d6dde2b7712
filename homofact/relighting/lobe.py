"""The light of a lobe that is separate from an object's in-out factors, summed at visible points per view.

Only the visibility of each vertex is precomputed, so a change of light costs nothing. For every view, homofact sums the
cells of the sky that the lobe reaches (`lobe_kernels`): some hundreds per vertex, independent of the lobe's width.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from homofact.errors import BadInput
from homofact.meshes.mesh import Mesh
from homofact.meshes.occlusion import Occluder
from homofact.relighting.lobe_kernels import CellArrays, HalfSeenCells, PointArrays, TableArrays, sum_lobe
from homofact.relighting.lobe_light import LightCells
from homofact.relighting.lobe_table import LobeTable
from homofact.relighting.sight import VertexSight, kept_sight
from homofact.relighting.texel_pattern import texel_divisions

# Cells of a point that its corners see differently: those that rays are sent to at most, and the least light of one as
# a part of the mean of all points. So many points at a time.
_CELLS, _LEAST, _POINTS = 512, 1e-3, 2048


@dataclass(frozen=True)
class SurfacePoints:
    """Points between vertices: `frames` (S, 3, 3), rows tangent, binormal, normal, and the view `wo` (S, 3) in them.

    Each point interpolates the vertices `corners` (S, 3) with the weights `shares` (S, 3). If a normal map tilts the
    frames, `horizon` (S, 3) are the surface's own normals; no light arrives from below their horizon.
    """

    frames: np.ndarray
    wo: np.ndarray
    corners: np.ndarray
    shares: np.ndarray
    horizon: np.ndarray | None = None

    @classmethod
    def at_vertices(cls, frames: np.ndarray, wo: np.ndarray, which: np.ndarray) -> "SurfacePoints":
        """The vertices `which` (S,) themselves."""
        corners = np.repeat(which[:, None], 3, 1)
        return cls(frames, wo, corners, np.broadcast_to(np.array([1.0, 0.0, 0.0]), corners.shape))

    @classmethod
    def all_vertices(
        cls, positions: np.ndarray, frames: np.ndarray, eye: Sequence[float] | np.ndarray
    ) -> "SurfacePoints":
        """All vertices, with their `frames` (V, 3, 3), seen from a point `eye` (3,). Raises BadInput for no point."""
        towards = checked_eye(eye) - positions
        towards /= np.linalg.norm(towards, axis=1, keepdims=True)
        return cls.at_vertices(frames, np.einsum("vij,vj->vi", frames, towards), np.arange(len(positions)))

    def only(self, which: np.ndarray) -> "SurfacePoints":
        """Return the points with these indices."""
        horizon = None if self.horizon is None else self.horizon[which]
        return SurfacePoints(self.frames[which], self.wo[which], self.corners[which], self.shares[which], horizon)

    @property
    def normals(self) -> np.ndarray:
        """Return the surface's own normals (S, 3), without the normal map."""
        return self.frames[:, 2] if self.horizon is None else self.horizon

    @property
    def views(self) -> np.ndarray:
        """Unit directions (S, 3) towards the viewer, in the world."""
        return np.einsum("sij,si->sj", self.frames, self.wo)

    def mixed(self, values: np.ndarray) -> np.ndarray:
        """Interpolate values (V, C) of the vertices at the points: (S, C)."""
        return (values[self.corners] * self.shares[..., None]).sum(1)

    def of_facing(self, facing: np.ndarray) -> "SurfacePoints":
        """Return the points with weights only at the corners that face the viewer, if any does.

        `facing` (V,) marks these vertices. A vertex that faces away has radiance 0 and would darken the outline.
        """
        return replace(self, shares=facing_shares(self.shares, facing[self.corners]))


def facing_shares(shares: np.ndarray, facing: np.ndarray) -> np.ndarray:
    """Shares (S, 3) of the corners that face the viewer (S, 3), their sum 1; unchanged where none does."""
    own = shares * facing
    total = own.sum(1, keepdims=True)
    return np.where(total > 0, own / np.where(total > 0, total, 1.0), shares)


@dataclass(frozen=True)
class PointSight:
    """What hides the sky from points: rays start at their `origins` (S, 3) and meet the meshes of the `occluder`."""

    origins: np.ndarray
    occluder: Occluder

    def only(self, which: np.ndarray) -> "PointSight":
        """Return the same for the points with these indices."""
        return PointSight(self.origins[which], self.occluder)

    def sees(self, which: np.ndarray, directions: np.ndarray, lengths: np.ndarray | None = None) -> np.ndarray:
        """Return whether rays from points `which` (R,) in `directions` (R, 3) are free up to `lengths` (R,)."""
        return ~self.occluder.blocked(self.origins[which], directions, lengths)


@dataclass(frozen=True)
class SeparateLobe:
    """A lobe, and the visibility of the sky (`sight`) at every vertex."""

    table: LobeTable
    sight: VertexSight

    @classmethod
    def traced(
        cls,
        table: LobeTable | None,
        mesh: Mesh,
        occluder: Occluder,
        size: int,
        folder: Path | None,
        progress: Callable[[int, int], object] | None = None,
    ) -> "SeparateLobe | None":
        """Trace the visibility for a lobe on a mesh, for cube maps of `size` texels; None without a `table`.

        `folder` keeps what the vertices see for a later run; `progress` is called with (blocks done, blocks). Raises
        BadInput for a damaged file there.
        """
        if table is None:
            return None
        return cls(table, VertexSight.of(kept_sight(mesh, occluder, size, folder, progress)))

    @property
    def nbytes(self) -> int:
        """The table and what the vertices see."""
        return self.table.nbytes + self.sight.nbytes

    def cells(self, radiance: np.ndarray) -> LightCells:
        """Return the cells of a cube map of radiance (6, n, n, 3), divided as finely as the lobe needs."""
        return LightCells.of(radiance, texel_divisions(self.table.half_width, radiance.shape[1]))

    def at(self, points: SurfacePoints, cells: LightCells, sight: "PointSight | None" = None) -> np.ndarray:
        """Radiance (S, 3) float32 of the lobe towards the viewer; 0 where a point is seen from behind.

        The visibility at a point is interpolated from its corners. With `sight`, rays test the cells that the corners
        see to different degrees, so that mirrored shadows end sharply between vertices.
        """
        out = self._summed(points, cells, HalfSeenCells.room(len(points.frames), 0))
        if sight is None or not len(out):
            return out
        least = _LEAST * float(np.abs(out).mean())
        between = np.flatnonzero(points.shares.max(1) < 1)
        for first in range(0, len(between), _POINTS):
            which = between[first : first + _POINTS]
            half_seen = HalfSeenCells.room(len(which), _CELLS, least)
            self._summed(points.only(which), cells, half_seen)
            row, place = np.nonzero(np.arange(_CELLS) < half_seen.found[:, None])
            towards = cells.directions(half_seen.cells[row, place])
            clear = sight.only(which).sees(row, towards)
            more = (clear - half_seen.seen[row, place])[:, None] * half_seen.light[row, place]
            np.add.at(out, which[row], more)
        return out

    def _summed(self, points: SurfacePoints, cells: LightCells, half_seen: HalfSeenCells) -> np.ndarray:
        out = np.zeros((len(points.frames), 3), np.float32)
        given = PointArrays(
            np.ascontiguousarray(points.frames, np.float32), np.ascontiguousarray(points.wo, np.float32),
            np.ascontiguousarray(points.corners, np.int64), np.ascontiguousarray(points.shares, np.float32),
        )  # fmt: skip
        table = TableArrays(self.table.values, self.table.width, self.table.period, self.table.whole)
        given_light = CellArrays(cells.light, cells.places, cells.parts, cells.starts, cells.divisions)
        sum_lobe(given, self.sight.arrays, given_light, table, out, half_seen)
        return out

    def at_vertices(
        self, positions: np.ndarray, frames: np.ndarray, eye: Sequence[float] | np.ndarray, cells: LightCells
    ) -> np.ndarray:
        """Radiance (V, 3) float32 of all vertices towards a point `eye` (3,). Raises BadInput for no point."""
        return self.at(SurfacePoints.all_vertices(positions, frames, eye), cells)


def checked_eye(eye: Sequence[float] | np.ndarray) -> np.ndarray:
    """Return the point (3,) as float64. Raises BadInput if it is not a point."""
    point = np.asarray(eye, np.float64)
    if point.shape != (3,) or not np.isfinite(point).all():
        raise BadInput(where="eye", found=eye, expected="a point of 3 finite numbers")
    return point
