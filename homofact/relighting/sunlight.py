"""Suns beside the sky of a relit scene: explicit lights with soft shadows, not texels of its cube map.

A texel of a cube map of 64² is 1.4° wide, three times the sun: its shadow is too soft, and wavelets ring about it. So a
sun is summed separately: E(ω) f(ω, ωo) cosθ times the part of its disc that is visible from a point. f is read from
tables (`lobe_table.sun_tables`), for the middle of the disc or, if the disc is wider than the lobe, for several of its
directions. The visible part of the disc is traced once for every vertex, and in pictures for each ray of a pixel.

A ray from a flat triangle below an interpolated normal meets its neighbours near the terminator. It starts from the
point lifted to the tangent planes of its corners (Hanika 2021, Hacking the Shadow Terminator): of each corner v with
normal n the part of n that lies above, max(0, (v − p)·n), mixed as the point is of its corners.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch

from homofact.brdf.reflectance import Reflectance
from homofact.brdf.tinted import values_under
from homofact.meshes.mesh import Mesh
from homofact.meshes.occlusion import Occluder
from homofact.meshes.tangents import frames
from homofact.relighting.lobe import SurfacePoints
from homofact.relighting.lobe_table import LobeTable
from homofact.scene.suns import SunTable
from homofact.settings.options import option

# Of the sun in the sky, in degrees.
RADIUS = 0.2665
MOST_SUNS = 8  # as the page has them too
SAMPLES, MOST_DIRECTIONS, _SPREAD = 64, 32, 2.399963229728653
_VERTEX_ROWS = 65536


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

    def directions(self, count: int, turns: np.ndarray | None = None) -> np.ndarray:
        """Unit directions (count, 3) spread over the disc evenly; (R, count, 3) with the pattern turned by `turns`."""
        place = np.arange(count) + 0.5
        angle = place * _SPREAD if turns is None else place * _SPREAD + turns[:, None]
        out = math.tan(self.radius) * np.sqrt(place / count)
        across = np.cross(self.direction, np.eye(3)[np.abs(self.direction).argmin()])
        across /= np.linalg.norm(across)
        other = np.cross(self.direction, across)
        w = self.direction + (out * np.cos(angle))[..., None] * across + (out * np.sin(angle))[..., None] * other
        return w / np.linalg.norm(w, axis=-1, keepdims=True)

    def radiance(self) -> np.ndarray:
        """That of the disc (3,)."""
        return self.irradiance / (2 * math.pi * (1 - math.cos(self.radius)))

    def describe(self) -> str:
        """Where it stands and how large it is."""
        up = math.degrees(math.asin(float(self.direction[1])))
        return f"{up:.0f}° high and {2 * math.degrees(self.radius):.1f}° wide"

    def record(self) -> dict[str, object]:
        """The JSON form."""
        return {
            "direction": self.direction.tolist(), "irradiance": self.irradiance.tolist(), "radius": self.radius,
        }  # fmt: skip


@dataclass(frozen=True)
class LitPoints:
    """Points that suns light: `origins` (S, 3) that rays start from, and `frames` (S, 3, 3) of their surface."""

    origins: np.ndarray
    frames: np.ndarray

    @classmethod
    def on(cls, mesh: Mesh, points: SurfacePoints, offset: float) -> "LitPoints":
        """Points between the vertices of a mesh, lifted to the corners' tangent planes and off the surface."""
        corners, normals = mesh.positions[points.corners], mesh.normals[points.corners]
        shares = points.shares[..., None]
        flat = (corners * shares).sum(1)
        above = ((corners - flat[:, None]) * normals).sum(2, keepdims=True).clip(0)
        return cls(flat + (shares * above * normals).sum(1) + offset * points.frames[:, 2], points.frames)

    def seen(self, suns: Sequence[Sun], occluder: Occluder, samples: int, seed: int | None = None) -> np.ndarray:
        """The part (S, Q) of each sun's disc that is above the surface and not hidden.

        By so many rays, whose pattern is turned anyhow from point to point where there is a `seed`.
        """
        found = np.zeros((len(self.origins), len(suns)), np.float32)
        for number, sun in enumerate(suns):
            near = np.flatnonzero(self.frames[:, 2] @ sun.direction > -math.sin(sun.radius))
            turns = None if seed is None else np.random.default_rng(seed).random(len(near)) * (2 * math.pi)
            w = np.broadcast_to(sun.directions(samples, turns), (len(near), samples, 3))
            above = np.einsum("sj,srj->sr", self.frames[near, 2], w) > 0
            starts = np.broadcast_to(self.origins[near, None], w.shape)
            clear = above.copy()
            clear[above] = ~occluder.blocked(starts[above], w[above])
            found[near, number] = clear.mean(1)
        return found


