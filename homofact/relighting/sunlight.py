"""Suns and lamps beside the sky of a relit scene: explicit lights with soft shadows, not texels of its cube map.

A texel of a cube map of 64² is 1.4° wide, three times the sun: the sun's shadow is too soft, and wavelets ring around
the sun. So suns and lamps (`lamps`) are summed separately: L f(ω, ωo) cosθ over the cone that it fills (`cones`), times
the visible part of that cone above the surface. f is read from tables (`lobe_table.sun_tables`), for the middle of the
cone or, if the cone is wider than the lobe, for several of its directions. The visible part of the cone is traced once
for every vertex, and in pictures for each ray of a pixel. A lobe narrower than a partly hidden disc reflects only a
part of the disc. There, pictures trace a ray for each direction.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch

from homofact.brdf.reflectance import Reflectance
from homofact.brdf.tinted import values_under
from homofact.meshes.mesh import Mesh
from homofact.meshes.occlusion import Occluder
from homofact.meshes.tangents import frames
from homofact.relighting.cones import FEW, LightCones, RoundLight
from homofact.relighting.lamps import Lamp
from homofact.relighting.lit_points import LitPoints, ray_parts
from homofact.relighting.lobe import PointSight, SurfacePoints
from homofact.relighting.lobe_table import LobeTable, half_width
from homofact.scene.suns import SunTable
from homofact.settings.options import option

# Of the sun in the sky, in degrees.
RADIUS = 0.2665
MOST_LIGHTS = 8  # suns and lamps, as the page has them too
SAMPLES, MOST_SAMPLES, LEAST_DIRECTIONS, MOST_DIRECTIONS = 64, 1024, 16, 64
# Where a disc is partly hidden: a lobe may mirror its edge.
_AT_EDGES = 4 * MOST_DIRECTIONS
# Of a lobe's area that a cone fills: up to this, its middle is enough. A spiral of few directions is worse than that.
_ENOUGH = 0.3
# In radians: the width of the broadest lobe, that of the cosine; narrower cones need no more samples.
_BROADEST, _NARROW = 0.5, 0.03


@dataclass(frozen=True, kw_only=True)
class RelightSunTable(SunTable):
    """[[sun]] of a scene to relight: its disc has a `radius` in degrees."""

    radius: float = option(RADIUS, "Of the disc in degrees", above=0, most=20)

    def sun(self) -> "Sun":
        """The sun."""
        light = self.light()
        levels = np.broadcast_to(np.array(light.levels(), np.float64), (3,))
        return Sun(light.unit().numpy().astype(np.float64), levels.copy(), math.radians(self.radius))


@dataclass(frozen=True)
class Sun:
    """A disc of even radiance: unit `direction` (3,) to its middle, `irradiance` (3,) of a surface that faces it.

    `radius` in radians.
    """

    direction: np.ndarray
    irradiance: np.ndarray
    radius: float

    def cones(self, points: np.ndarray) -> LightCones:
        """Return the cone of the sun, the same for all points (S, 3)."""
        count = len(points)
        middle, levels = (np.broadcast_to(each, (count, 3)) for each in (self.direction, self.irradiance))
        return LightCones(middle, np.full(count, self.radius), levels, np.full(count, np.inf))

    def radiance(self) -> np.ndarray:
        """Return the radiance of the disc (3,)."""
        return self.irradiance / (math.pi * math.sin(self.radius) ** 2)

    def describe(self) -> str:
        """Describe the sun's elevation and diameter in degrees."""
        up = math.degrees(math.asin(float(self.direction[1])))
        return f"{up:.0f}° above the horizon, {2 * math.degrees(self.radius):.1f}° in diameter"

    def record(self) -> dict[str, object]:
        """The JSON form."""
        return {
            "direction": self.direction.tolist(), "irradiance": self.irradiance.tolist(), "radius": self.radius,
        }  # fmt: skip


