"""Visible vertices and the exact sum of their light, the reference for every approximation.

The light of a texel counts at its centre. Where the reflectance has a highlight narrower than a texel
(`texel_pattern`), the texels near the mirror direction are divided, and the highlight is summed over their parts.

Vertices are weighted by their area in a picture: a third of the solid angle of each of their triangles. They are
sampled in proportion to it, with one random number and equal steps, so that a mean over the samples is a mean over the
picture, including the rims of objects.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
import torch

from homofact.brdf.reflectance import Reflectance
from homofact.brdf.tinted import values_under
from homofact.errors import BadInput
from homofact.meshes.mesh import Mesh
from homofact.meshes.occlusion import Occluder
from homofact.meshes.tangents import frames
from homofact.relighting import cube
from homofact.relighting.cones import RoundLight
from homofact.relighting.lit_points import LitPoints
from homofact.relighting.lobe import SurfacePoints
from homofact.relighting.lobe_table import half_width
from homofact.relighting.mapped_points import bent_back
from homofact.relighting.sunlight import summed
from homofact.relighting.texel_pattern import texel_divisions
from homofact.relighting.tracer import Tracer
from homofact.scene.cameras import Camera
from homofact.scene.normal_map import SurfaceNormals
from homofact.scene.tint import SurfaceTint

_REACH = 6.0  # in widths of a narrow highlight: beyond it changes little within a texel
RIM = 0.2  # the rim is where cosθo is below this: 4% of a sphere's picture


@dataclass
class SeenVertices:
    """Vertices that an eye sees, with the inputs to the sum of their light.

    `weights` (S,) are their shares of the picture (default: equal). `view` (S, 3) gives directions to the viewer in
    their frames, instead of those to the eye. `tints` (V, 3) are the tints of a texture at all vertices of the mesh,
    and `mapped` (V, 3) the unit normals of a normal map. Light arrives above the mesh's own normals.
    """

    mesh: Mesh
    reflectance: Reflectance
    occluder: Occluder
    eye: np.ndarray
    which: np.ndarray
    weights: np.ndarray | None = None
    view: np.ndarray | None = None
    tints: np.ndarray | None = None
    mapped: np.ndarray | None = None
    rows: np.ndarray = field(init=False)
    wo: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        """Compute the vertices' frames, and the direction to the eye in them."""
        if self.view is not None:
            self.rows = frames(self.mesh.normals[self.which])
            self.wo = self.view
            return
        towards = self.eye - self.mesh.positions[self.which]
        towards /= np.linalg.norm(towards, axis=1, keepdims=True)
        own = self.mesh.normals[self.which]
        self.rows = frames(own if self.mapped is None else bent_back(self.mapped[self.which], towards))
        self.wo = np.einsum("vij,vj->vi", self.rows, towards)

    def dense(self, light: np.ndarray, size: int, reflectance: Reflectance | None = None) -> np.ndarray:
        """Return the sum (S, 3) over all texels of a cube map (6, n, n, 3), by the own or another reflectance."""
        asked = self.reflectance if reflectance is None else reflectance
        tracer = Tracer(self.mesh, self.occluder, size)
        parts = _TexelParts.of(self.reflectance, size)
        w = cube.directions(size).reshape(-1, 3)
        solid = np.tile(cube.solid_angles(size).reshape(-1), cube.FACES)
        radiance = light.reshape(-1, 3)
        found = np.zeros((len(self.which), 3))
        for s, v in enumerate(self.which):
            lit = np.flatnonzero(tracer.visible(int(v)))
            wi, angles = w[lit] @ self.rows[s].T, solid[lit]
            if parts is not None:
                lit, wi, angles = parts.divided(lit, wi, angles, self.rows[s], self.wo[s])
            kept = wi[:, 2] > 0
            wi = torch.from_numpy(wi[kept])
            wo = torch.from_numpy(self.wo[s]).expand(len(wi), 3)
            tint = None if self.tints is None else torch.from_numpy(self.tints[v])
            values = values_under(asked, tint, wi, wo).double().numpy() * wi[:, 2:].numpy()
            found[s] = (values * radiance[lit[kept]] * angles[kept, None]).sum(0)
        return found

    def sunlit(self, lights: Sequence[RoundLight]) -> np.ndarray:
        """The light of suns and lamps (S, 3), by the reflectance itself at many directions of each disc."""
        origins = self.mesh.lit_at[self.which] + self.occluder.offset * self.normals
        points = LitPoints(origins, self.rows, None if self.mapped is None else self.normals)
        return summed(self.reflectance, lights, points, self.wo, self.occluder, self.tint)

    @property
    def normals(self) -> np.ndarray:
        """Return the mesh's own normals at the vertices (S, 3), without the normal map."""
        return self.mesh.normals[self.which]

    @property
    def points(self) -> SurfacePoints:
        """The vertices as points, with the frames that they are shaded in."""
        found = SurfacePoints.at_vertices(self.rows, self.wo, self.which)
        return found if self.mapped is None else replace(found, horizon=self.normals)

    @property
    def tint(self) -> np.ndarray | None:
        """Return the tints of the vertices (S, 3)."""
        return None if self.tints is None else self.tints[self.which]


