"""A lit unit sphere of any reflectance, seen by an orthographic viewer.

World frame: x to the right, y up, z towards the viewer's default place; `view` moves the viewer round
the sphere while lights and material stay. At a point with normal n the tangent is the direction of
increasing azimuth about the world's vertical, t = norm(y × n), and the binormal b = n × t points to the
north pole: continuous everywhere but at the two poles, which lie on the silhouette of a level view. A
brushed material is therefore brushed along the parallels, as if turned on a lathe.

Radiance = f(ωi, ωo)·cosθi·L summed over lights. Every covered pixel is shaded once, at the centre of its
covered part; coverage, the share of its 8 × 8 points that hit the sphere, smooths the silhouette.

An environment is integrated with the multi-sample balance heuristic (Veach and Guibas 1995, eq. 14) over
three sets of directions: half drawn from the map, a quarter from the cosine, a quarter by mirroring ωo
at half vectors with density (e + 1)/2π·cosᵉθh. No set depends on the reflectance, so a source and its fits use the same
directions, and their difference contains no independent sampling noise.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import torch
from torch import Tensor

from homofact.brdf.reflectance import Reflectance
from homofact.errors import BadInput
from homofact.rendering.light import DEFAULT_LIGHT, DirectionalLight, EnvironmentMap, Light
from homofact.rendering.surface import Surface, ToRgb, seen_surface, shader

_HALF_EXPONENT = 200.0


class SphereImage(NamedTuple):
    """Linear `radiance` (H, W, C), C 1 or 3, not multiplied by `coverage` (H, W) in [0, 1]; float64."""

    radiance: Tensor
    coverage: Tensor


def render_sphere(
    reflectance: Reflectance,
    light: Light | Sequence[Light] = DEFAULT_LIGHT,
    size: int = 256,
    *,
    view: tuple[float, float, float] = (0.0, 0.0, 1.0),
    to_rgb: ToRgb | None = None,
    samples: int = 256,
    seed: int = 0,
    batch: int = 1 << 17,
) -> SphereImage:
    """Return the sphere in size × size pixels, its radius 0.94 of half the picture.

    `to_rgb` turns reflectances (N, C) into (N, 3) linear sRGB, as a (3, C) matrix or a callable; it is
    needed where C is neither 1 nor 3. `samples` directions a pixel integrate an environment, drawn by
    `seed`; `batch` bounds the pairs of directions evaluated at a time. Raises BadInput for a size below
    8, fewer than 8 samples, channels that do not fit, and reflectances that are not finite.
    """
    if samples < 8:
        raise BadInput(where="environment samples", found=samples, expected="at least 8")
    coverage, surface = seen_surface(size, view)
    lights = [light] if isinstance(light, DirectionalLight | EnvironmentMap) else list(light)
    if not lights:
        raise BadInput(where="lights", found="none", expected="at least one")
    shade = shader(reflectance, to_rgb)
    channels = int(shade(surface.wo[:1], surface.wo[:1]).shape[1])
    for emitter in lights:
        levels = len(emitter.levels()) if isinstance(emitter, DirectionalLight) else int(emitter.radiance.shape[2])
        if channels == 1 and levels > 1:
            channels = levels
        if levels not in (1, channels):
            raise BadInput(where="light", found=f"{levels} channels", expected=f"1 or the picture's {channels}")
    radiance = torch.zeros(size * size, channels, dtype=torch.float64)
    for emitter in lights:
        if isinstance(emitter, DirectionalLight):
            radiance[surface.pixels] += _directional(shade, emitter, surface, batch)
        else:
            radiance[surface.pixels] += _environment(shade, emitter, surface, samples, seed, batch)
    return SphereImage(radiance.reshape(size, size, channels), coverage)


def _directional(
    shade: Callable[[Tensor, Tensor], Tensor], light: DirectionalLight, surface: Surface, batch: int
) -> Tensor:
    """Return the radiance (P, C) under one directional light; 0 where the light is below the horizon."""
    wi = surface.frame @ light.unit()
    lit = (wi[:, 2] > 0).nonzero()[:, 0]
    levels = torch.tensor(light.levels(), dtype=torch.float64)
    parts = [shade(wi[part], surface.wo[part]) * wi[part, 2:] * levels for part in lit.split(batch)]
    if not parts:
        return torch.zeros(wi.shape[0], 1, dtype=torch.float64)
    values = torch.cat(parts)
    return torch.zeros(wi.shape[0], values.shape[1], dtype=torch.float64).index_copy(0, lit, values)


def _environment(
    shade: Callable[[Tensor, Tensor], Tensor],
    light: EnvironmentMap,
    surface: Surface,
    samples: int,
    seed: int,
    batch: int,
) -> Tensor:
    """Radiance (P, C) under an environment: Σ f cosθi L / Σs ns ps over the three sets' directions."""
    points = torch.quasirandom.SobolEngine(2, scramble=True, seed=seed).draw(samples, dtype=torch.float64)
    # Each pixel's set is shifted on the torus, so that what is left of the error is grain, not false edges.
    generator = torch.Generator().manual_seed(seed)
    shifts = torch.rand(len(surface.pixels), 1, 2, dtype=torch.float64, generator=generator)
    # Whole blocks of the sequence: each set is then spread evenly by itself, which every fourth point is not.
    from_map, from_cosine = samples // 2, samples // 4
    sizes = (from_map, from_cosine, samples - from_map - from_cosine)
    parts = []
    for rows in torch.arange(len(surface.pixels)).split(max(1, batch // samples)):
        frame, wo = surface.frame[rows], surface.wo[rows]
        moved = torch.remainder(points + shifts[rows], 1.0)
        first, second, third = moved.split(sizes, 1)
        wi = torch.cat((light.draw(first) @ frame.transpose(1, 2), _cosine(second), _mirrored(third, wo)), 1)
        radiance, density = light.look_up(wi @ frame)
        half = wi + wo[:, None]
        half = half / half.norm(dim=2, keepdim=True).clamp_min(1e-12)
        towards = (half * wo[:, None]).sum(2).clamp_min(1e-12)
        power = half[..., 2].clamp_min(0) ** _HALF_EXPONENT
        lobe = (_HALF_EXPONENT + 1) / (2 * torch.pi) * power / (4 * towards)
        cosine = wi[..., 2].clamp_min(0)
        total = sizes[0] * density + sizes[1] * cosine / torch.pi + sizes[2] * lobe
        weight = torch.where(cosine > 0, cosine / total.clamp_min(torch.finfo(torch.float64).tiny), cosine)
        pixel, which = (weight > 0).nonzero(as_tuple=True)
        values = shade(wi[pixel, which], wo[pixel]) * radiance[pixel, which] * weight[pixel, which, None]
        parts.append(torch.zeros(len(rows), values.shape[1], dtype=torch.float64).index_add(0, pixel, values))
    return torch.cat(parts)


def _cosine(points: Tensor) -> Tensor:
    """Local directions (..., 3) with density cosθ/π of points (..., 2) (Malley's construction)."""
    radius, angle = points[..., 0].sqrt(), points[..., 1] * (2 * torch.pi)
    z = (1 - points[..., 0]).sqrt()
    return torch.stack((radius * torch.cos(angle), radius * torch.sin(angle), z), -1)


def _mirrored(points: Tensor, wo: Tensor) -> Tensor:
    """Directions (P, S, 3): ωo (P, 3) mirrored at half vectors of the power density; some point down."""
    z = (1 - points[..., 0]) ** (1 / (_HALF_EXPONENT + 1))
    around, angle = (1 - z**2).clamp_min(0).sqrt(), points[..., 1] * (2 * torch.pi)
    half = torch.stack((around * torch.cos(angle), around * torch.sin(angle), z), -1)
    return 2 * (half * wo[:, None]).sum(2, keepdim=True) * half - wo[:, None]
