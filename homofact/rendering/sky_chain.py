"""One prefiltered chain per sky for all materials: a cube map whose levels average the light over widening lobes.

Level k contains the mean light around every direction, weighted by a power of the cosine (`rendering.chain_kernels`).
The side of each level is half of that before, down to `LAST`. α grows geometrically, from `TEXELS`/side at the first
level to 1 at the last level, which is E(n)/π, the irradiance over π. A lobe is thus some texels wide on every level.
Engines weight by half vectors of GGX, whose long tails no sum of levels can remove. Sums of cosine powers can represent
the tails of measured lobes.

The irradiance is also stored in a separate cube map of `IRRADIANCE` texels per side, as in engines: it has a kink at
normals for which a lamp is on the horizon, and the few texels of the last level would show this kink as steps.

Light is read from the environment's pyramid (`rendering.octahedral`) at points on rings around each texel's direction,
and averaged over the solid angle of each point. Points on a ring are about as far apart as the rings.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from homofact.errors import BadInput
from homofact.linear.kernels import kernel
from homofact.rendering.chain_kernels import ChainKernels
from homofact.rendering.cube import Cube, directions_of
from homofact.rendering.light import EnvironmentMap
from homofact.rendering.octahedral import Pyramid, fetch
from homofact.rendering.sky_harmonics import SkyHarmonics, gains_of

SIDE, LEAST_SIDE, MOST_SIDE = 256, 32, 1024
LAST, TEXELS, IRRADIANCE = 8, 4, 32
# Rings of the first level; finer from level to level, on a quarter of the texels each.
_RINGS, _FINER, _MOST_RINGS = 12, 1.5, 48
_LEAST_SPOKES, _LOST = 6, 1e-5
_STEPS = 64  # of the quadrature in a ring
_LAMPS = (32, 128)
_MOST = 2.0**15  # half floats end at 65504


@dataclass(frozen=True)
class SkyChain:
    """`levels` (6, N, N, 3), largest first, and E/π as `irradiance` (6, IRRADIANCE, IRRADIANCE, 3).

    Both are divided by `factor`, a power of two, so that half floats can represent them. `harmonics` (9, 3) are E/π as
    spherical harmonics (`_irradiance_coefficients`), for engines that use them. `name` is the name of the environment,
    and `kernels` are the kernels of the levels.
    """

    levels: tuple[Tensor, ...]
    irradiance: Tensor
    harmonics: Tensor
    factor: float
    name: str
    kernels: ChainKernels

    @property
    def side(self) -> int:
        """Texels of a side of the first level's faces."""
        return int(self.levels[0].shape[1])

    @property
    def nbytes(self) -> int:
        """Bytes of the texels on a GPU, as RGBA16F."""
        return sum(8 * level.shape[0] * level.shape[1] ** 2 for level in (*self.levels, self.irradiance))

    @cached_property
    def cube(self) -> Cube:
        """Return the levels ready for lookups, still divided by `factor`."""
        return Cube.of(self.levels)

    @cached_property
    def lit(self) -> Cube:
        """Return the irradiance over π, ready for lookups, still divided by `factor`."""
        return Cube.of([self.irradiance])


def check_side(side: int) -> None:
    """Raise BadInput unless a chain can begin with faces of `side` texels per side."""
    if not LEAST_SIDE <= side <= MOST_SIDE or side & (side - 1):
        wanted = f"a power of two from {LEAST_SIDE} to {MOST_SIDE}"
        raise BadInput(where="faces of the sky", found=f"{side} texels per side", expected=wanted)


