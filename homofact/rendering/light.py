"""Light that falls on the sphere: directional lights and lat-long environment maps.

World frame: x to the right, y up, z towards the viewer's default place.

Lat-long map: row 0 on top is +y, the last row −y; the middle column looks along −z, which is what a
viewer at +z sees behind the sphere, and columns to its right turn towards +x:
column/columns = 1/2 + atan2(x, −z)/2π, row/rows = atan2(√(x² + z²), y)/π. Each texel holds constant radiance over its
solid angle, Δφ·Δcosθ, which makes drawing from the map and its density exact.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property

import torch
from torch import Tensor

from homofact.errors import BadInput

# Of radiance and of irradiance, in whatever unit: squares and sums of it are numbers in float32 too. The sun in cd/m²
# has 1.6e9; light whose brightest place is below the least is none in float32.
MOST_LIGHT, LEAST_LIGHT = 1e12, 1e-12


@dataclass(frozen=True)
class DirectionalLight:
    """Parallel light from one direction.

    `direction` points from the sphere to the light, world frame, any length above 0. `radiance` is the
    factor L in f·cosθi·L: the irradiance on a surface that faces the light; one number or one a channel.
    """

    direction: tuple[float, float, float]
    radiance: float | tuple[float, ...] = math.pi

    def __post_init__(self) -> None:
        """Refuse a direction without length, and light that is negative or without bound."""
        length = math.hypot(*self.direction)
        if len(self.direction) != 3 or not 0 < length < math.inf:
            raise BadInput(where="light direction", found=self.direction, expected="3 finite numbers, not all 0")
        if not all(0 <= value <= MOST_LIGHT for value in self.levels()):
            raise BadInput(where="light radiance", found=self.radiance, expected=f"numbers from 0 to {MOST_LIGHT:g}")

    def levels(self) -> tuple[float, ...]:
        """Return `radiance` as a tuple of one number or one a channel."""
        return self.radiance if isinstance(self.radiance, tuple) else (float(self.radiance),)

    def unit(self) -> Tensor:
        """Return the direction (3,) as a unit vector, float64."""
        direction = torch.tensor(self.direction, dtype=torch.float64)
        return direction / direction.norm()

    def describe(self) -> str:
        """Return a few words for a caption."""
        x, y, z = self.unit().tolist()
        levels = ", ".join(f"{value:.3g}" for value in self.levels())
        return f"directional light from ({x:.2f}, {y:.2f}, {z:.2f}), irradiance {levels}"


@dataclass(frozen=True)
class EnvironmentMap:
    """A lat-long map, laid out as described in the module's docstring.

    `radiance` is (rows, columns, C) float64, linear, ≥ 0, C 1 or 3; `turn` radians turn the whole
    surroundings about +y, from +z towards +x; `name` is for captions.
    """

    radiance: Tensor
    turn: float = 0.0
    name: str = "environment"

    def __post_init__(self) -> None:
        """Refuse another shape, radiance that is negative or without bound, and a map without any light."""
        shape = tuple(self.radiance.shape)
        if len(shape) != 3 or shape[2] not in (1, 3) or min(shape) < 1:
            raise BadInput(f"radiance has shape {shape}", where=self.name, expected="(rows, columns, 1 or 3)")
        for what, bad in (("not finite", ~torch.isfinite(self.radiance)), ("negative", self.radiance < 0)):
            if bool(bad.any()):
                row, column, _ = bad.nonzero()[0].tolist()
                where = f"pixel row {row}, column {column}"
                raise BadInput(f"{where} is {what}", where=self.name, expected="finite radiance >= 0")
        if not bool(self.radiance.any()):
            raise BadInput("every pixel is 0", where=self.name, expected="some light")
        brightest = float(self.radiance.max())
        if not LEAST_LIGHT <= brightest <= MOST_LIGHT:
            found, wanted = f"the brightest radiance is {brightest:.3g}", f"{LEAST_LIGHT:g} to {MOST_LIGHT:g}"
            raise BadInput(found, where=self.name, expected=wanted, hint="an EXPOSURE line scales a .hdr file")

    @classmethod
    def constant(cls, level: float = 1.0, rows: int = 8) -> "EnvironmentMap":
        """Return the same radiance from everywhere (a furnace)."""
        return cls(torch.full((rows, 2 * rows, 1), float(level), dtype=torch.float64), name="constant")

    def turned(self, angle: float) -> "EnvironmentMap":
        """Return the surroundings turned about +y by `angle` radians, from +z towards +x."""
        return replace(self, turn=self.turn + angle)

    def describe(self) -> str:
        """Return a few words for a caption."""
        turned = f" turned by {math.degrees(self.turn):.0f}°" if self.turn else ""
        return f"environment {self.name}{turned}"

    def look_up(self, directions: Tensor) -> tuple[Tensor, Tensor]:
        """Return radiance (..., C) and the density (...) of `draw` in sr⁻¹, of unit world directions (..., 3)."""
        rows, columns, channels = self.radiance.shape
        x, y = self._place(directions)
        column, row = x.to(torch.int64).clamp(0, columns - 1), y.to(torch.int64).clamp(0, rows - 1)
        texel = row * columns + column
        level = self.radiance.reshape(-1, channels)
        return level[texel], self._means[texel] / self._running[-1]

    def between(self, directions: Tensor) -> Tensor:
        """Return radiance (..., C) in unit world directions (..., 3), interpolated between texel centres.

        Use it for backgrounds, where texels would be visible. For lighting, use `look_up`.
        """
        rows, columns, _ = self.radiance.shape
        x, y = self._place(directions.to(self.radiance))
        x, y = x - 0.5, (y - 0.5).clamp(0, rows - 1)
        left, upper = x.floor(), y.floor()
        columns_at = [torch.remainder(left + k, columns).to(torch.int64) for k in (0, 1)]
        rows_at = [(upper + k).clamp_max(rows - 1).to(torch.int64) for k in (0, 1)]
        along, down = (x - left)[..., None], (y - upper)[..., None]
        above, below = (
            torch.lerp(self.radiance[row, columns_at[0]], self.radiance[row, columns_at[1]], along) for row in rows_at
        )
        return torch.lerp(above, below, down)

    def _place(self, directions: Tensor) -> tuple[Tensor, Tensor]:
        """Where directions (..., 3) lie on the map, in texels from its corner: column and row (...)."""
        rows, columns, _ = self.radiance.shape
        turns = (torch.atan2(directions[..., 0], -directions[..., 2]) + self.turn) / (2 * torch.pi) + 0.5
        colatitude = torch.atan2(torch.hypot(directions[..., 0], directions[..., 2]), directions[..., 1]) / torch.pi
        return torch.remainder(turns, 1.0) * columns, colatitude * rows

    def draw(self, points: Tensor) -> Tensor:
        """Return unit world directions (..., 3) of points (..., 2) of the unit square.

        Their density is the map's radiance (mean of the channels) over its integral: the first coordinate picks the
        texel by the cumulative sum, and the position along the row. The second coordinate picks the position across the
        row, uniform in solid angle.
        """
        rows, columns, _ = self.radiance.shape
        running = self._running
        target = points[..., 0].contiguous() * running[-1]
        texel = torch.searchsorted(running, target, right=True).clamp_max(rows * columns - 1)
        below = torch.where(texel > 0, running[(texel - 1).clamp_min(0)], torch.zeros_like(target))
        width = (running[texel] - below).clamp_min(torch.finfo(torch.float64).tiny)
        along = ((target - below) / width).clamp(0, 1)
        azimuth = ((texel % columns + along) / columns - 0.5) * (2 * torch.pi) - self.turn
        row = texel // columns
        upper, lower = torch.cos(row * (torch.pi / rows)), torch.cos((row + 1) * (torch.pi / rows))
        y = upper + (lower - upper) * points[..., 1]
        around = (1 - y**2).clamp_min(0).sqrt()
        return torch.stack((around * torch.sin(azimuth), y, -around * torch.cos(azimuth)), -1)

    @cached_property
    def _means(self) -> Tensor:
        """Mean radiance of the channels of every texel, flat."""
        return self.radiance.mean(2).reshape(-1)

    @cached_property
    def _running(self) -> Tensor:
        """The running sum of mean radiance times solid angle over the texels, flat."""
        rows, columns, _ = self.radiance.shape
        edges = torch.cos(torch.arange(rows + 1, dtype=torch.float64) * (torch.pi / rows))
        angle = (edges[:-1] - edges[1:]) * (2 * torch.pi / columns)
        return (self._means.reshape(rows, columns) * angle[:, None]).reshape(-1).cumsum(0)


Light = DirectionalLight | EnvironmentMap

# Upper right, 45° from the viewer: the terminator, a highlight and the grazing upper right limb all show.
DEFAULT_LIGHT = DirectionalLight((0.5, 0.5, 0.70710678))
