"""The test scene of representations: lit spheres from random views, evaluated at nodes instead of pixels.

`VIEWS` views lie evenly round the sphere (a spiral of equal areas), turned at random by a seed. The nodes of a view are
`NODES` normals in a spiral, evenly spaced in cosθo so that the rim has nodes too, plus a patch of nodes around the
reflection of each small light. Only the outermost quarter percent of the disc, cosθo < `RIM`, which no picture
resolves, has no nodes. The rings of a patch grow like t⁴, so the patch integrates a highlight of any width with any
number of nodes. A smooth window, 1 up to `WINDOW[0]` and 0 beyond `WINDOW[1]`, blends the two sets. Each node's
`weight` is its share of the disc. Small lights are directional lights, and texels of a map that each contain `SPOT` of
its flux.

Directional lights are evaluated at the nodes, environments by `rendering.filtered`, which draws no directions and so
makes no noise. From afar, `pixels` across the sphere, radiance is averaged over the nodes of each pixel: a pixel then
blurs the normals that it covers.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch
from torch import Tensor

from homofact.brdf.analytic.lambert import Lambert
from homofact.brdf.reflectance import Reflectance
from homofact.geometry.directions import from_cosine
from homofact.rendering.filtered import FilteredMaterial, Surroundings
from homofact.rendering.light import DirectionalLight, EnvironmentMap
from homofact.rendering.lobe_patches import COARSE
from homofact.rendering.surface import shader, sphere_frames, view_axes
from homofact.scene.lighting import Lighting, solid_angles, texel_directions

VIEWS, NODES = 12, 400
WINDOW = (math.radians(4.0), math.radians(12.0))
_RINGS, _SPOKES = 16, 16
RIM = 0.05
_SHIFTS = ((0.0, 0.0), (0.5, 0.0), (0.0, 0.5), (0.5, 0.5))
SPOT = 0.05
_MOST_SPOTS = 4
_TURN = math.pi * (3 - math.sqrt(5))
Direction = tuple[float, float, float]


@dataclass(frozen=True)
class SphereView:
    """Nodes N of the sphere seen from one direction.

    `direction` to the viewer in the world; `normals` (N, 3) in the world, with their `frames` (N, 3, 3) and the viewer
    `wo` (N, 3) in these; `places` (N, 2) on the disc, `weights` (N,) of sum 1; `surroundings`, one an environment.
    """

    direction: Direction
    normals: Tensor
    frames: Tensor
    wo: Tensor
    places: Tensor
    weights: Tensor
    surroundings: tuple[Surroundings, ...]

    @classmethod
    def of(cls, direction: Direction, lighting: Lighting, nodes: int = NODES) -> "SphereView":
        """Return the nodes for a lighting."""
        axes = view_axes(direction)
        normals, rest = _spread(nodes)
        normals = normals @ axes
        parts: list[tuple[Tensor, Tensor]] = []
        before: list[Tensor] = []
        for towards in spots(lighting):
            half = towards + axes[2]
            if float(half.norm()) < 1e-6:
                continue
            half = half / half.norm()
            rest = rest * (1 - _window(normals, half))
            own, solid = _patch(half)
            weight = solid * (own @ axes[2]).clamp_min(0) / math.pi * _window(own, half)
            # Where patches overlap, the first has the light.
            for other in before:
                weight = weight * (1 - _window(own, other))
            parts.append((own, weight))
            before.append(half)
        normals, weights = (torch.cat(pieces) for pieces in zip((normals, rest), *parts, strict=True))
        kept = (weights > 0) & (normals @ axes[2] > 0)
        normals, weights = normals[kept], weights[kept]
        frames, wo = sphere_frames(normals, axes[2])
        seen = normals @ axes.T
        around = tuple(
            Surroundings.at_normals(light, normals, direction, COARSE)
            for light in lighting.lights
            if isinstance(light, EnvironmentMap)
        )
        return cls(direction, normals, frames, wo, seen[:, :2], weights / weights.sum(), around)

    def blurred(self, radiance: Tensor, pixels: int | None) -> tuple[Tensor, Tensor]:
        """Return (radiance (P, C), weights (P,)) averaged over each of `pixels` across; the nodes' own if None."""
        if pixels is None:
            return radiance, self.weights
        # Where a highlight is narrower than a pixel, it counts on how many it falls: four grids, half a pixel apart.
        places = (self.places + 1) * (pixels / 2)
        column, row = torch.cat([places + places.new_tensor(shift) for shift in _SHIFTS]).floor().T
        grid = torch.arange(len(_SHIFTS)).repeat_interleave(len(places))
        _, owner = torch.unique((grid * (pixels + 2) + row) * (pixels + 2) + column, return_inverse=True)
        count = int(owner.max()) + 1
        own = self.weights.repeat(len(_SHIFTS)) / len(_SHIFTS)
        weights = torch.zeros(count, dtype=torch.float64).index_add(0, owner, own)
        summed = torch.zeros(count, radiance.shape[1], dtype=torch.float64)
        light = radiance.repeat(len(_SHIFTS), 1) * own[:, None]
        return summed.index_add(0, owner, light) / weights[:, None], weights


