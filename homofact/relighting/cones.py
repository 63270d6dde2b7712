"""A round light as points see it: a cone of directions about its middle, for suns and lamps alike.

From a point a sun and a spherical lamp both look like a disc of even radiance L, of half angle α. A sun's cone is the
same everywhere. A lamp of radius r at the distance d has sin α = r/d, so its irradiance on a surface that faces it and
sees all of it, E = π L sin² α, falls off with the square of the distance, at every distance.

Directions are spread over the cone with equal solid angles: cosβ falls evenly from 1 to cosα. The integral of L over
the cone is the flux Φ = L Ω = 2E/(1 + cosα), of which each of N directions carries Φ/N.

A lobe much narrower than the cone would fall between such directions. In this case most directions sample the lobe of
width w about the mirror direction m instead (`lobe_directions`). Their density is proportional to 1/(1 + β²/w²)², where
β ≤ `_REACH` · w is the angle from m. Directions outside the cone get the weight 0. A few directions over the cone cover
what lies beyond that reach.
"""

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

_SPREAD = 2.399963229728653
# Of the directions that follow a lobe: in widths, and in radians. How many have what is beyond.
_REACH, _WIDEST, FEW = 3.0, 1.2, 32


@dataclass(frozen=True)
class LightCones:
    """The cone of one light at S points.

    `middle` (S, 3) are unit directions to its middle, `radius` (S,) half angles in radians, and `irradiance` (S, 3)
    that of surfaces that face it. The light is a sphere of radius `size` at `distance` (S,), infinite for a sun.
    """

    middle: np.ndarray
    radius: np.ndarray
    irradiance: np.ndarray
    distance: np.ndarray
    size: float = 0.0

    @property
    def flux(self) -> np.ndarray:
        """The integral of the radiance over the cone (S, 3)."""
        return self.irradiance * (2 / (1 + np.cos(self.radius)))[:, None]

    def only(self, which: np.ndarray) -> "LightCones":
        """Return the cones of the points `which`."""
        middle, radius, irradiance = self.middle[which], self.radius[which], self.irradiance[which]
        return LightCones(middle, radius, irradiance, self.distance[which], self.size)

    def widened(self, least: float) -> "LightCones":
        """Cones of at least this half angle in radians, with the irradiance unchanged."""
        return LightCones(self.middle, self.radius.clip(least), self.irradiance, self.distance, self.size)

    def directions(self, count: int, turns: np.ndarray | None = None) -> np.ndarray:
        """Unit directions (S, count, 3) with equal solid angles, their pattern turned by `turns` (S,) if given."""
        place = (np.arange(count) + 0.5) / count
        return _spiral(self.middle, 1 - (1 - np.cos(self.radius))[:, None] * place, turns)

    def lobe_directions(
        self, mirror: np.ndarray, width: float, count: int, few: int = FEW
    ) -> tuple[np.ndarray, np.ndarray]:
        """(unit directions (S, N, 3), the part (S, N) of the irradiance that each carries): N is `count` + `few`.

        `count` directions cover a lobe of `width` radians about `mirror` (S, 3), and `few` directions are spread over
        the cone.
        """
        reach = min(_REACH * width, _WIDEST)
        whole = reach**2 / (width**2 + reach**2)
        x = whole * (np.arange(count) + 0.5) / count
        beta = width * np.sqrt(x / (1 - x))
        solid = math.pi * np.sin(beta) * width * np.sqrt((1 - x) / x) / (1 - x) ** 2 * whole / count
        near = _spiral(mirror, np.broadcast_to(np.cos(beta), (len(mirror), count)))
        inside = np.einsum("snj,sj->sn", near, self.middle) >= np.cos(self.radius)[:, None]
        far = self.directions(few)
        beyond = np.einsum("snj,sj->sn", far, mirror) < math.cos(reach)
        each = (2 * math.pi * (1 - np.cos(self.radius)) / few)[:, None]
        parts = np.concatenate((solid * inside, each * beyond), 1)
        return np.concatenate((near, far), 1), parts / (math.pi * np.sin(self.radius) ** 2)[:, None]

    def lengths(self, directions: np.ndarray) -> np.ndarray:
        """How far (S, N) rays along `directions` (S, N, 3) go until they meet the light; infinite for a sun."""
        along = np.einsum("snj,sj->sn", directions, self.middle) if self.size else np.ones(directions.shape[:2])
        far = self.distance[:, None]
        if not self.size:
            return np.broadcast_to(far, along.shape)
        return far * along - np.sqrt((self.size**2 - far**2 * (1 - along**2)).clip(0))


def _spiral(axis: np.ndarray, along: np.ndarray, turns: np.ndarray | None = None) -> np.ndarray:
    """Return unit directions (S, N, 3) on spirals about axes (S, 3) with cosines `along` (S, N) to the axes."""
    angle = (np.arange(along.shape[1]) + 0.5) * _SPREAD + (0.0 if turns is None else turns[:, None])
    out = np.sqrt((1 - along**2).clip(0))
    across = np.cross(axis, np.eye(3)[np.abs(axis).argmin(1)])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    other = np.cross(axis, across)
    sides = (out * np.cos(angle))[..., None] * across[:, None] + (out * np.sin(angle))[..., None] * other[:, None]
    return along[..., None] * axis[:, None] + sides


class RoundLight(Protocol):
    """A light beside the sky: a sun or a lamp."""

    def cones(self, points: np.ndarray) -> LightCones:
        """Return the cones that the light fills as seen from points (S, 3)."""
        ...

    def radiance(self) -> np.ndarray:
        """Return the radiance of its disc (3,)."""
        ...
