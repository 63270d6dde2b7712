"""The quotient over a triangle of light, evaluated at as many points as the material needs.

∫ ρ_q cosθi dω over a triangle is its solid angle times the mean over points: the centres of its parts, weighted by
their solid angles. One point, the centre, is enough for a quotient that hardly changes within a triangle. A quotient
with a highlight, such as that of a fit, needs more points. Some pixels of every term determine how often its triangles
are divided: until another division changes their light by less than `TOLERANCE`, up to `MOST_POINTS`. Rays go to the
triangles' centres alone, and bands are divided over the whole triangle (`overlap`).
"""

from dataclasses import dataclass

import numpy as np
import torch

from homofact.editing.lights import TriangleLights, triangle_solid_angles
from homofact.editing.material import Editable, EditableTerm
from homofact.editing.reaching import Reaching
from homofact.errors import BadInput
from homofact.scene.visibility import VisiblePixels

TOLERANCE, MOST_POINTS, MOST_DIVIDED = 2e-3, 1 << 14, 2
_PAIRS = 1 << 18


@dataclass(frozen=True)
class LightPoints:
    """n = 4^`divided` points (M, n, 3), unit, of each triangle, and their shares (M, n) of its solid angle."""

    divided: int
    points: np.ndarray
    shares: np.ndarray

    @classmethod
    def of(cls, lights: TriangleLights, divided: int) -> "LightPoints":
        """Return the centres of the parts of triangles that are divided at the midpoints of their edges."""
        corners = lights.vertices[lights.triangles][:, None]
        for _ in range(divided):
            middles = corners[:, :, [1, 2, 0]] + corners[:, :, [2, 0, 1]]
            middles /= np.linalg.norm(middles, axis=-1, keepdims=True)
            a, b, c = (corners[:, :, k] for k in range(3))
            bc, ca, ab = (middles[:, :, k] for k in range(3))
            parts = [np.stack(part, 2) for part in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
            corners = np.concatenate(parts, 1)
        count = corners.shape[1]
        angles = triangle_solid_angles(corners.reshape(-1, 3, 3)).reshape(-1, count)
        points = corners.sum(2)
        points /= np.linalg.norm(points, axis=-1, keepdims=True)
        return cls(divided, points, angles / angles.sum(1, keepdims=True))


def lit(
    pixels: VisiblePixels, lights: TriangleLights, points: LightPoints, reaching: Reaching, material: Editable,
    term: EditableTerm,
) -> np.ndarray:  # fmt: skip
    """L V ρ_q cosθi Ω (S, C) of the light that reaches the pixels.

    Raises BadInput where the quotient is negative or not finite.
    """
    owner, numbers = reaching.owner, reaching.numbers
    found = np.empty((len(owner), lights.channels))
    count = points.points.shape[1]
    for begin in range(0, len(owner), max(1, _PAIRS // count)):
        own = slice(begin, begin + max(1, _PAIRS // count))
        pixel, light = owner[own], numbers[own]
        wi = np.einsum("pij,pnj->pni", pixels.frames[pixel], points.points[light]).reshape(-1, 3)
        # What dips below the horizon gives nothing; the quotient is asked where it is known.
        weight = points.shares[light] * np.maximum(wi[:, 2].reshape(-1, count), 0)
        wi[wi[:, 2] <= 0] = (0.0, 0.0, 1.0)
        wo = pixels.wo[pixel].repeat(count, 0)
        values = term.quotient(torch.from_numpy(wi), torch.from_numpy(wo))
        bad = ~torch.isfinite(values) | (values < 0)
        if bool(bad.any()):
            what = f"the quotient is {float(values[bad][0])} somewhere"
            raise BadInput(what, where=f"{material.name}: {term.name}", expected="finite numbers >= 0")
        mean = np.einsum("pn,pnc->pc", weight, values.numpy().reshape(len(pixel), count, -1))
        found[own] = mean * (lights.solid_angles[light, None] * reaching.radiance[own])
    return found


def enough_points(
    pixels: VisiblePixels, lights: TriangleLights, reaching: Reaching, material: Editable, term: EditableTerm,
    least: int = 0,
) -> LightPoints:  # fmt: skip
    """Return the points that these pixels need for the light that reaches them, divided `least` times or more."""
    before, chosen = None, LightPoints.of(lights, least)
    for divided in range(least, MOST_DIVIDED + 1):
        if divided > least and lights.count * 4**divided > MOST_POINTS:
            break
        points = LightPoints.of(lights, divided)
        each = lit(pixels, lights, points, reaching, material, term)
        now = np.stack([np.bincount(reaching.owner, column, len(pixels)) for column in each.T], 1)
        if before is not None and ((now - before) ** 2).sum() <= TOLERANCE**2 * (now**2).sum():
            break
        before, chosen = now, points
    return chosen