@dataclass(frozen=True)
class Stage:
    """A lighting and the views under it; one stage serves all materials."""

    lighting: Lighting
    views: tuple[SphereView, ...]

    @classmethod
    def of(cls, lighting: Lighting, seed: int = 0, views: int = VIEWS, nodes: int = NODES) -> "Stage":
        """Return `views` views turned by `seed`."""
        return cls(lighting, tuple(SphereView.of(each, lighting, nodes) for each in drawn_views(views, seed)))

    @cached_property
    def above_nine_terms(self) -> tuple[Tensor, ...]:
        """Return the irradiance (N, C) at each view's normals beyond the nine terms of the harmonics."""
        light = self.lighting
        return tuple(light.irradiance(view.normals, None) - light.irradiance(view.normals, 2) for view in self.views)

    def white(self, channels: tuple[str, ...]) -> list[Tensor]:
        """Return `draw` of a white diffuse sphere, computed once for all materials."""
        if channels not in self._white:
            self._white[channels] = self.draw(Lambert((1.0,) * len(channels), channels=channels))
        return self._white[channels]

    @cached_property
    def _white(self) -> dict[tuple[str, ...], list[Tensor]]:
        return {}

    def draw(self, reflectance: Reflectance) -> list[Tensor]:
        """Return the radiance (N, C) at the nodes of each view, C 1 or 3. Raises BadInput where it is not finite."""
        shade = shader(reflectance, None)
        materials: list[FilteredMaterial] = []
        drawn = []
        for view in self.views:
            total = _directional(shade, self.lighting, view)
            if view.surroundings:
                # Seen alike from every side, unless it is anisotropic: then it is asked for each view.
                if not materials or materials[0].lobe.flux.shape[1] > 1:
                    materials = [FilteredMaterial.of(reflectance, view=view.direction, fineness=COARSE)]
                for around in view.surroundings:
                    total = total + materials[0].under(around).radiance[0]
            drawn.append(total)
        return drawn


def drawn_views(count: int, seed: int) -> list[Direction]:
    """Return unit directions spread evenly over the sphere, turned at random."""
    number = torch.arange(count, dtype=torch.float64)
    even = from_cosine(1 - (2 * number + 1) / count, number * _TURN)
    generator = torch.Generator().manual_seed(seed)
    turn, triangle = torch.linalg.qr(torch.randn(3, 3, dtype=torch.float64, generator=generator))
    x, y, z = (even @ (turn * triangle.diagonal().sign())).T.tolist()
    return list(zip(x, y, z, strict=True))


def spots(lighting: Lighting) -> list[Tensor]:
    """Return unit directions (3,) to the small lights, the brightest of maps first."""
    directions = []
    for light in lighting.lights:
        if isinstance(light, DirectionalLight):
            if any(light.levels()):
                directions.append(light.unit())
            continue
        rows, columns = light.radiance.shape[:2]
        flux = light.radiance.mean(2).reshape(-1) * solid_angles(rows, columns)
        bright = (flux > SPOT * flux.sum()).nonzero()[:, 0]
        bright = bright[flux[bright].argsort(descending=True)][:_MOST_SPOTS]
        directions += list(texel_directions(rows, columns, light.turn)[bright])
    return directions


def _spread(count: int) -> tuple[Tensor, Tensor]:
    """Return normals (N, 3) about z and their shares of the disc."""
    number = torch.arange(count, dtype=torch.float64)
    height = RIM + (1 - RIM) * (1 - (number + 0.5) / count)
    return from_cosine(height, number * _TURN), height / height.sum()


def _patch(axis: Tensor) -> tuple[Tensor, Tensor]:
    """Return normals (M, 3) within the window around `axis` (3,), and their solid angles."""
    nodes, weights = np.polynomial.legendre.leggauss(_RINGS)
    t = torch.from_numpy((nodes + 1) / 2).repeat_interleave(_SPOKES)
    step = torch.from_numpy(weights / 2).repeat_interleave(_SPOKES) * (2 * math.pi / _SPOKES)
    theta = WINDOW[1] * t**4
    turn = (torch.arange(_SPOKES, dtype=torch.float64) + 0.5).repeat(_RINGS) * (2 * math.pi / _SPOKES)
    sine = torch.sin(theta)
    local = torch.stack((sine * torch.cos(turn), sine * torch.sin(turn), torch.cos(theta)), 1)
    solid = sine * WINDOW[1] * 4 * t**3 * step
    return local @ view_axes((float(axis[0]), float(axis[1]), float(axis[2]))), solid


def _window(normals: Tensor, axis: Tensor) -> Tensor:
    """Return the window weights m (N,) of normals (N, 3), by their angle to `axis`."""
    angle = 2 * torch.asin(((normals - axis).norm(dim=1) / 2).clamp(max=1))
    x = ((WINDOW[1] - angle) / (WINDOW[1] - WINDOW[0])).clamp(0, 1)
    return x * x * (3 - 2 * x)


def _directional(shade: Callable[[Tensor, Tensor], Tensor], lighting: Lighting, view: SphereView) -> Tensor:
    """Return the radiance (N, C) under the directional lights."""
    total = torch.zeros(len(view.wo), 1, dtype=torch.float64)
    for light in lighting.lights:
        if not isinstance(light, DirectionalLight):
            continue
        wi = view.frames @ light.unit()
        lit = (wi[:, 2] > 0).nonzero()[:, 0]
        levels = torch.tensor(light.levels(), dtype=torch.float64)
        values = shade(wi[lit], view.wo[lit]) * wi[lit, 2:] * levels
        total = total + torch.zeros(len(wi), values.shape[1], dtype=torch.float64).index_copy(0, lit, values)
    return total
