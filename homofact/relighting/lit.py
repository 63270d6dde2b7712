"""An object under a light: the radiance from its vertices, and from points between them, towards an eye."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from homofact.relighting.clusters import Clustered
from homofact.relighting.harmonic import Harmonic
from homofact.relighting.interreflection import spread_suns
from homofact.relighting.lobe import PointSight, SeparateLobe, SurfacePoints, checked_eye
from homofact.relighting.lobe_light import LightCells
from homofact.relighting.lobe_table import LobeTable
from homofact.relighting.mapped_points import mapped_points
from homofact.relighting.precompute import WaveletTransport
from homofact.relighting.relight import Light, Relit, light_coefficients, light_cube, shaded
from homofact.relighting.sunlight import Sunlight
from homofact.relighting.tilted_view import TiltedView
from homofact.scene.normal_map import SurfaceNormals
from homofact.scene.tint import SurfaceTint


@dataclass(frozen=True)
class LitObject:
    """The K-tuples (V, K, 3) of an object's vertices, the light's `cells` for a separate `lobe`, and its suns.

    `tint` is the effect of a base-colour texture on the material, `bumps` the normal map, and `tilted` the effect of
    tilted normals on the terms.
    """

    transport: WaveletTransport
    tuples: np.ndarray
    lobe: SeparateLobe | None = None
    cells: LightCells | None = None
    sunlight: Sunlight | None = None
    tint: SurfaceTint | None = None
    bumps: SurfaceNormals | None = None
    tilted: TiltedView | None = None

    @classmethod
    def of(
        cls,
        transport: WaveletTransport,
        compact: Clustered | Harmonic | None,
        lobe: SeparateLobe | None,
        light: Light,
        sunlight: Sunlight | None = None,
        tint: SurfaceTint | None = None,
        bumps: SurfaceNormals | None = None,
        tilted: TiltedView | None = None,
    ) -> "LitObject":
        """Light an object, from its compact form if given. Raises BadInput if `light` is not a light."""
        cells = None if lobe is None else lobe.cells(light_cube(light, transport.settings.cube))
        tuples, bounced = lit_tuples(transport, compact, light), transport.factors.bounced
        if bounced and sunlight is not None and sunlight.suns:
            spread = spread_suns(sunlight.suns, transport.settings.cube)
            tuples[:, -bounced:] += lit_tuples(transport, compact, spread)[:, -bounced:]
        if bounced and sunlight is not None and sunlight.bounced is not None:
            levels = np.stack([lamp.intensity for lamp in sunlight.lamps])
            tuples[:, -bounced:] += (sunlight.bounced @ levels).astype(np.float32)
        return cls(transport, tuples, lobe, cells, sunlight, tint, bumps, tilted)

    @property
    def varied(self) -> bool:
        """Whether the terms vary between vertices: with a texture or a normal map."""
        return self.tint is not None or self.bumps is not None

    def terms(self, eye: Sequence[float] | np.ndarray) -> np.ndarray:
        """Radiance (V, 3) float32 of the vertices towards a point `eye` (3,), by the in-out factors alone."""
        if self.tilted is not None:
            return self.terms_at(self.vertex_points(eye), eye).astype(np.float32)
        if self.tint is None:
            return shaded(self.transport, self.tuples, eye)
        plain, tinted = self._parts(eye)
        return (plain + tinted * self.tint.at_vertices).astype(np.float32)

    def terms_at(self, points: SurfacePoints, eye: Sequence[float] | np.ndarray) -> np.ndarray:
        """Return `terms` (S, 3) float64 interpolated between vertices, with the texture's colour and normal."""
        if self.tilted is not None:
            return self._tilted_at(points)
        seen = points.of_facing(self._facing(eye))
        if self.tint is None:
            return seen.mixed(shaded(self.transport, self.tuples, eye).astype(np.float64))
        plain, tinted = (seen.mixed(each.astype(np.float64)) for each in self._parts(eye))
        return plain + tinted * self.tint.between(points.corners, points.shares)

    def _facing(self, eye: Sequence[float] | np.ndarray) -> np.ndarray:
        """Return which vertices (V,) face a point."""
        made = self.transport
        return (made.frames[:, 2] * (checked_eye(eye) - made.positions)).sum(1) > 0

    def _tilted_at(self, points: SurfacePoints) -> np.ndarray:
        """Return the light (S, 3) of the terms under a normal map; 0 for points seen from behind."""
        assert self.tilted is not None
        made = self.transport
        where = (points.corners, points.shares, points.frames[:, 2], points.views)
        plain, tinted = self.tilted.light(self.tuples, made.frames, *where, made.factors.tinted_terms)
        tint = 1.0 if self.tint is None else self.tint.between(points.corners, points.shares)
        return np.where(points.wo[:, 2:] > 0, plain.astype(np.float64) + tinted * tint, 0.0)

    def vertex_points(self, eye: Sequence[float] | np.ndarray) -> SurfacePoints:
        """All vertices, with their mapped normals. Raises BadInput if `eye` is no point."""
        made = self.transport
        if self.bumps is None:
            return SurfacePoints.all_vertices(made.positions, made.frames, eye)
        normals = made.frames[:, 2].astype(np.float64)
        towards = checked_eye(eye) - made.positions
        towards /= np.linalg.norm(towards, axis=1, keepdims=True)
        corners = np.repeat(np.arange(made.vertices)[:, None], 3, 1)
        found = mapped_points(
            self.bumps, corners, np.broadcast_to(np.array([1.0, 0.0, 0.0]), corners.shape), normals, towards
        )
        # A vertex of a surface that is turned away sends nothing.
        away = (normals * towards).sum(1) <= 0
        return replace(found, wo=np.where(away[:, None], (0.0, 0.0, -1.0), found.wo))

    def _parts(self, eye: Sequence[float] | np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the radiance (V, 3) of the untinted terms, and that of the tinted terms for a tint of 1."""
        tinted = self.transport.factors.tinted_terms
        plain, own = (shaded(self.transport, self.tuples, eye, np.flatnonzero(each)) for each in (~tinted, tinted))
        return plain, own

    def lobe_at(self, points: SurfacePoints, sight: PointSight | None = None) -> np.ndarray:
        """Radiance (S, 3) of the separate lobe, 0 where there is none; `sight` as in `SeparateLobe.at`."""
        if self.lobe is None or self.cells is None:
            return np.zeros((len(points.frames), 3), np.float32)
        return self.lobe.at(points, self.cells, sight) * self._under(self.lobe.table, points)

    def _under(self, table: LobeTable, points: SurfacePoints) -> np.ndarray | float:
        """Return the factor by which the texture multiplies a table's light."""
        return 1.0 if self.tint is None else table.under(self.tint.between(points.corners, points.shares), points.wo)

    def suns_at(
        self, points: SurfacePoints, seen: np.ndarray | None = None, sight: PointSight | None = None
    ) -> np.ndarray:
        """Return the radiance (S, 3) by suns and lamps, whose visible parts are `seen` (S, Q).

        By default the visible parts are interpolated from the vertices. `sight` is as in `Sunlight.at`.
        """
        if self.sunlight is None:
            return np.zeros((len(points.frames), 3))
        tint = None if self.tint is None else self.tint.between(points.corners, points.shares)
        parts = points.mixed(self.sunlight.seen) if seen is None else seen
        return self.sunlight.at(points, self.transport.positions, parts, tint, sight)

    def only_beside(self, suns: bool, lamps: bool) -> "LitObject":
        """Return the object with only the suns, only the lamps, both, or none beside the sky."""
        return replace(self, sunlight=None if self.sunlight is None else self.sunlight.only(suns, lamps))

    def shade(self, eye: Sequence[float] | np.ndarray) -> np.ndarray:
        """Radiance (V, 3) float32 of the vertices towards a point `eye` (3,); negative residues stay in it."""
        found = self.terms(eye)
        if self.lobe is None and self.sunlight is None:
            return found
        points = self.vertex_points(eye)
        found += self.lobe_at(points)
        found += self.suns_at(points, None if self.sunlight is None else self.sunlight.seen).astype(np.float32)
        return found

    def between(
        self,
        points: SurfacePoints,
        eye: Sequence[float] | np.ndarray,
        seen: np.ndarray | None = None,
        sight: PointSight | None = None,
    ) -> np.ndarray:
        """Return radiance (S, 3) between vertices: factors interpolated, lobe and suns computed at the point.

        `seen` is as in `suns_at`, `sight` as in `SeparateLobe.at` and `Sunlight.at`.
        """
        return self.terms_at(points, eye) + self.lobe_at(points, sight) + self.suns_at(points, seen, sight)


def lit_tuples(transport: WaveletTransport, compact: Clustered | Harmonic | None, light: Light) -> np.ndarray:
    """K-tuples (V, K, 3) under a light, by the compact form where there is one. Raises BadInput for no light."""
    if isinstance(compact, Harmonic):
        return compact.tuples(light_coefficients(light, transport.settings.cube))
    relit = Relit(transport if compact is None else compact.basis)
    relit.relight(light)
    return relit.tuples if compact is None else compact.mixed(relit.tuples)
