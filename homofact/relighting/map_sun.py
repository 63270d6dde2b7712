"""The sun in an environment map, taken out of it as a light of its own.

homofact looks for a sun at the map's brightest texel. Texels inside the ring of `RING` degrees around it belong to the
sun if they are more than `CONTRAST` times as bright as the ring's median. There is a sun if their excess over the
median is at least `SHARE` of all light of the map. A small lamp also becomes a sun, since all light of a map is
infinitely far away. The excess is the light of the sun. The direction of the sun is that of the mean flux, and its disc
has the effective solid angle of its texels, (Σe)²/Σ(e²/Ω), e the flux of each. The median stays in the map.
"""

import math

import numpy as np
import torch

from homofact.relighting.sunlight import Sun
from homofact.rendering.light import EnvironmentMap
from homofact.scene.lighting import solid_angles, texel_directions

RING = (9.0, 13.0)
CONTRAST, SHARE, LARGEST = 10.0, 0.05, 7.0


def separate_sun(light: EnvironmentMap, radius: float | None = None) -> tuple[EnvironmentMap, Sun | None]:
    """(The map without its sun, the sun), or the map as it is and None.

    `radius`, in radians, replaces the radius of the disc that the map gives.
    """
    rows, columns, _ = light.radiance.shape
    values = light.radiance.expand(-1, -1, 3).reshape(-1, 3).numpy()
    means, solid = values.mean(1), solid_angles(rows, columns).numpy()
    towards = texel_directions(rows, columns, light.turn).numpy()
    peak = int(means.argmax())
    around = (towards @ towards[peak] > math.cos(math.radians(RING[1]))) & (means > means[peak] / 2)
    middle = (towards[around] * solid[around, None]).sum(0)
    near = towards @ (middle / np.linalg.norm(middle))
    ring = (near < math.cos(math.radians(RING[0]))) & (near > math.cos(math.radians(RING[1])))
    if not ring.any():
        return light, None
    level = np.median(values[ring], axis=0)
    bright = np.flatnonzero((near > math.cos(math.radians(RING[0]))) & (means > CONTRAST * level.mean()))
    if not len(bright):
        return light, None
    flux = (values[bright] - level).clip(0) * solid[bright, None]
    each = flux.mean(1)
    extent = float(each.sum() ** 2 / (each**2 / solid[bright]).sum())
    own = math.acos(1 - extent / (2 * math.pi))
    if each.sum() < SHARE * (means * solid).sum() or own > math.radians(LARGEST):
        return light, None
    direction = (towards[bright] * each[:, None]).sum(0)
    direction /= np.linalg.norm(direction)
    left = values.copy()
    left[bright] = np.minimum(values[bright], level)
    # A map of the sun alone would be dark without it.
    if not left.any():
        return light, None
    rest = torch.from_numpy(left.reshape(rows, columns, 3))
    return EnvironmentMap(rest, light.turn, light.name), Sun(direction, flux.sum(0), own if radius is None else radius)
