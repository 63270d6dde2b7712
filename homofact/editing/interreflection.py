"""One bounce of light between surfaces (Ben-Artzi et al. 2008): what each sender adds to the pixels that see it.

A surface sends ρ E/π towards a pixel, as if it were matt: E is its irradiance by the light, with shadows, and ρ its
albedo under uniform light, with its curves as they are (`sender_albedo`). The light that arrives is linear in ρ. So a
pixel has, beside its transport T of direct light, one transport T^S for each sender S that it sees, made with ρ = 1,

    R = Σ_b c_b (T_b + Σ_S ρ_S T^S_b),

and an edit of a sender changes only the factors ρ_S. T^S includes the receiver's own curves and quotient, so receivers
are not treated as matt. The directions at a receiver are `TRIANGLES` triangles of similar size, each with rays to the
centres of its four parts.

E is computed at the vertices of all meshes from about `LIGHTS` triangles of light, and is linear in between.
"""

from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields

import numpy as np

from homofact.editing.lights import TriangleLights, even_triangles, triangle_lights
from homofact.editing.quotient import LightPoints
from homofact.editing.reaching import BouncedLight, DirectLight, begins_of
from homofact.editing.scene import EditScene
from homofact.meshes.tangents import frames
from homofact.scene.meshes import MeshGroup
from homofact.scene.visibility import VisiblePixels

TRIANGLES, LIGHTS = 512, 1000
_RAYS = 1 << 18


@dataclass(frozen=True)
class Met:
    """Surface points (S) that rays meet: `pixel` and `ray` (S,), the mesh `owners` (S,), and the triangles' `corners`.

    `weights` (S, 3, 1) are barycentric; `at` interpolates vertex values at the points.
    """

    pixel: np.ndarray
    ray: np.ndarray
    owners: np.ndarray
    corners: np.ndarray
    weights: np.ndarray

    def some(self, rows: np.ndarray) -> "Met":
        """Return those of the given rows."""
        return Met(*(getattr(self, each.name)[rows] for each in fields(self)))

    def at(self, values: np.ndarray) -> np.ndarray:
        """Return (S, n) of vertices' values (W, n)."""
        return (values[self.corners] * self.weights).sum(1)


