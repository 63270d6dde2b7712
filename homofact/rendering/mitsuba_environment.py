"""An environment map as an emitter of Mitsuba 3 with the same light in the same directions.

Mitsuba's `envmap` is bilinear between its values, and its first row lies at the pole. The texels of `rendering.light`
are constant, and the centres of the first row lie half a texel from the pole. To make both emit the same light, each
texel is repeated `times` in both directions, and a row between two texels is their mean: bilinear interpolation then
blurs the edges by half of 1/`times` of a texel to each side, and no light is lost or moved.
"""

import math
from importlib import import_module
from typing import Any

import numpy as np

from homofact.rendering.light import EnvironmentMap

_ROWS = 2048


def environment_emitter(environment: EnvironmentMap) -> Any:
    """The emitter (a `mitsuba.Emitter`) in the variant of the moment, turned as the map is; grey for one channel.

    `times` is 2 to 8, whichever makes about 2048 rows. Mitsuba must have been opened.
    """
    mi = import_module("mitsuba")
    rows, columns, _ = environment.radiance.shape
    count = max(2, min(8, _ROWS // rows))
    place = np.arange(count * rows + 1)
    texels = environment.radiance.numpy()
    upper = texels[((place - 1) // count).clip(0, rows - 1)]
    lower = texels[(place // count).clip(0, rows - 1)]
    values = np.repeat((upper + lower) / 2, count, axis=1)
    # Mitsuba's first column looks along −z, where our middle is.
    values = np.roll(values, -(count * columns) // 2, axis=1)
    rgb = np.ascontiguousarray(np.broadcast_to(values, (*values.shape[:2], 3)), np.float32)
    turned = mi.ScalarTransform4f().rotate([0, 1, 0], math.degrees(environment.turn))
    return mi.load_dict({"type": "envmap", "bitmap": mi.Bitmap(rgb), "to_world": turned})