@dataclass(frozen=True)
class _TexelParts:
    """A cube map's texels, subdivided for a narrow highlight: directions `w` (T, P, 3) and solid angles (T, P).

    A texel is subdivided if the slope of its half vector is below `reach`, plus a margin `extent` for the size of a
    texel.
    """

    w: np.ndarray
    angles: np.ndarray
    reach: float
    extent: float

    @classmethod
    def of(cls, reflectance: Reflectance, size: int) -> "_TexelParts | None":
        """Return the subdivision for maps of `size` texels per side; None if the highlight is wider than a texel."""
        width = half_width(reflectance)
        times = texel_divisions(width, size)
        # Twice as fine as the sum of the separate lobe, which is judged by this.
        return cls(*_parts_of_texels(size, 2 << times), _REACH * width, 2 / size) if times else None

    def divided(
        self, lit: np.ndarray, wi: np.ndarray, angles: np.ndarray, rows: np.ndarray, wo: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the texels `lit` (L,), directions and solid angles, with the texels of the highlight subdivided."""
        h = wi + wo
        near = np.hypot(h[:, 0], h[:, 1]) < self.reach * h[:, 2] + self.extent
        fine = lit[near]
        count = self.w.shape[1]
        return (
            np.concatenate((lit[~near], fine.repeat(count))),
            np.concatenate((wi[~near], self.w[fine].reshape(-1, 3) @ rows.T)),
            np.concatenate((angles[~near], self.angles[fine].reshape(-1))),
        )


@lru_cache(maxsize=2)
def _parts_of_texels(size: int, across: int) -> tuple[np.ndarray, np.ndarray]:
    """Return directions (T, P, 3) and solid angles (T, P) of each texel's parts, `across` along a side."""
    finer = size * across

    def parts(values: np.ndarray) -> np.ndarray:
        shape = (cube.FACES, size, across, size, across, *values.shape[3:])
        return values.reshape(shape).swapaxes(2, 3).reshape(cube.FACES * size**2, across**2, *values.shape[3:])

    solid = np.broadcast_to(cube.solid_angles(finer), (cube.FACES, finer, finer))
    return parts(cube.directions(finer)), parts(solid)


def seen_vertices(
    mesh: Mesh,
    reflectance: Reflectance,
    occluder: Occluder,
    eye: Sequence[float],
    most: int | None,
    seed: int = 0,
    rim: bool = False,
    *,
    tint: SurfaceTint | None = None,
    bumps: SurfaceNormals | None = None,
) -> SeenVertices:
    """Draw `most` vertices that the eye sees, at random in proportion to their area in the picture.

    A vertex that covers much of the picture may be drawn several times. If `most` is None, all visible vertices are
    returned with weights. If `rim` is true, only vertices of the rim are used. `tint` is the effect of a texture on the
    reflectance, and `bumps` a normal map. Raises BadInput if the eye sees no vertex.
    """
    point = np.asarray(eye, np.float64)
    towards = point - mesh.positions
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    along = (towards * mesh.normals).sum(1)
    area = vertex_areas(mesh, point)
    facing = np.flatnonzero((along > 0) & (area > 0) & ((along < RIM) | (not rim)))
    start = mesh.positions[facing] + occluder.offset * mesh.normals[facing]
    open_ = facing[~occluder.blocked(start, towards[facing])]
    if not len(open_):
        raise BadInput(f"no vertex is seen from {tuple(point.tolist())}", where=mesh.name, expected="another eye")
    weights = area[open_] if most is None else None
    which = open_ if most is None else open_[_drawn(area[open_], most, seed)]
    tints = None if tint is None else tint.at_vertices
    mapped = None if bumps is None else bumps.at_vertices(mesh.normals)
    return SeenVertices(mesh, reflectance, occluder, point, which, weights, tints=tints, mapped=mapped)


def vertex_areas(mesh: Mesh, eye: np.ndarray) -> np.ndarray:
    """Return the solid angle (V,) of each vertex as seen from the eye: its part of the triangles that face the eye."""
    corners = mesh.positions[mesh.triangles]
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    # The side that the vertices' normals are on.
    outward = np.sign((area * mesh.normals[mesh.triangles].sum(1)).sum(1))
    towards = eye - corners.mean(1)
    seen = (outward * (area * towards).sum(1)).clip(0) / np.linalg.norm(towards, axis=1) ** 3
    return np.bincount(mesh.triangles.ravel(), np.repeat(seen / 3, 3), len(mesh.positions))


@dataclass(frozen=True)
class SeenPixels:
    """Pixels of a camera that see a mesh: their `points`, and the interpolation of each from the vertices.

    `numbers` (S,) count the pixels row by row from the top left.
    """

    points: SeenVertices
    mixture: SurfacePoints
    numbers: np.ndarray

    def lit_points(self, mesh: Mesh) -> LitPoints:
        """Return the origins of rays to suns, for pixels that show `mesh`."""
        return LitPoints.on(mesh, self.mixture, self.points.occluder.offset)


def seen_pixels(
    meshes: Sequence[Mesh], number: int, reflectance: Reflectance, occluder: Occluder, camera: Camera, most: int | None,
    seed: int = 0, *, tint: SurfaceTint | None = None, bumps: SurfaceNormals | None = None,
) -> SeenPixels:  # fmt: skip
    """Return `most` or all of the camera's pixels that see mesh `number` of the occluder's `meshes`.

    Points and normals are interpolated; a pixel whose normal is turned away from the eye is left out. Raises BadInput
    where no pixel sees the mesh.
    """
    mesh, eye = meshes[number], np.asarray(camera.eye, np.float64)
    rays = camera.rays().reshape(-1, 3)
    triangle, shares = occluder.first(eye[None], rays)
    first = sum(len(each.triangles) for each in meshes[:number])
    own = np.flatnonzero((triangle >= first) & (triangle < first + len(mesh.triangles)))
    corners, shares = mesh.triangles[triangle[own] - first], shares[own, :, None]
    normals = (mesh.normals[corners] * shares).sum(1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True).clip(1e-12)
    kept = np.flatnonzero((normals * rays[own]).sum(1) < 0)
    if not len(kept):
        raise BadInput(f"no pixel sees it from {tuple(eye.tolist())}", where=mesh.name, expected="another camera")
    if most is not None:
        kept = kept[_drawn(np.ones(len(kept)), min(most, len(kept)), seed)]
    positions = (mesh.positions[corners[kept]] * shares[kept]).sum(1)
    points = replace(mesh, positions=positions, normals=normals[kept], triangles=mesh.triangles[:0], origins=None)
    tints = None if tint is None else tint.between(corners[kept], shares[kept, :, 0])
    mapped = None if bumps is None else bumps.between(corners[kept], shares[kept, :, 0], normals[kept])
    seen = SeenVertices(points, reflectance, occluder, eye, np.arange(len(kept)), tints=tints, mapped=mapped)
    horizon = None if bumps is None else seen.normals
    mixture = SurfacePoints(seen.rows, seen.wo, corners[kept], shares[kept, :, 0], horizon)
    return SeenPixels(seen, mixture, own[kept])


def _drawn(weights: np.ndarray, count: int, seed: int) -> np.ndarray:
    """Draw `count` sorted indices in proportion to the weights, in even steps from a random start."""
    places = (np.arange(count) + np.random.default_rng(seed).random()) * (weights.sum() / count)
    return np.searchsorted(weights.cumsum(), places).clip(0, len(weights) - 1)
