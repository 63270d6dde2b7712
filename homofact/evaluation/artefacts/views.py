"""The small pictures in which homofact looks for artefacts, and the pairs of directions that they need.

Each picture shows a unit sphere in the frame of `rendering.sphere`:

* "lamp": under the default directional light;
* "highlight": the area around the highlight of the same sphere, magnified `ZOOM` times, since a needle through a sharp
  highlight can be thinner than a pixel of the whole picture;
* "sky": under small bright lamps that are scattered over the sphere's front and sides. Some form a row, which acts as
  an edge of light.

The pairs are the same for all materials, so a reflectance is evaluated once for all pictures.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import torch
from torch import Tensor

from homofact.rendering.light import DEFAULT_LIGHT, DirectionalLight
from homofact.rendering.surface import RADIUS, seen_surface

PIXELS = 96
ZOOM = 4
_VIEWER = (0.0, 0.0, 1.0)
_SCATTERED, _IN_A_ROW = 9, 5
# How many times as bright as the dimmest the brightest lamp of the sky is, in doublings.
_DOUBLINGS = 3


@dataclass(frozen=True)
class View:
    """The pixels of one picture, and the pairs of directions that light them.

    Attributes
    ----------
    name : "lamp", "highlight" or "sky".
    inside : (PIXELS, PIXELS) bool, True for the P pixels whose centre lies on the sphere.
    wi, wo : (N, 3), all pairs with light above the horizon.
    pixel : (N,) the pixel that each pair lights, as an index into the P pixels inside, row by row.
    weight : (N,) cosθi times the lamp's irradiance.
    normal : (P, 3) of the pixels, world.
    lights : (K, 3) the lamps' directions, world, the brightest first.
    """

    name: str
    inside: np.ndarray
    wi: Tensor
    wo: Tensor
    pixel: Tensor
    weight: Tensor
    normal: np.ndarray
    lights: np.ndarray

    def radiance(self, values: Tensor) -> Tensor:
        """Return radiance (PIXELS, PIXELS, C) of reflectances (N, C) of the pairs; 0 outside."""
        count = PIXELS * PIXELS
        places = torch.from_numpy(np.flatnonzero(self.inside))[self.pixel]
        found = torch.zeros(count, values.shape[1], dtype=torch.float64)
        return found.index_add(0, places, values * self.weight[:, None]).reshape(PIXELS, PIXELS, -1)


@lru_cache(maxsize=1)
def views() -> tuple[View, ...]:
    """Return the three pictures, made once."""
    whole = _pixels(1, (0.0, 0.0))
    highlight = _highlight(np.array(DEFAULT_LIGHT.unit().tolist()))
    close = _pixels(ZOOM, (float(highlight[0]), float(highlight[1])))
    lamp = [DEFAULT_LIGHT]
    return (_view("lamp", whole, lamp), _view("highlight", close, lamp), _view("sky", whole, sky_lamps()))


def sky_lamps() -> list[DirectionalLight]:
    """Return the lamps of the sky, the brightest first."""
    lamps = []
    for number in range(_SCATTERED):
        # A spiral from above the viewer's head to behind the sphere's rim.
        height = 1 - 1.6 * (number + 0.5) / _SCATTERED
        azimuth = number * (math.pi * (3 - math.sqrt(5))) + 0.7
        across = math.sqrt(1 - height**2)
        level = 2.0 ** -(number * 5 % _SCATTERED * _DOUBLINGS / _SCATTERED)
        lamps.append(
            DirectionalLight((across * math.cos(azimuth), across * math.sin(azimuth), height), math.pi * level)
        )
    for number in range(_IN_A_ROW):
        along = -0.15 + 0.06 * number
        lamps.append(DirectionalLight((along, -0.75, 0.65), math.pi / 4))
    return sorted(lamps, key=lambda lamp: -lamp.levels()[0])


def _highlight(light: np.ndarray) -> np.ndarray:
    """The normal (3,) at which a mirror shows the light to the viewer."""
    half = light + np.array(_VIEWER)
    return half / np.linalg.norm(half)


def _pixels(zoom: int, centre: tuple[float, float]) -> tuple[np.ndarray, Tensor, Tensor]:
    """(inside, frames (P, 3, 3), ωo (P, 3)) of a picture `zoom` times as large as the sphere's, about `centre`."""
    size = PIXELS * zoom
    coverage, surface = seen_surface(size, _VIEWER)
    step = 2 / (size * RADIUS)
    column = round((centre[0] + 1 / RADIUS) / step - PIXELS / 2) if zoom > 1 else 0
    row = round((1 / RADIUS - centre[1]) / step - PIXELS / 2) if zoom > 1 else 0
    rows, columns = surface.pixels // size - row, surface.pixels % size - column
    kept = (rows >= 0) & (rows < PIXELS) & (columns >= 0) & (columns < PIXELS)
    kept &= coverage.reshape(-1)[surface.pixels] >= 0.5
    inside = np.zeros((PIXELS, PIXELS), dtype=bool)
    inside[rows[kept].numpy(), columns[kept].numpy()] = True
    return inside, surface.frame[kept], surface.wo[kept]


def _view(name: str, pixels: tuple[np.ndarray, Tensor, Tensor], lamps: list[DirectionalLight]) -> View:
    inside, frame, wo = pixels
    parts = []
    for lamp in lamps:
        wi = frame @ lamp.unit()
        lit = (wi[:, 2] > 0).nonzero()[:, 0]
        parts.append((wi[lit], wo[lit], lit, wi[lit, 2] * lamp.levels()[0]))
    wi, seen, pixel, weight = (torch.cat(each) for each in zip(*parts, strict=True))
    lights = np.array([lamp.unit().tolist() for lamp in lamps])
    return View(name, inside, wi, seen, pixel, weight, frame[:, 2].numpy(), lights)