def sides_of(side: int) -> list[int]:
    """Return the sides of all levels."""
    return [side >> k for k in range(int(math.log2(side // LAST)) + 1)]


def own_kernels(side: int) -> ChainKernels:
    """Return the kernels of our own chain that begins with faces of so many texels. Raises BadInput as `check_side`."""
    check_side(side)
    last = len(sides_of(side)) - 1
    return ChainKernels(tuple((TEXELS / side) ** (1 - k / last) for k in range(last + 1)))


def chain_of(light: EnvironmentMap, side: int = SIDE, kernels: ChainKernels | None = None) -> SkyChain:
    """Return the chain of an environment, by our own kernels unless told otherwise. Raises BadInput as `check_side`."""
    kernels = kernels or own_kernels(side)
    pyramid = Pyramid.of(light, torch.eye(3, dtype=torch.float64))
    levels = []
    for k, own in enumerate(sides_of(side)):
        towards = directions_of(own).reshape(-1, 3).numpy()
        rings = _rings(kernels, k, min(round(_RINGS * _FINER**k), _MOST_RINGS))
        filtered = _filtered(towards, *rings, *pyramid[:3])
        levels.append(torch.from_numpy(filtered).reshape(6, own, own, 3))
    filtered = _filtered(
        directions_of(IRRADIANCE).reshape(-1, 3).numpy(), *_rings(kernels, -1, _MOST_RINGS), *pyramid[:3]
    )
    lit = torch.from_numpy(filtered).reshape(6, IRRADIANCE, IRRADIANCE, 3)
    factor = 2.0 ** max(0, math.ceil(math.log2(max(float(level.max()) for level in levels) / _MOST)))
    return SkyChain(
        tuple(level / factor for level in levels),
        lit / factor,
        _irradiance_coefficients(pyramid),
        factor,
        light.name,
        kernels,
    )


@dataclass(frozen=True)
class FilteredSky:
    """A sky that is filtered at lookup by the `kernels` of a chain, without the chain's limited resolution.

    It is read as a `SkyChain` is: `cube` and `lit` at directions (N, 3) of any length and levels (N,). Wide kernels,
    which few harmonics describe, average the sky by harmonics (`rendering.sky_harmonics`). Narrower kernels read rings
    as the chain does.
    """

    pyramid: Pyramid
    harmonics: SkyHarmonics
    kernels: ChainKernels
    factor: float = 1.0

    @classmethod
    def of(cls, light: EnvironmentMap, kernels: ChainKernels) -> "FilteredSky":
        """Return the filtered sky of an environment."""
        return cls(Pyramid.of(light, torch.eye(3, dtype=torch.float64)), SkyHarmonics.of(light), kernels)

    @property
    def cube(self) -> "FilteredSky":
        """Return the object for lookups at a level."""
        return self

    @property
    def lit(self) -> "_Lit":
        """Return the object for lookups of the irradiance over π, the last level."""
        return _Lit(self)

    def read(self, directions: Tensor, level: Tensor) -> Tensor:
        """Return radiance (N, 3), linear between two levels."""
        last = len(self.kernels.alphas) - 1
        towards = (directions / directions.norm(dim=1, keepdim=True)).numpy()
        place = level.clamp(0, last).numpy()
        light = np.zeros((len(towards), 3))
        for k in range(last + 1):
            share = (1 - np.abs(place - k)).clip(0)
            asked = share > 0
            if asked.any():
                light[asked] += share[asked, None] * self._averaged(k, np.ascontiguousarray(towards[asked]))
        return torch.from_numpy(light)

    def _averaged(self, level: int, towards: np.ndarray) -> np.ndarray:
        """Light (N, 3) of a level round unit directions (N, 3)."""
        gains = gains_of(self.kernels, level)
        if gains is not None:
            return self.harmonics.averaged(gains, towards)
        rings = _rings(self.kernels, level, min(round(_RINGS * _FINER**level), _MOST_RINGS))
        return _filtered(towards, *rings, *self.pyramid[:3])


class _Lit(NamedTuple):
    """The last level of a sky."""

    sky: FilteredSky

    def read(self, directions: Tensor, level: Tensor) -> Tensor:
        """As `FilteredSky.read`, whatever the level."""
        return self.sky.read(directions, torch.full_like(level, len(self.sky.kernels.alphas) - 1.0))


def _irradiance_coefficients(pyramid: Pyramid) -> Tensor:
    """E/π (9, 3) over 1, x, y, z, xy, yz, zx, 3z² − 1, x² − y² (Ramamoorthi and Hanrahan 2001, eq. 12)."""
    places, light = (torch.from_numpy(array).double() for array in pyramid.lamps(*_LAMPS))
    x, y, z = places.unbind(1)
    basis = torch.stack((torch.ones_like(x), x, y, z, x * y, y * z, z * x, 3 * z * z - 1, x * x - y * y), 1)
    # Of each: 4π times its squared norm on the sphere, turned over; and A_l/π of the clamped cosine.
    norms = [1, 3, 3, 3, 15, 15, 15, 1.25, 3.75]
    shares = [1, *[2 / 3] * 3, *[1 / 4] * 5]
    factor = torch.tensor([a * b / (4 * math.pi) for a, b in zip(norms, shares, strict=True)], dtype=torch.float64)
    return basis.T @ light * factor[:, None]


def _rings(kernels: ChainKernels, level: int, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """(shares of flux, angles γ in radians, log2(Ω)/2 of the places' solid angles, numbers of places) of the rings."""
    alpha = max(kernels.alphas[level], kernels.least)
    if kernels.ggx and kernels.least < alpha < 1:
        # Long tails: rings that grow outwards.
        count = min(2 * count, _MOST_RINGS)
        edges = 2 * alpha * np.sinh(np.arange(count + 1) * (math.asinh(math.pi / 4 / alpha) / count))
    else:
        # Where the lobe ends: 1 − cosᵖ⁺¹γ is the flux within γ.
        edges = np.arange(count + 1) * (math.acos(_LOST ** (1 / (alpha**-2 + 1))) / count)
    inner = (np.arange(_STEPS) + 0.5) / _STEPS
    gamma = edges[:-1, None] + (edges[1:] - edges[:-1])[:, None] * inner
    flux = kernels.at(level, gamma) * np.sin(gamma) * (edges[1:] - edges[:-1])[:, None]
    shares = flux.sum(1)
    middle = (flux * gamma).sum(1) / shares
    spokes = np.ceil(2 * math.pi * np.sin(middle) / (edges[1:] - edges[:-1])).clip(_LEAST_SPOKES).astype(np.int64)
    solid = (np.cos(edges[:-1]) - np.cos(edges[1:])) * (2 * math.pi / spokes)
    return shares / shares.sum(), middle, np.log2(solid) / 2, spokes


@kernel(nogil=True, fastmath=True)
def _filtered(towards, shares, middle, wide, spokes, texels, starts, sides):  # pragma: no cover (compiled)
    """Light (N, 3) by shares (R,) of rings at angles `middle` round directions (N, 3), read at `spokes` places."""
    light = np.zeros((len(towards), 3))
    # The places round the pole, the same for all directions: their sines again would take a quarter of the time.
    first = np.zeros(len(shares) + 1, np.int64)
    for ring in range(len(shares)):
        first[ring + 1] = first[ring] + spokes[ring]
    places = np.empty((first[-1], 2))
    for ring in range(len(shares)):
        sine = math.sin(middle[ring])
        for spoke in range(spokes[ring]):
            turn = (spoke + 0.5 * (ring % 2)) * (2 * math.pi / spokes[ring])
            places[first[ring] + spoke, 0] = sine * math.cos(turn)
            places[first[ring] + spoke, 1] = sine * math.sin(turn)
    for k in range(len(towards)):
        x, y, z = towards[k, 0], towards[k, 1], towards[k, 2]
        # Two axes across (Duff et al. 2017).
        sign = 1.0 if z >= 0 else -1.0
        a = -1 / (sign + z)
        b = x * y * a
        ax, ay, az = 1 + sign * x * x * a, sign * b, -sign * x
        bx, by, bz = b, sign + y * y * a, -y
        for ring in range(len(shares)):
            cosine = math.cos(middle[ring])
            red = green = blue = 0.0
            for place in range(first[ring], first[ring + 1]):
                c, s = places[place, 0], places[place, 1]
                u, v, w = cosine * x + c * ax + s * bx, cosine * y + c * ay + s * by, cosine * z + c * az + s * bz
                one, two, three = fetch(texels, starts, sides, u, v, w, wide[ring])
                red += one
                green += two
                blue += three
            share = shares[ring] / spokes[ring]
            light[k, 0] += share * red
            light[k, 1] += share * green
            light[k, 2] += share * blue
    return light