@dataclass(frozen=True)
class Sunlight:
    """The light of `suns` and `lamps` on one object, whose material the `tables` add up to.

    `seen` (V, Q) is what each vertex sees of each sun and each lamp, in this order: the part of the disc above the
    surface that nothing hides. `bounced` (V, B, L) are the terms of interreflection under each lamp of intensity 1.
    """

    suns: tuple[Sun, ...]
    tables: tuple[LobeTable, ...]
    seen: np.ndarray
    lamps: tuple[Lamp, ...] = ()
    bounced: np.ndarray | None = None

    @classmethod
    def traced(
        cls,
        suns: Sequence[Sun],
        tables: tuple[LobeTable, ...],
        mesh: Mesh,
        occluder: Occluder,
        lamps: Sequence[Lamp] = (),
    ) -> "Sunlight":
        """Trace the visible part of each light at every vertex of a mesh."""
        origins = mesh.lit_at + occluder.offset * mesh.normals
        seen = LitPoints(origins, frames(mesh.normals)).seen((*suns, *lamps), occluder, SAMPLES)
        return cls(tuple(suns), tables, seen, tuple(lamps))

    @property
    def lights(self) -> tuple[RoundLight, ...]:
        """The suns, then the lamps."""
        return (*self.suns, *self.lamps)

    @property
    def nbytes(self) -> int:
        """The tables, what the vertices see, and the lamps' terms of interreflection."""
        terms = 0 if self.bounced is None else self.bounced.nbytes
        return sum(table.nbytes for table in self.tables) + self.seen.nbytes + terms

    def only(self, suns: bool, lamps: bool) -> "Sunlight | None":
        """The light of the suns, of the lamps, or of both; None if that is none."""
        kept = [*([suns] * len(self.suns)), *([lamps] * len(self.lamps))]
        if not any(kept):
            return None
        bounced = self.bounced if lamps else None
        return replace(
            self, suns=self.suns if suns else (), lamps=self.lamps if lamps else (), seen=self.seen[:, kept],
            bounced=bounced,
        )  # fmt: skip

    @property
    def width(self) -> float:
        """Return the width of the material's lobe in radians."""
        return min(2 * self.tables[0].half_width, _BROADEST)

    def directions(self, light: RoundLight, positions: np.ndarray, most: int = MOST_DIRECTIONS) -> int:
        """Return how many directions of a cone to evaluate, at most `most`: 1 if the lobe is wider than the cone.

        The number is the same for the whole object, whose vertices have `positions` (V, 3). If it is `most`, `at`
        directs them to the lobe.
        """
        filled = math.pi * (float(light.cones(positions).radius.max()) / self.width) ** 2
        return 1 if filled <= _ENOUGH else min(max(math.ceil(4 * filled), LEAST_DIRECTIONS), most)

    def at(
        self,
        points: SurfacePoints,
        positions: np.ndarray,
        seen: np.ndarray,
        tint: np.ndarray | None = None,
        sight: PointSight | None = None,
    ) -> np.ndarray:
        """Radiance (S, 3) of points that see the parts (S, Q) of the discs; `positions` (V, 3) are the vertices'.

        `tint` (S, 3) is that of a texture. A lobe narrower than a disc reflects only a part of the disc, which may be
        hidden although most of the disc is visible. With `sight`, homofact therefore traces a ray for each direction to
        a partly hidden disc.
        """
        found, origins = np.zeros((len(seen), 3)), points.mixed(positions.astype(np.float64))
        for number, light in enumerate(self.lights):
            own, count = seen[:, number], self.directions(light, positions)
            lit = (own > 0) & (points.wo[:, 2] > 0)
            traced = sight is not None and count > 1 and self.tables[0].cosine
            edge = lit & (own < 1) & traced
            for among, asked, most, rays in (
                (lit & ~edge, count, MOST_DIRECTIONS, None),
                (edge, _AT_EDGES, _AT_EDGES, sight),
            ):
                which, follow = np.flatnonzero(among), self.directions(light, positions, most) == most
                for part in ray_parts(len(which), asked):
                    rows = which[part]
                    cones = light.cones(origins[rows])
                    w, parts = self._asked(cones, asked, follow, points.frames[rows], points.wo[rows])
                    # Directions above a tilted normal may be under the surface's own horizon.
                    parts = parts * (np.einsum("snj,sj->sn", w, points.normals[rows]) > 0)
                    parts = parts * (own[rows, None] if rays is None else _seen_ways(rays.only(rows), cones, w))
                    f = self._reflected(w, parts, points.only(rows), None if tint is None else tint[rows])
                    found[rows] += f * cones.irradiance
        return found

    def _reflected(
        self, w: np.ndarray, parts: np.ndarray, points: SurfacePoints, tint: np.ndarray | None
    ) -> np.ndarray:
        """Return f cosθi (S, 3), summed over all tables and over directions (S, N, 3) with weights `parts` (S, N)."""
        f = np.zeros((len(parts), 3))
        for table in self.tables:
            times = np.ones((len(parts), 1)) if tint is None else table.under(tint, points.wo)
            for k in range(w.shape[1]):
                on = np.flatnonzero(parts[:, k])
                each = reflected(table, w[on, k], points.frames[on], points.wo[on])
                f[on] += each * times[on] * parts[on, k, None]
        return f

    def _asked(
        self, cones: LightCones, count: int, follow: bool, rows: np.ndarray, wo: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the directions (S, N, 3) at which to evaluate f, and each direction's share (S, N) of irradiance.

        The directions are spread over the cone, or over the lobe if `follow`.
        """
        if count == 1:
            return cones.middle[:, None], np.ones((len(wo), 1))
        if not follow:
            return cones.directions(count), np.repeat((2 / (1 + np.cos(cones.radius)) / count)[:, None], count, 1)
        mirror = np.einsum("sij,si->sj", rows, wo * np.array([-1.0, -1.0, 1.0]))
        mirror /= np.linalg.norm(mirror, axis=1, keepdims=True)
        return cones.lobe_directions(mirror, self.width, count, FEW * count // MOST_DIRECTIONS)


def _seen_ways(sight: PointSight, cones: LightCones, w: np.ndarray) -> np.ndarray:
    """Return whether (S, N) points see a light along directions `w` (S, N, 3)."""
    which = np.repeat(np.arange(len(w)), w.shape[1])
    return sight.sees(which, w.reshape(-1, 3), cones.lengths(w).reshape(-1)).reshape(w.shape[:2])


def reflected(
    reflectance: Reflectance, direction: np.ndarray, rows: np.ndarray, wo: np.ndarray, tint: np.ndarray | None = None
) -> np.ndarray:
    """f cosθi (S, 3) of light from a direction in the world, (3,) or (S, 3), towards views (S, 3).

    The views are in frames `rows` (S, 3, 3). `tint` (S, 3) is that of a texture.
    """
    wi = np.einsum("sij,sj->si", rows, np.broadcast_to(direction, (len(rows), 3)))
    if not len(wi):
        return np.zeros((0, 3))
    pairs = torch.from_numpy(wi), torch.from_numpy(np.ascontiguousarray(wo, np.float64))
    f = values_under(reflectance, None if tint is None else torch.from_numpy(tint), *pairs)
    return (f.double().numpy() * wi[:, 2:].clip(0)) * np.ones(3)


def summed(
    reflectance: Reflectance,
    lights: Sequence[RoundLight],
    points: LitPoints,
    wo: np.ndarray,
    occluder: Occluder,
    tint: np.ndarray | None = None,
) -> np.ndarray:
    """The exact light (S, 3) of discs: the reflectance itself at many directions of each, those that are seen.

    `SAMPLES` directions, or more where the lobe is narrower than their steps. `tint` (S, 3) is that of a texture.
    """
    found = np.zeros((len(wo), 3))
    for light in lights:
        for rows in ray_parts(len(wo), SAMPLES):
            cones = light.cones(points.origins[rows])
            count = _samples(reflectance, cones)
            w, flux = cones.directions(count), cones.flux / count
            ends = cones.lengths(w)
            for k in range(count):
                lit = np.flatnonzero(((points.normals[rows] * w[:, k]).sum(1) > 0) & (wo[rows, 2] > 0))
                lit = lit[~occluder.blocked(points.origins[rows[lit]], w[lit, k], ends[lit, k])]
                at = rows[lit]
                own = None if tint is None else tint[at]
                found[at] += reflected(reflectance, w[lit, k], points.frames[at], wo[at], own) * flux[lit]
    return found


def _samples(reflectance: Reflectance, cones: LightCones) -> int:
    """Return the number of directions of the exact sum, spaced at most half the lobe's half width."""
    widest = float(cones.radius.max(initial=0))
    if widest <= _NARROW:
        return SAMPLES
    step = half_width(reflectance) / 2
    return min(max(math.ceil(math.pi * (widest / step) ** 2), SAMPLES), MOST_SAMPLES)
