"""The light that reaches pixels, as triangles of constant radiance: directly from the sky, or by way of a surface.

Both kinds have the same interface: `pixels`, the division `lights` of all directions, `some` of the pixels, and
`reaching`, the radiance of those triangles that a pixel receives light from.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from homofact.editing.lights import TriangleLights
from homofact.scene.meshes import MeshGroup
from homofact.scene.visibility import VisiblePixels


@dataclass(frozen=True)
class Reaching:
    """Light of P pixels: pixel p receives it from the triangles `numbers`[begins[p] … begins[p + 1]].

    `begins` (P + 1,), `numbers` (S,), and `radiance` (S, C) of each.
    """

    begins: np.ndarray
    numbers: np.ndarray
    radiance: np.ndarray

    @cached_property
    def owner(self) -> np.ndarray:
        """The pixel (S,) of each."""
        return np.repeat(np.arange(len(self.begins) - 1), np.diff(self.begins))


@dataclass(frozen=True)
class DirectLight:
    """The lights themselves, where no mesh blocks the ray to their centres."""

    pixels: VisiblePixels
    lights: TriangleLights
    meshes: MeshGroup
    least_divided = 0

    def some(self, rows: np.ndarray) -> "DirectLight":
        """Return that of the given rows of the pixels."""
        return DirectLight(self.pixels.some(rows), self.lights, self.meshes)

    def reaching(self) -> Reaching:
        """Return the light of all pixels; rays are traced at each call."""
        begins, numbers = visible_lights(self.pixels, self.lights, self.meshes)
        return Reaching(begins, numbers, self.lights.radiance[numbers])


@dataclass(frozen=True)
class BouncedLight:
    """Light from surfaces (`interreflection`), as it was traced: fields as in `Reaching`."""

    pixels: VisiblePixels
    lights: TriangleLights
    begins: np.ndarray
    numbers: np.ndarray
    radiance: np.ndarray
    # A triangle that crosses the horizon needs several points.
    least_divided = 1

    def some(self, rows: np.ndarray) -> "BouncedLight":
        """Return that of the given rows of the pixels."""
        counts = np.diff(self.begins)[rows]
        begins = np.concatenate(([0], np.cumsum(counts)))
        place = np.repeat(self.begins[rows] - begins[:-1], counts) + np.arange(begins[-1])
        return BouncedLight(self.pixels.some(rows), self.lights, begins, self.numbers[place], self.radiance[place])

    def reaching(self) -> Reaching:
        """Return the light of all pixels."""
        return Reaching(self.begins, self.numbers, self.radiance.astype(np.float64))


Light = DirectLight | BouncedLight


def visible_lights(pixels: VisiblePixels, lights: TriangleLights, meshes: MeshGroup) -> tuple[np.ndarray, np.ndarray]:
    """Return (begins (P + 1,), numbers (S,)) of each pixel's visible lights, tested by rays to their centres."""
    normals = pixels.frames[:, 2]
    above = normals @ lights.centres.T > 0
    pixel, light = np.nonzero(above)
    occluder = meshes.occluder
    origins = pixels.points + occluder.offset * normals
    free = ~occluder.blocked(origins[pixel], lights.centres[light])
    pixel, light = pixel[free], light[free]
    return begins_of(pixel, len(pixels)), light


def begins_of(owner: np.ndarray, count: int) -> np.ndarray:
    """Return indices (P + 1,) where the entries of each pixel begin, given sorted pixel numbers (S,)."""
    return np.concatenate(([0], np.cumsum(np.bincount(owner, minlength=count)))).astype(np.int64)
