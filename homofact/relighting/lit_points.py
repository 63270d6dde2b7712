"""Points that explicit lights shine on: the origins of shadow rays, and the visible part of a light's disc.

Near the terminator, a shadow ray from a flat triangle hits the neighbouring triangles, although the light is above the
horizon of the interpolated normal. Rays therefore start from the point p lifted to the tangent planes of its corners
(Hanika 2021, Hacking the Shadow Terminator). For each corner v with normal n, the offset is max(0, (v − p)·n) along n.
The three offsets are interpolated with the barycentric weights of p.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from homofact.meshes.mesh import Mesh
from homofact.meshes.occlusion import Occluder
from homofact.relighting.cones import RoundLight
from homofact.relighting.lobe import PointSight, SurfacePoints

_RAYS = 2**20  # at a time


@dataclass(frozen=True)
class LitPoints:
    """Points that lights shine on: `origins` (S, 3) that rays start from, and `frames` (S, 3, 3) of their surface.

    Where a normal map tilts the frames, `horizon` (S, 3) are the surface's own normals.
    """

    origins: np.ndarray
    frames: np.ndarray
    horizon: np.ndarray | None = None

    @property
    def normals(self) -> np.ndarray:
        """Return the surface's own normals (S, 3); light arrives only above their horizon."""
        return self.frames[:, 2] if self.horizon is None else self.horizon

    @classmethod
    def on(cls, mesh: Mesh, points: SurfacePoints, offset: float) -> "LitPoints":
        """Points between the vertices of a mesh, lifted to the corners' tangent planes and off the surface."""
        corners, normals = mesh.positions[points.corners], mesh.normals[points.corners]
        shares = points.shares[..., None]
        flat = (corners * shares).sum(1)
        above = ((corners - flat[:, None]) * normals).sum(2, keepdims=True).clip(0)
        origins = flat + (shares * above * normals).sum(1) + offset * points.normals
        return cls(origins, points.frames, points.horizon)

    def sight(self, occluder: Occluder) -> PointSight:
        """Return what the meshes of `occluder` hide from the points."""
        return PointSight(self.origins, occluder)

    def seen(
        self,
        lights: Sequence[RoundLight],
        occluder: Occluder,
        samples: int,
        seed: int | None = None,
        finer: int | None = None,
    ) -> np.ndarray:
        """Return the unhidden fraction (S, Q) of the part of each light's disc that is above the surface.

        `samples` rays are traced for each disc, and `finer` instead where some of them are hidden and some are not.
        With a `seed`, the pattern of rays is rotated randomly at each point.
        """
        found = np.zeros((len(self.origins), len(lights)), np.float32)
        for number, light in enumerate(lights):
            turns = None if seed is None else np.random.default_rng(seed).random(len(self.origins)) * (2 * math.pi)
            for rows in ray_parts(len(self.origins), samples):
                found[rows, number] = self._seen_of(light, occluder, rows, samples, turns)
            if finer is not None:
                partly = np.flatnonzero((found[:, number] > 0) & (found[:, number] < 1))
                for part in ray_parts(len(partly), finer):
                    rows = partly[part]
                    found[rows, number] = self._seen_of(light, occluder, rows, finer, turns)
        return found

    def _seen_of(
        self, light: RoundLight, occluder: Occluder, rows: np.ndarray, samples: int, turns: np.ndarray | None
    ) -> np.ndarray:
        """Return the unhidden fraction (R,) of a light's disc at the points `rows` (R,)."""
        found = np.zeros(len(rows), np.float32)
        cones, normals = light.cones(self.origins[rows]), self.normals[rows]
        near = np.flatnonzero((normals * cones.middle).sum(1) > -np.sin(cones.radius))
        cones, at = cones.only(near), rows[near]
        w = cones.directions(samples, None if turns is None else turns[at])
        above = np.einsum("sj,srj->sr", self.normals[at], w) > 0
        starts, ends = np.broadcast_to(self.origins[at, None], w.shape), cones.lengths(w)
        clear = above.copy()
        clear[above] = ~occluder.blocked(starts[above], w[above], ends[above])
        found[near] = clear.sum(1) / above.sum(1).clip(1)
        return found


def ray_parts(count: int, rays: int) -> Iterator[np.ndarray]:
    """Return the indices of `count` points in batches of about `_RAYS` rays."""
    size = max(1, _RAYS // rays)
    return (np.arange(first, min(first + size, count)) for first in range(0, count, size))
