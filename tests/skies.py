"""Skies whose averages are known or hard, directions and reflectances made up for the tests of lighting by them."""

import math
from functools import cache

import torch
from torch import Tensor

from homofact.geometry.directions import normalize
from homofact.rendering.light import EnvironmentMap
from homofact.rendering.sky_chain import SkyChain, chain_of


class Planted:
    """A reflectance of one channel, from a function."""

    channels, nbytes, fetches = ("Y",), 0, 0

    def __init__(self, function) -> None:
        self.function = function

    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        return self.function(wi, wo)[:, None] * ((wi[:, 2:] > 0) & (wo[:, 2:] > 0))


LAMBERT = Planted(lambda wi, wo: torch.full_like(wi[:, 0], 0.6 / math.pi))


def gradient(slope: tuple[float, float, float] = (0.3, 0.4, -0.2), rows: int = 64) -> EnvironmentMap:
    """L = 1 + slope · ω, thrice, brighter by channel."""
    theta = (torch.arange(rows, dtype=torch.float64) + 0.5) * (math.pi / rows)
    around = ((torch.arange(2 * rows, dtype=torch.float64) + 0.5) / (2 * rows) - 0.5) * (2 * math.pi)
    t, a = torch.meshgrid(theta, around, indexing="ij")
    w = torch.stack((t.sin() * a.sin(), t.cos(), -t.sin() * a.cos()), -1)
    level = 1 + w @ w.new_tensor(slope)
    return EnvironmentMap(torch.stack((level, 2 * level, 3 * level), 2), name="gradient.hdr")


def lamps(rows: int = 64) -> EnvironmentMap:
    """A dim sky with a soft lamp, and another."""
    sky = gradient((0.1, 0.3, 0.0), rows)
    level, k = sky.radiance.clone(), rows // 64
    level[14 * k : 22 * k, 80 * k : 100 * k] += 25
    level[30 * k : 40 * k, 20 * k : 30 * k] += 8
    return EnvironmentMap(level, name="lamps.hdr")


def normals(count: int = 400) -> tuple[Tensor, Tensor]:
    """(n, ωo) of unit directions all over the sphere, the viewer above each."""
    generator = torch.Generator().manual_seed(1)
    n, wo = (normalize(torch.randn(count, 3, dtype=torch.float64, generator=generator)) for _ in range(2))
    return n, torch.where((n * wo).sum(1, keepdim=True) > 0, wo, -wo)


SKIES = {
    "lamps": lamps,
    "lamps, turned": lambda: lamps().turned(0.5),
    "lamps, upside down": lambda: EnvironmentMap(lamps().radiance.flip(1)),
    "gradient": gradient,
    "constant": lambda: EnvironmentMap.constant(2.0),
}


@cache
def chain(name: str = "lamps", side: int = 32) -> SkyChain:
    """The chain of one of these skies, made once a process."""
    return chain_of(SKIES[name](), side)
