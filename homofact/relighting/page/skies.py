"""The light of the page: an exact cube map of the unrotated sky, and a smaller lat-long picture to rotate."""

from dataclasses import dataclass

import numpy as np
import torch

from homofact.relighting import cube
from homofact.rendering.light import EnvironmentMap
from homofact.web.packing import halves


@dataclass(frozen=True)
class PageSky:
    """A sky that the page can be lit by.

    `cube` (6, n, n, 3) is the radiance of the unrotated sky, under which the errors are measured. `picture` (rows,
    columns, 3) is lat-long as in `rendering.light`; the page rotates it and shows it behind the object. Both are
    float32 with values that half floats times one scale represent exactly (`halves`), so the measured light is that of
    the page.
    """

    name: str
    cube: np.ndarray
    picture: np.ndarray

    def environment(self, turn: float = 0.0) -> EnvironmentMap:
        """Return the picture as a light rotated by `turn` radians; the page makes its rotated cube map from it."""
        return EnvironmentMap(torch.from_numpy(self.picture.astype(np.float64)), turn, self.name)


def page_sky(name: str, light: EnvironmentMap, size: int) -> PageSky:
    """Return the sky of an environment map for transport on cube maps of `size` texels along a face.

    The picture has at least four rows per texel along a face, if the map has them, so that a rotation loses no detail
    that the cube map can store.
    """
    own = light.radiance.expand(-1, -1, 3).numpy()
    # The picture begins as the light stands, to half a texel; the cube map is exact.
    own = np.roll(own, -round(light.turn / (2 * np.pi) * own.shape[1]), 1)
    return PageSky(name, rounded(cube.environment_cube(light, size)), rounded(reduced(own, 4 * size)))


def reduced(picture: np.ndarray, rows: int) -> np.ndarray:
    """Average blocks of texels by solid angle, in the largest blocks that leave `rows` or more rows."""
    height, width, _ = picture.shape
    factor = max(height // rows, 1)
    while height % factor or width % factor:
        factor -= 1
    edges = np.cos(np.arange(height + 1) * (np.pi / height))
    weight = (edges[:-1] - edges[1:]).reshape(-1, factor, 1, 1, 1)
    blocks = picture.reshape(height // factor, factor, width // factor, factor, 3)
    return (blocks * weight).sum((1, 3)) / (weight.sum(1)[..., 0] * factor)


def rounded(values: np.ndarray) -> np.ndarray:
    """Return the values (float32) after rounding by `halves`."""
    stored, scale = halves(values)
    return stored.astype(np.float32) * np.float32(scale)
