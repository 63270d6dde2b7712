"""The full sum of the light that the surfaces of a scene send to points, the reference for interreflection.

Directions that follow the lobe of the point (`geometry.quadrature`) are traced to the surfaces they hit. The light that
such a surface sends back is the sum over the texels of a coarse cube map of the sky, with the surface's own reflectance
and shadows, and the light of suns, which are `widened` so that a mirror image of a sun covers several directions. The
reflectance of the point is then applied to this light. No surface is assumed to be matt.
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
from homofact.meshes.tangents import frames
from homofact.relighting import cube
from homofact.relighting.interreflection import widened
from homofact.relighting.seen import SeenVertices
from homofact.relighting.sunlight import LitPoints, Sun
from homofact.rendering.light import EnvironmentMap
from homofact.scene.tint import SurfaceTint

# Rings and spokes of directions to surfaces, fewer where there are many points; texels along a face of the sky.
NODES, FEW_NODES, INNER = 24, 10, 8
_SUN_RAYS = 32
_LEAST_COSINE = 0.01


@dataclass(frozen=True)
class SendingSurfaces:
    """Meshes in the occluder's order, each of its reflectance and with its texture's tint, under `suns` and any sky."""

    meshes: Sequence[Mesh]
    reflectances: Sequence[Reflectance]
    occluder: Occluder
    suns: Sequence[Sun] = ()
    tints: Sequence[SurfaceTint | None] | None = None

    def bounced(self, seen: SeenVertices, light: EnvironmentMap, nodes: int = NODES, inner: int = INNER) -> np.ndarray:
        """Radiance (S, 3) towards the eye of light that reaches the points by way of one other surface."""
        lights = self._lights(cube.environment_cube(light, inner))
        found = np.zeros((len(seen.which), 3))
        for s, v in enumerate(seen.which.tolist()):
            wo = torch.from_numpy(seen.wo[s]).clone()
            # A point that is seen at its very horizon reflects what one a little above it does.
            wo[2] = wo[2].clamp_min(_LEAST_COSINE)
            wi, solid = (each[0] for each in hemisphere_nodes(normalize(wo[None]), nodes, nodes))
            w = wi.numpy() @ seen.rows[s]
            origin = seen.mesh.positions[v] + self.occluder.offset * seen.rows[s, 2]
            triangle, weights = self.occluder.first(origin[None], w)
            met = np.flatnonzero(triangle >= 0)
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
        """Radiance (H, 3) of points on triangles towards `back` (H, 3), by lights of `flux` (L, 3) from `w` (L, 3)."""
        found, first = np.zeros((len(triangle), 3)), 0
        tints = [None] * len(self.meshes) if self.tints is None else self.tints
        for mesh, reflectance, texture in zip(self.meshes, self.reflectances, tints, strict=True):
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
            points = LitPoints(positions + self.occluder.offset * normals, frames(normals))
            view = np.einsum("hij,hj->hi", points.frames, back[own])
            tint = None if texture is None else texture.between(corners[facing], shares[facing, :, 0])
            found[own] = self._lit(points, reflectance, tint, view, w, flux)
        return found

    def _lights(self, radiance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(directions (L, 3), flux (L, 3)) of a cube map's texels and of the suns, `_SUN_RAYS` each."""
        size = radiance.shape[1]
        angles = np.tile(cube.solid_angles(size).reshape(-1), cube.FACES)
        w, flux = [cube.directions(size).reshape(-1, 3)], [radiance.reshape(-1, 3) * angles[:, None]]
        for sun in self.suns:
            w.append(widened(sun).directions(_SUN_RAYS))
            flux.append(np.broadcast_to(sun.irradiance / _SUN_RAYS, (_SUN_RAYS, 3)))
        return np.concatenate(w), np.concatenate(flux)

    def _lit(
        self,
        points: LitPoints,
        reflectance: Reflectance,
        tint: np.ndarray | None,
        view: np.ndarray,
        w: np.ndarray,
        flux: np.ndarray,
    ) -> np.ndarray:
        """The sum (H, 3) over the lights that points see, all of them at once; `tint` (H, 3) is that of a texture."""
        row, light = np.nonzero(points.frames[:, 2] @ w.T > 0)
        clear = ~self.occluder.blocked(points.origins[row], w[light])
        row, light = row[clear], light[clear]
        wi = np.einsum("sij,sj->si", points.frames[row], w[light])
        own = None if tint is None else torch.from_numpy(tint[row])
        f = values_under(reflectance, own, torch.from_numpy(wi), torch.from_numpy(view[row])).double().numpy()
        sent = f * wi[:, 2:] * flux[light]
        return np.stack([np.bincount(row, sent[:, c], len(view)) for c in range(3)], 1)
