"""Three built-in skies for tests of lighting: a room with lamps, an overcast sky and a low sun.

Radiance is linear and has no unit, y is up. None is measured: the overcast sky is the standard one of the CIE, three
times as bright in the zenith as at the horizon (Moon and Spencer 1942), over dark ground; the other two are made as
hard test cases. The room's rectangular lamps have sharp edges and are up to 200 times as bright as its walls, and the
sun is a disc of 3° on a glow.
"""

import math
from collections.abc import Callable
from functools import lru_cache

import torch
from torch import Tensor

from homofact.rendering.fixed_lights import directions_of_map
from homofact.rendering.light import EnvironmentMap

_UP = (0.0, 1.0, 0.0)
# Rectangular lamps: direction, half width and half height as tangents, radiance of R, G, B.
_LAMPS = (
    ((0.3, 1.0, 0.2), (0.35, 0.2), (18.0, 17.1, 15.3)),
    ((-1.0, 0.4, 0.5), (0.15, 0.3), (25.0, 20.0, 15.0)),
    ((0.9, 0.2, -0.6), (0.4, 0.4), (2.1, 2.55, 3.0)),
    ((0.2, 0.5, 1.0), (0.1, 0.1), (40.0, 40.0, 40.0)),
)
_SUN, _SUN_RADIUS = (0.5, 0.12, 0.85), math.radians(1.5)


def _room(d: Tensor) -> Tensor:
    light = (0.15 + 0.1 * d[..., 1:2]).expand_as(d).clone()
    for place, (wide, high), radiance in _LAMPS:
        middle = d.new_tensor(place) / d.new_tensor(place).norm()
        across = torch.linalg.cross(d.new_tensor(_UP), middle)
        across = across / across.norm()
        along = d @ middle
        x, y = (d @ axis / along.clamp_min(1e-6) for axis in (across, torch.linalg.cross(middle, across)))
        inside = (along > 0) & (x.abs() < wide) & (y.abs() < high)
        light += inside[..., None] * d.new_tensor(radiance)
    return light


def _overcast(d: Tensor) -> Tensor:
    height = d[..., 1:2]
    return torch.where(height > 0, (1 + 2 * height) / 3, 0.1) * d.new_tensor((0.95, 1.0, 1.05))


def _sunset(d: Tensor) -> Tensor:
    sun = d.new_tensor(_SUN) / d.new_tensor(_SUN).norm()
    cosine, height = (d @ sun)[..., None], d[..., 1:2]
    low = torch.exp(-4 * height.clamp_min(0))
    above = torch.cat((0.25 + 0.9 * low, 0.3 + 0.45 * low, 0.5 + 0.2 * low), -1) * (0.4 + 0.6 * ((1 + cosine) / 2) ** 2)
    above = above + torch.exp((cosine - 1) / 0.02) * d.new_tensor((6.0, 3.0, 1.2))
    above = above + (cosine > math.cos(_SUN_RADIUS)) * d.new_tensor((900.0, 520.0, 220.0))
    return torch.where(height > 0, above, d.new_tensor((0.1, 0.08, 0.06)))


_MADE: dict[str, Callable[[Tensor], Tensor]] = {"lamp room": _room, "overcast": _overcast, "sunset": _sunset}
MADE_SKIES = tuple(_MADE)


@lru_cache(maxsize=8)
def made_sky(name: str, rows: int = 256) -> EnvironmentMap:
    """Return one of `MADE_SKIES` as a map of rows × 2 rows texels. Raises KeyError for another name."""
    return EnvironmentMap(_MADE[name](directions_of_map(rows)), name=name)
