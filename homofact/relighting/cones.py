"""A round light as points see it: a cone of directions about its middle, for suns and lamps alike.

From a point a sun and a spherical lamp both look like a disc of even radiance L, of half angle α. A sun's cone is the
same everywhere. A lamp of radius r at the distance d has sin α = r/d, so its irradiance on a surface that faces it and
sees all of it, E = π L sin² α, falls off with the square of the distance, at every distance.

Directions are spread over the cone with equal solid angles: cosβ falls evenly from 1 to cosα. The integral of L over
the cone is the flux Φ = L Ω = 2E/(1 + cosα), of which each of N directions carries Φ/N.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

_SPREAD = 2.399963229728653


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
        """Those of the points `which`."""
        kept = (each[which] for each in (self.middle, self.radius, self.irradiance, self.distance))
        return LightCones(*kept, self.size)

    def widened(self, least: float) -> "LightCones":
        """Cones of at least this half angle in radians, with the irradiance unchanged."""
        return LightCones(self.middle, self.radius.clip(least), self.irradiance, self.distance, self.size)

    def directions(self, count: int, turns: np.ndarray | None = None) -> np.ndarray:
        """Unit directions (S, count, 3) with equal solid angles, their pattern turned by `turns` (S,) if given."""
        place = np.arange(count) + 0.5
        angle = (place * _SPREAD)[None] if turns is None else place * _SPREAD + turns[:, None]
        along = 1 - (1 - np.cos(self.radius))[:, None] * (place / count)
        out = np.sqrt((1 - along**2).clip(0))
        least = np.abs(self.middle).argmin(1)
        across = np.cross(self.middle, np.eye(3)[least])
        across /= np.linalg.norm(across, axis=1, keepdims=True)
        other = np.cross(self.middle, across)
        sides = (out * np.cos(angle))[..., None] * across[:, None] + (out * np.sin(angle))[..., None] * other[:, None]
        return along[..., None] * self.middle[:, None] + sides

    def lengths(self, directions: np.ndarray) -> np.ndarray:
        """How far (S, N) rays along `directions` (S, N, 3) go until they meet the light; infinite for a sun."""
        along = np.einsum("snj,sj->sn", directions, self.middle) if self.size else np.ones(directions.shape[:2])
        far = self.distance[:, None]
        if not self.size:
            return np.broadcast_to(far, along.shape)
        return far * along - np.sqrt((self.size**2 - far**2 * (1 - along**2)).clip(0))


class RoundLight(Protocol):
    """A light beside the sky: a sun or a lamp."""

    @property
    def brightness(self) -> np.ndarray:
        """What its table in the scene file gives, red, green and blue (3,)."""

    def cones(self, points: np.ndarray) -> LightCones:
        """How points (S, 3) see it."""

    def radiance(self) -> np.ndarray:
        """That of its disc (3,)."""
