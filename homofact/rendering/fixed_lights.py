"""Built-in lights without files: a small round lamp, and a sky.

Besides `light.DEFAULT_LIGHT`, homofact uses them for pictures and error measures. The lamp has the direction and
irradiance of `DEFAULT_LIGHT` but is 10° wide, so that a narrow highlight is a disc and not a point. The sky is white
above and dark below, with a lamp 12° wide and a dimmer lamp behind.
"""

import math
from functools import lru_cache

import torch
from torch import Tensor

from homofact.errors import BadInput
from homofact.rendering.light import DEFAULT_LIGHT, EnvironmentMap

LAMP_RADIUS = 5.0  # degrees
_FINER = 4
# World directions of the sky's lamps, their radiance, and κ of exp(κ (cos − 1)).
_LAMPS = (((0.5, 0.6, 0.6245), 8.0, 120.0), ((-0.8, 0.3, -0.5196), 3.0, 20.0))


def sky(directions: Tensor) -> Tensor:
    """Return radiance (...) of the fixed sky from unit world directions (..., 3), y up."""
    height = directions[..., 1]
    level = 0.08 + 0.92 * torch.sigmoid(8 * height)
    for place, radiance, width in _LAMPS:
        level = level + radiance * torch.exp(width * (directions @ directions.new_tensor(place) - 1))
    return level


@lru_cache(maxsize=4)
def sky_map(rows: int = 64) -> EnvironmentMap:
    """Return the fixed sky as a map of rows × 2 rows texels."""
    return EnvironmentMap(sky(directions_of_map(rows))[..., None], name="sky")


@lru_cache(maxsize=4)
def lamp_map(
    direction: tuple[float, float, float] = DEFAULT_LIGHT.direction,
    radius: float = LAMP_RADIUS,
    irradiance: float = math.pi,
    rows: int = 128,
) -> EnvironmentMap:
    """Return a round lamp of even radiance, black around it, as a map of rows × 2 rows texels.

    `direction` points to its middle, of any length above 0; `radius` in degrees, below 90; `irradiance` is the
    irradiance of a surface that faces the lamp. Texels on the edge of the lamp are partly lit. Raises BadInput for
    numbers out of range.
    """
    length = math.hypot(*direction)
    if not (0 < length < math.inf and 0 < radius < 90 and 0 < irradiance < math.inf):
        raise BadInput(
            where="lamp",
            found=f"direction {direction}, radius {radius}°, irradiance {irradiance}",
            expected="a direction, a radius between 0° and 90°, and some light",
        )
    towards = torch.tensor(direction, dtype=torch.float64) / length
    cosine = directions_of_map(rows * _FINER) @ towards
    inside = (cosine >= math.cos(math.radians(radius))).to(torch.float64)

    def averaged(values: Tensor) -> Tensor:
        return values.reshape(rows, _FINER, 2 * rows, _FINER).mean((1, 3))

    edges = torch.cos(torch.arange(rows + 1, dtype=torch.float64) * (math.pi / rows))
    solid = (edges[:-1] - edges[1:])[:, None] * (math.pi / rows)
    facing = float((averaged(inside * cosine) * solid).sum())
    if facing == 0:
        raise BadInput(
            f"a radius of {radius}° falls between the texels of {rows} rows", where="lamp", expected="a larger one"
        )
    level = averaged(inside) * (irradiance / facing)
    return EnvironmentMap(level[..., None], name=f"round lamp of {radius:g}° radius")


def directions_of_map(rows: int) -> Tensor:
    """Unit directions (rows, 2 rows, 3) of the centres of a lat-long map's texels, as `rendering.light` lays it out."""
    theta = (torch.arange(rows, dtype=torch.float64) + 0.5) * (math.pi / rows)
    phi = ((torch.arange(2 * rows, dtype=torch.float64) + 0.5) / (2 * rows) - 0.5) * (2 * math.pi)
    theta, phi = torch.meshgrid(theta, phi, indexing="ij")
    sine = torch.sin(theta)
    return torch.stack((sine * torch.sin(phi), torch.cos(theta), -sine * torch.cos(phi)), -1)
