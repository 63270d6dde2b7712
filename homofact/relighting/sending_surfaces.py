"""The full sum of the light that the surfaces of a scene send to points, the reference for interreflection.

Directions that follow the lobe of the point (`geometry.quadrature`) are traced to the surfaces they hit. The light that
such a surface sends back is the sum over the texels of a coarse cube map of the sky, with the surface's own reflectance
and shadows, and the light of suns and lamps, which are widened so that their mirror images cover several directions.
The reflectance of the point is then applied to this light. No surface is assumed to be matt.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch

from homofact.brdf.reflectance import Reflectance
from homofact.brdf.tinted import values_under
from homofact.geometry.directions import normalize
from homofact.geometry.quadrature import hemisphere_nodes
from homofact.meshes.mesh import Mesh
from homofact.meshes.occlusion import Occluder
from homofact.relighting import cube
from homofact.relighting.cones import RoundLight
from homofact.relighting.interreflection import SUN_RADIUS
from homofact.relighting.lit_points import LitPoints
from homofact.relighting.mapped_points import mapped_points
from homofact.relighting.seen import SeenVertices
from homofact.rendering.light import EnvironmentMap
from homofact.scene.normal_map import SurfaceNormals
from homofact.scene.tint import SurfaceTint

# Rings and spokes of directions to surfaces, fewer where there are many points; texels along a face of the sky.
NODES, FEW_NODES, INNER = 24, 10, 8
_SUN_RAYS = 32
_LEAST_COSINE = 0.01


@dataclass(frozen=True)
class SendingSurfaces:
    """Meshes in the occluder's order with their reflectances and texture tints, under `lights` and a sky.

    `bumps` are their normal maps.
    """

    meshes: Sequence[Mesh]
    reflectances: Sequence[Reflectance]
    occluder: Occluder
    lights: Sequence[RoundLight] = ()
    tints: Sequence[SurfaceTint | None] | None = None
    bumps: Sequence[SurfaceNormals | None] | None = None

    def bounced(self, seen: SeenVertices, light: EnvironmentMap, nodes: int = NODES, inner: int = INNER) -> np.ndarray:
        """Return the radiance (S, 3) towards the eye of light that reaches the points from one other surface."""
        radiance = cube.environment_cube(light, inner).reshape(-1, 3)
        angles = np.tile(cube.solid_angles(inner).reshape(-1), cube.FACES)
        lights = cube.directions(inner).reshape(-1, 3), radiance * angles[:, None]
        found = np.zeros((len(seen.which), 3))
        for s, v in enumerate(seen.which.tolist()):
            wo = torch.from_numpy(seen.wo[s]).clone()
            # A point that is seen at its very horizon reflects what one a little above it does.
            wo[2] = wo[2].clamp_min(_LEAST_COSINE)
            wi, solid = (each[0] for each in hemisphere_nodes(normalize(wo[None]), nodes, nodes))
            w = wi.numpy() @ seen.rows[s]
            own = seen.mesh.normals[v]
            origin = seen.mesh.positions[v] + self.occluder.offset * own
            triangle, weights = self.occluder.first(origin[None], w)
            met = np.flatnonzero((triangle >= 0) & (w @ own > 0))
            if not len(met):
                continue
            sent = self._sent(triangle[met], weights[met], -w[met], *lights)
            tint = None if seen.tints is None else torch.from_numpy(seen.tints[v])
            pairs = wi[met], normalize(wo[None]).expand(len(met), 3)
            f = values_under(seen.reflectance, tint, *pairs).double().numpy()
            found[s] = (f * sent * (wi[met, 2] * solid[met]).numpy()[:, None]).sum(0)
        return found

    def _sent(
        self, triangle: np.ndarray, weights: np.ndarray, back: np.ndarray, w: np.ndarray, flux: np.ndarray
    ) -> np.ndarray:
        """Return radiance (H, 3) of points towards `back` (H, 3), lit by `flux` (L, 3) from directions `w` (L, 3)."""
        found, first = np.zeros((len(triangle), 3)), 0
        tints = [None] * len(self.meshes) if self.tints is None else self.tints
        maps = [None] * len(self.meshes) if self.bumps is None else self.bumps
        for mesh, reflectance, texture, bumps in zip(self.meshes, self.reflectances, tints, maps, strict=True):
            own = np.flatnonzero((triangle >= first) & (triangle < first + len(mesh.triangles)))
            corners, shares = mesh.triangles[triangle[own] - first], weights[own, :, None]
            first += len(mesh.triangles)
            normals = (mesh.normals[corners] * shares).sum(1)
            normals /= np.linalg.norm(normals, axis=1, keepdims=True).clip(1e-12)
            facing = (normals * back[own]).sum(1) > 0
            if not facing.any():
                continue
            own, normals = own[facing], normals[facing]
            positions = (mesh.positions[corners[facing]] * shares[facing]).sum(1)
            mapped = mapped_points(bumps, corners[facing], shares[facing, :, 0], normals, back[own])
            points = LitPoints(positions + self.occluder.offset * normals, mapped.frames, mapped.horizon)
            view = mapped.wo
            tint = None if texture is None else texture.between(corners[facing], shares[facing, :, 0])
            found[own] = self._lit(points, reflectance, tint, view, w, flux)
        return found

    def _lit(
        self,
        points: LitPoints,
        reflectance: Reflectance,
        tint: np.ndarray | None,
        view: np.ndarray,
        w: np.ndarray,
        flux: np.ndarray,
    ) -> np.ndarray:
        """Return the reflected sum (H, 3) over all visible lights; `tint` (H, 3) is the texture's factor."""
        row, light = np.nonzero(points.normals @ w.T > 0)
        pairs = [(row, w[light], flux[light], np.full(len(row), np.inf))]
        for each in self.lights:
            cones = each.cones(points.origins).widened(SUN_RADIUS)
            towards = cones.directions(_SUN_RAYS)
            row, ray = np.nonzero(np.einsum("srj,sj->sr", towards, points.normals) > 0)
            pairs.append((row, towards[row, ray], cones.flux[row] / _SUN_RAYS, cones.lengths(towards)[row, ray]))
        row, towards, flux, ends = (np.concatenate(each) for each in zip(*pairs, strict=True))
        clear = ~self.occluder.blocked(points.origins[row], towards, ends)
        row, towards, flux = row[clear], towards[clear], flux[clear]
        wi = np.einsum("sij,sj->si", points.frames[row], towards)
        own = None if tint is None else torch.from_numpy(tint[row])
        f = values_under(reflectance, own, torch.from_numpy(wi), torch.from_numpy(view[row])).double().numpy()
        sent = f * wi[:, 2:].clip(0) * flux
        return np.stack([np.bincount(row, sent[:, c], len(view)) for c in range(3)], 1)