@dataclass(frozen=True)
class Bounce:
    """Directions to surfaces: the triangles, with the points that rays go through."""

    meshes: MeshGroup
    lights: TriangleLights
    points: LightPoints

    @classmethod
    def of(cls, meshes: MeshGroup, channels: int) -> "Bounce":
        """Make the directions from triangles of similar size."""
        lights = even_triangles(TRIANGLES, channels)
        return cls(meshes, lights, LightPoints.of(lights, 1))

    def met(self, pixels: VisiblePixels) -> Met:
        """Trace the rays of some pixels to the nearest surface, if they hit its front."""
        directions, meshes = self.points.points.reshape(-1, 3), self.meshes
        normals = pixels.frames[:, 2]
        pixel, ray = np.nonzero(normals @ directions.T > 0)
        origins = pixels.points + meshes.occluder.offset * normals
        triangle, weights = meshes.occluder.first(origins[pixel], directions[ray])
        hit = np.flatnonzero(triangle >= 0)
        triangle = triangle[hit]
        found = Met(
            pixel[hit], ray[hit], meshes.owners[triangle], meshes.triangles[triangle], weights[hit, :, None]
        )  # fmt: skip
        return found.some(np.flatnonzero((found.at(meshes.normals) * directions[found.ray]).sum(1) < 0))

    def surfaces(self, met: Met) -> VisiblePixels:
        """Return the hit surfaces as the pixels see them."""
        normals = met.at(self.meshes.normals)
        frame = frames(normals / np.linalg.norm(normals, axis=1, keepdims=True))
        wo = np.einsum("pij,pj->pi", frame, -self.points.points.reshape(-1, 3)[met.ray])
        points, uv = met.at(self.meshes.positions), met.at(self.meshes.uv)
        return VisiblePixels(np.arange(len(met.ray)), met.owners, points, frame, wo, uv)

    def gathered(self, pixels: VisiblePixels, sent: Iterable[tuple[Met, np.ndarray]]) -> list[BouncedLight]:
        """Return the light of pixels for each pair (hits, their radiance (S, C)) in `sent`.

        The radiance of a triangle is the mean over its rays above the horizon, weighted by their cosines.
        """
        count, rays = self.points.shares.shape
        cosine = np.maximum(pixels.frames[:, 2] @ self.points.points.reshape(-1, 3).T, 0)
        weights = cosine.reshape(len(pixels), count, rays) * self.points.shares
        whole, weights, found = weights.sum(2).ravel(), weights.reshape(len(pixels), -1), []
        for met, radiance in sent:
            used, place = np.unique(met.pixel * count + met.ray // rays, return_inverse=True)
            weight = weights[met.pixel, met.ray]
            sums = np.stack([np.bincount(place, weight * each, len(used)) for each in radiance.T], 1)
            lit = sums.any(1)
            owner, numbers = np.divmod(used[lit], count)
            values = (sums[lit] / whole[used[lit], None]).astype(np.float32)
            found.append(BouncedLight(pixels, self.lights, begins_of(owner, len(pixels)), numbers, values))
        return found


@dataclass(frozen=True)
class LitSurfaces:
    """All surfaces of a scene: `light` (W, C) is E/π at the vertices of its meshes."""

    scene: EditScene
    bounce: Bounce
    light: np.ndarray
    threads: int

    @classmethod
    def of(cls, scene: EditScene, meshes: MeshGroup, threads: int) -> "LitSurfaces":
        """Compute E at the vertices, in threads whose number changes no bit."""
        channels = len(scene.channels)
        lights = triangle_lights(scene.lighting, LIGHTS, channels)
        power = lights.solid_angles[:, None] * lights.radiance / np.pi
        count = len(meshes.positions)
        vertices = VisiblePixels(
            np.arange(count), np.zeros(count, np.int64), meshes.positions, frames(meshes.normals), meshes.normals,
            meshes.uv,
        )  # fmt: skip

        def one(start: int) -> np.ndarray:
            some = vertices.some(np.arange(start, min(start + _RAYS // LIGHTS, count)))
            found = DirectLight(some, lights, meshes).reaching()
            cosine = (some.frames[found.owner, 2] * lights.centres[found.numbers]).sum(1)
            each = cosine[:, None] * power[found.numbers]
            return np.stack([np.bincount(found.owner, column, len(some)) for column in each.T], 1)

        with ThreadPoolExecutor(threads) as pool:
            light = np.concatenate(list(pool.map(one, range(0, count, _RAYS // LIGHTS))))
        return cls(scene, Bounce.of(meshes, channels), light, threads)

    def received(self, pixels: VisiblePixels) -> tuple[np.ndarray, np.ndarray, BouncedLight]:
        """Return rows (S,) of the pixels, the numbers (S,) of the senders that they see, and the light of each pair.

        The pairs are in the order of the senders; the light is that of ρ = 1.
        """
        step, count = max(1, _RAYS // (4 * TRIANGLES)), len(self.scene.senders)

        def one(start: int) -> list[BouncedLight]:
            some = pixels.some(np.arange(start, min(start + step, len(pixels))))
            met = self.bounce.met(some)
            return self.bounce.gathered(some, [self._sent(number, met) for number in range(count)])

        with ThreadPoolExecutor(self.threads) as pool:
            pieces = list(pool.map(one, range(0, len(pixels), step)))
        ordered = [piece[number] for number in range(count) for piece in pieces]
        counts = np.concatenate([np.diff(each.begins) for each in ordered])
        pairs = np.flatnonzero(counts)
        senders, rows = np.divmod(pairs, len(pixels))
        numbers, radiance = (
            np.concatenate([getattr(each, name) for each in ordered]) for name in ("numbers", "radiance")
        )
        begins = np.concatenate(([0], np.cumsum(counts[pairs])))
        return rows, senders, BouncedLight(pixels.some(rows), self.bounce.lights, begins, numbers, radiance)

    def _sent(self, number: int, met: Met) -> tuple[Met, np.ndarray]:
        """Return the points met on a sender, and the light (S, C) that they send, with its pattern."""
        sender, meshes = self.scene.senders[number], self.bounce.meshes
        own = met.some(np.flatnonzero(met.owners == sender.object))
        sent, pattern = own.at(self.light), self.scene.objects[sender.object].patterns.get(sender.terms[0])
        return own, sent if pattern is None else sent * pattern(own.at(meshes.positions), own.at(meshes.uv))