@dataclass(frozen=True)
class Sunlight:
    """The light of `suns` on one object: `tables` add up to its material, `seen` (V, Q) are parts of discs.

    `seen` is what each vertex sees of each sun.
    """

    suns: tuple[Sun, ...]
    tables: tuple[LobeTable, ...]
    seen: np.ndarray

    @classmethod
    def traced(cls, suns: Sequence[Sun], tables: tuple[LobeTable, ...], mesh: Mesh, occluder: Occluder) -> "Sunlight":
        """With what every vertex of a mesh sees."""
        parts = []
        for first in range(0, len(mesh.positions), _VERTEX_ROWS):
            rows = slice(first, first + _VERTEX_ROWS)
            origins = mesh.positions[rows] + occluder.offset * mesh.normals[rows]
            parts.append(LitPoints(origins, frames(mesh.normals[rows])).seen(suns, occluder, SAMPLES))
        return cls(tuple(suns), tables, np.concatenate(parts))

    @property
    def nbytes(self) -> int:
        """The tables and what the vertices see."""
        return sum(table.nbytes for table in self.tables) + self.seen.nbytes

    def directions(self, sun: Sun) -> int:
        """At how many directions of a disc f is asked: no farther apart than half the lobe's width."""
        lobe = 2 * self.tables[0].half_width
        return min(max(math.ceil(math.pi * (sun.radius / lobe) ** 2), 1), MOST_DIRECTIONS)

    def at(self, points: SurfacePoints, seen: np.ndarray, tint: np.ndarray | None = None) -> np.ndarray:
        """Radiance (S, 3) of points that see the parts (S, Q) of the discs; `tint` (S, 3) is that of a texture."""
        found = np.zeros((len(seen), 3))
        for number, sun in enumerate(self.suns):
            rows = np.flatnonzero((seen[:, number] > 0) & (points.wo[:, 2] > 0))
            count, f = self.directions(sun), np.zeros((len(rows), 3))
            for table in self.tables:
                times = 1.0 if tint is None else table.under(tint[rows], points.wo[rows])
                for w in sun.directions(count) if count > 1 else (sun.direction,):
                    f += reflected(table, w, points.frames[rows], points.wo[rows]) * times
            found[rows] += f * seen[rows, number, None] * (sun.irradiance / count)
        return found


def reflected(
    reflectance: Reflectance, direction: np.ndarray, rows: np.ndarray, wo: np.ndarray, tint: np.ndarray | None = None
) -> np.ndarray:
    """f cosθi (S, 3) of light from a direction (3,) in the world towards views (S, 3) in frames `rows` (S, 3, 3).

    `tint` (S, 3) is that of a texture.
    """
    wi = rows @ direction
    if not len(wi):
        return np.zeros((0, 3))
    pairs = torch.from_numpy(wi), torch.from_numpy(np.ascontiguousarray(wo, np.float64))
    f = values_under(reflectance, None if tint is None else torch.from_numpy(tint), *pairs)
    return (f.double().numpy() * wi[:, 2:].clip(0)) * np.ones(3)


def summed(
    reflectance: Reflectance,
    suns: Sequence[Sun],
    points: LitPoints,
    wo: np.ndarray,
    occluder: Occluder,
    tint: np.ndarray | None = None,
) -> np.ndarray:
    """The exact light (S, 3) of discs: the reflectance itself at `SAMPLES` directions of each, those that are seen.

    `tint` (S, 3) is that of a texture.
    """
    found = np.zeros((len(wo), 3))
    for sun in suns:
        for w in sun.directions(SAMPLES):
            lit = np.flatnonzero((points.frames[:, 2] @ w > 0) & (wo[:, 2] > 0))
            lit = lit[~occluder.blocked(points.origins[lit], np.broadcast_to(w, (len(lit), 3)))]
            own = None if tint is None else tint[lit]
            found[lit] += reflected(reflectance, w, points.frames[lit], wo[lit], own) * sun.irradiance / SAMPLES
    return found
