"""Maps from the upper hemisphere to the texture square, which index the textures of separable fits.

* parabolic: (u, v) = (ωx, ωy)/(1 + ωz), the usual map (`geometry.parabolic`);
* orthographic: (u, v) = (ωx, ωy) (Wang, Tran and Luebke 2004, eq. 7, here in [−1, 1]);
* polar: u = φ/π, v = 2√(1 − ωz) − 1 (ibid., eq. 8); its first and last column are one meridian, and its first
  row is the normal.

Texels are placed as in all textures: coordinate −1 is the centre of the first, +1 of the last. In the two disc maps no
direction reads the texels in the corners. Texels beyond the rim that some direction reads have the value at the nearest
point of the rim. There f is evaluated a little above the horizon (`LEAST_COSINE`), where models that divide by the
cosines are still finite.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from homofact.errors import BadInput
from homofact.geometry import parabolic
from homofact.geometry.axes import map_axes
from homofact.geometry.coordinates import Scales, axes_of
from homofact.separable.decomposition_names import MAP_NAMES, MAP_SCALES

# The cosine of a texel's direction at the rim: 84.3°. Nearer to the horizon (.05, .01), the first terms of
# Ashikhmin-Shirley's matrix go to grazing light, and the cosine-weighted error rises.
LEAST_COSINE = 0.1


@dataclass(frozen=True)
class DirectionMap:
    """A named map: `to_square` takes unit vectors (..., 3) with z ≥ 0 to (..., 2) in [−1, 1]², `from_square` back.

    `axes` are names of `geometry.axes`, and `scales` scales them to coordinates in [−1, 1]. `disc` is True if the
    hemisphere fills the unit disc, False if it fills the square. `from_square` moves points outside the disc to the
    nearest point of the rim. `_density` is dω/(du dv) as a function of the cosine cosθ, up to a constant.
    """

    name: str
    disc: bool
    scales: Scales
    _inverse: Callable[[Tensor], Tensor]
    _density: Callable[[Tensor], Tensor]

    def to_square(self, w: Tensor) -> Tensor:
        """Return points (..., 2) of unit vectors (..., 3), z ≥ 0."""
        return axes_of(map_axes(self.name, "i"), w, w, self.scales)

    def from_square(self, uv: Tensor) -> Tensor:
        """Return unit vectors (..., 3), z ≥ 0, of points (..., 2)."""
        if self.disc:
            radius = uv.norm(dim=-1, keepdim=True)
            uv = uv / radius.clamp_min(1)
        return self._inverse(uv)

    def texel_directions(self, size: int) -> Tensor:
        """Return unit vectors (size², 3) of all texel centres, row by row, z ≥ `LEAST_COSINE`."""
        return raised(self.from_square(texel_centres(size)))

    def texel_weights(self, size: int) -> Tensor:
        """Return the projected solid angles (size²,) of the texels, with mean 1 and at least 1% of the largest."""
        cosine = self.texel_directions(size)[:, 2]
        weights = cosine * self._density(cosine)
        weights = weights.clamp_min(0.01 * float(weights.max()))
        return weights / weights.mean()

    def read(self, size: int) -> Tensor:
        """Return a (size²,) bool array that is True for texels that the bilinear stencil of a direction reads."""
        centres = texel_centres(size)
        if not self.disc:
            return torch.ones(len(centres), dtype=torch.bool)
        # A stencil reaches less than one texel from its point: the nearest such point must be in the open disc.
        nearest = (centres.abs() - 2 / (size - 1)).clamp_min(0)
        return (nearest**2).sum(1) < 1


def texel_centres(size: int) -> Tensor:
    """Return (size², 2) texel centres in [−1, 1]², row by row, the first coordinate along a row."""
    line = torch.linspace(-1, 1, size, dtype=torch.float64)
    return torch.stack((line.repeat(size), line.repeat_interleave(size)), 1)


def raised(w: Tensor) -> Tensor:
    """Return unit vectors (..., 3) with z ≥ `LEAST_COSINE`; lower vectors are raised to it at the same azimuth."""
    flat = w[..., :2]
    length = flat.norm(dim=-1, keepdim=True)
    scale = (1 - LEAST_COSINE**2) ** 0.5 / length.clamp_min(1e-300)
    low = w[..., 2:] < LEAST_COSINE
    return torch.where(low, torch.cat((flat * scale, torch.full_like(length, LEAST_COSINE)), -1), w)


def _from_orthographic(uv: Tensor) -> Tensor:
    return torch.cat((uv, (1 - (uv**2).sum(-1, keepdim=True)).clamp_min(0).sqrt()), -1)


def _from_polar(uv: Tensor) -> Tensor:
    drop = ((uv[..., 1] + 1) / 2) ** 2
    sine = (drop * (2 - drop)).clamp_min(0).sqrt()
    azimuth = uv[..., 0] * math.pi
    return torch.stack((sine * torch.cos(azimuth), sine * torch.sin(azimuth), 1 - drop), -1)


_BY_NAME = {
    each.name: each
    for each in (
        DirectionMap("parabolic", True, MAP_SCALES["parabolic"], parabolic.from_disc, lambda z: (1 + z) ** 2),
        DirectionMap("orthographic", True, MAP_SCALES["orthographic"], _from_orthographic, lambda z: 1 / z),
        DirectionMap("polar", False, MAP_SCALES["polar"], _from_polar, lambda z: (1 - z).clamp_min(0).sqrt()),
    )
}
MAPS = {name: _BY_NAME[name] for name in MAP_NAMES}


def direction_map(name: str) -> DirectionMap:
    """Return the map called `name`. Raises BadInput that lists the names."""
    if name not in MAPS:
        raise BadInput(where="map", found=repr(name), expected=f"one of {', '.join(MAPS)}")
    return MAPS[name]
