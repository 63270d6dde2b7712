"""Lamps in a relit scene: glowing spheres at a finite distance, with soft shadows.

A lamp of intensity I and radius r has the radiance L = I/(π r²) all over. Its irradiance on a surface at the distance d
from its middle is I cosθ/d² wherever the surface sees all of it, for every r (`cones`). A lamp lights, but it shades
nothing: it does not block the light of the sky, of suns and of other lamps.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from homofact.errors import BadInput
from homofact.meshes.mesh import Mesh
from homofact.meshes.prepare import open_edges
from homofact.relighting.cones import LightCones
from homofact.rendering.light import MOST_LIGHT
from homofact.scene.cameras import Camera, check_point
from homofact.settings.options import required

MOST_RADIUS = 1e5
_TRIANGLES = 65536


@dataclass(frozen=True)
class Lamp:
    """A sphere at `position` (3,) of `radius`, with the same radiance all over.

    `intensity` (3,) is its radiant intensity: the irradiance, at distance 1, of a surface that faces it.
    """

    position: np.ndarray
    radius: float
    intensity: np.ndarray

    def cones(self, points: np.ndarray) -> LightCones:
        """Return the lamp's cones seen from points (S, 3); a point inside it is treated as one on its surface."""
        towards = self.position - points
        distance = np.linalg.norm(towards, axis=1).clip(self.radius * (1 + 1e-6))
        middle = towards / np.linalg.norm(towards, axis=1, keepdims=True).clip(1e-12)
        angle = np.arcsin(self.radius / distance)
        return LightCones(middle, angle, self.intensity / distance[:, None] ** 2, distance, self.radius)

    def radiance(self) -> np.ndarray:
        """Return the radiance of its surface (3,)."""
        return self.intensity / (math.pi * self.radius**2)

    def met(self, origin: np.ndarray, rays: np.ndarray) -> np.ndarray:
        """How far (R,) unit rays (R, 3) from a point `origin` (3,) go until they meet the sphere; infinite if never."""
        towards = self.position - origin
        along = rays @ towards
        under = self.radius**2 - (towards @ towards - along**2)
        found = np.full(len(rays), np.inf)
        hit = (under > 0) & (along > 0)
        found[hit] = along[hit] - np.sqrt(under[hit])
        return found

    def record(self) -> dict[str, object]:
        """The JSON form."""
        return {
            "position": self.position.tolist(), "radius": self.radius, "intensity": self.intensity.tolist(),
        }  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class LampTable:
    """[[lamp]]: a glowing sphere at `position`, with `radius` in the scene's units.

    At the distance d from its middle, a surface that faces the lamp has the irradiance `intensity`/d², in the
    lighting's units of radiance times steradians.
    """

    position: tuple[float, ...]
    radius: float = required("Of the sphere, in the scene's units", above=0, most=MOST_RADIUS)
    intensity: tuple[float, ...]

    def __post_init__(self) -> None:
        """Reject an invalid position, and a lamp without light. Raises BadInput."""
        check_point("position", self.position)
        if len(self.intensity) not in (1, 3) or not any(self.intensity):
            wanted = "1 or 3 numbers, some above 0"
            raise BadInput(where="intensity", found=list(self.intensity), expected=wanted)
        if not all(0 <= value <= MOST_LIGHT for value in self.intensity):
            wanted = f"numbers from 0 to {MOST_LIGHT:g}"
            raise BadInput(where="intensity", found=list(self.intensity), expected=wanted)

    def lamp(self) -> Lamp:
        """The lamp."""
        levels = np.broadcast_to(np.array(self.intensity, np.float64), (3,))
        return Lamp(np.array(self.position, np.float64), self.radius, levels.copy())


def check_lamps(lamps: Sequence[Lamp], meshes: Sequence[Mesh], ground: Mesh | None, cameras: Sequence[Camera]) -> None:
    """Refuse lamps that touch or lie inside an object, reach under the ground, or contain a camera. Raises BadInput."""
    for number, lamp in enumerate(lamps):
        where = f"lamp[{number}]"
        if ground is not None:
            height = float(ground.positions[:, 1].max())
            if lamp.position[1] - lamp.radius <= height:
                found = f"its lowest point at y = {lamp.position[1] - lamp.radius:.4g}"
                raise BadInput(where=where, found=found, expected=f"a lamp above the ground at y = {height:.4g}")
        for mesh in meshes:
            if not open_edges(mesh) and _inside(lamp.position, mesh):
                raise BadInput(
                    where=where, found=f"its middle inside {mesh.name}", expected="a lamp outside all objects"
                )
            near = distance_to(lamp.position, mesh)
            if near <= lamp.radius:
                found = f"{mesh.name} at a distance of {near:.4g} from its middle"
                raise BadInput(where=where, found=found, expected=f"more than its radius of {lamp.radius:.4g}")
        for camera in cameras:
            near = float(np.linalg.norm(np.subtract(camera.eye, lamp.position)))
            if near <= lamp.radius:
                found = f"a camera at a distance of {near:.4g} from its middle"
                raise BadInput(where=where, found=found, expected=f"more than its radius of {lamp.radius:.4g}")


def distance_to(point: np.ndarray, mesh: Mesh) -> float:
    """The distance of a point (3,) from the nearest point of a mesh's triangles (Ericson 2005, section 5.1.5)."""
    least = math.inf
    for first in range(0, len(mesh.triangles), _TRIANGLES):
        corners = mesh.positions[mesh.triangles[first : first + _TRIANGLES]] - point
        for k in range(3):
            start, edge = corners[:, k], corners[:, (k + 1) % 3] - corners[:, k]
            share = (-(start * edge).sum(1) / (edge**2).sum(1).clip(1e-300)).clip(0, 1)
            least = min(least, float(np.linalg.norm(start + share[:, None] * edge, axis=1).min()))
        a, b, c = corners.swapaxes(0, 1)
        normal = np.cross(b - a, c - a)
        over = [(np.cross(q - p, -p) * normal).sum(1) >= 0 for p, q in ((a, b), (b, c), (c, a))]
        within = np.logical_and.reduce(over) & (np.abs(normal).max(1) > 0)
        if within.any():
            height = np.abs((a[within] * normal[within]).sum(1)) / np.linalg.norm(normal[within], axis=1)
            least = min(least, float(height.min()))
    return least


def _inside(point: np.ndarray, mesh: Mesh) -> bool:
    """Return whether a closed mesh encloses a point, by solid angles (van Oosterom and Strackee 1983, (8))."""
    a, b, c = (mesh.positions[mesh.triangles] - point).swapaxes(0, 1)
    la, lb, lc = (np.linalg.norm(each, axis=1) for each in (a, b, c))
    over = (a * np.cross(b, c)).sum(1)
    under = la * lb * lc + (a * b).sum(1) * lc + (b * c).sum(1) * la + (c * a).sum(1) * lb
    return abs(float(2 * np.arctan2(over, under).sum())) > 2 * math.pi
