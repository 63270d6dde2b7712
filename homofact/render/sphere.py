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
at half vectors with density (e + 1)/2π·cosᵉθh. No set depends on the reflectance, so a source and its
fits are shaded from the same directions and their difference holds no sampling noise of its own.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import torch
from torch import Tensor

from homofact.brdf.reflectance import Reflectance
from homofact.errors import BadInput
from homofact.render.light import DEFAULT_LIGHT, DirectionalLight, EnvironmentMap, Light

ToRgb = Tensor | Callable[[Tensor], Tensor]
RADIUS = 0.94
_GRID = 8
_HALF_EXPONENT = 200.0


class SphereImage(NamedTuple):
    """Linear `radiance` (H, W, C), C 1 or 3, not multiplied by `coverage` (H, W) in [0, 1]; float64."""

    radiance: Tensor
    coverage: Tensor


class _Surface(NamedTuple):
    """The P covered pixels: their flat indices, rows t, b, n of the frame in the world, and ωo in that frame."""

    pixels: Tensor
    frame: Tensor
    wo: Tensor


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
    """The sphere in size × size pixels, its radius 0.94 of half the picture.

    `to_rgb` turns reflectances (N, C) into (N, 3) linear sRGB, as a (3, C) matrix or a callable; it is
    needed where C is neither 1 nor 3. `samples` directions a pixel integrate an environment, drawn by
    `seed`; `batch` bounds the pairs of directions evaluated at a time. Raises BadInput for a size below
    8, fewer than 8 samples, channels that do not fit, and reflectances that are not finite.
    """
    if size < 8:
        raise BadInput(f"picture size: found {size}, expected at least 8 pixels")
    if samples < 8:
        raise BadInput(f"environment samples: found {samples}, expected at least 8")
    coverage, surface = _surface(size, view)
    lights = [light] if isinstance(light, DirectionalLight | EnvironmentMap) else list(light)
    if not lights:
        raise BadInput("lights: found none, expected at least one")
    shade = _shader(reflectance, to_rgb)
    channels = int(shade(surface.wo[:1], surface.wo[:1]).shape[1])
    for each in lights:
        levels = len(each.levels()) if isinstance(each, DirectionalLight) else int(each.radiance.shape[2])
        if channels == 1 and levels > 1:
            channels = levels
        if levels not in (1, channels):
            raise BadInput(f"light: found {levels} channels, expected 1 or the picture's {channels}")
    radiance = torch.zeros(size * size, channels, dtype=torch.float64)
    for each in lights:
        if isinstance(each, DirectionalLight):
            radiance[surface.pixels] += _directional(shade, each, surface, batch)
        else:
            radiance[surface.pixels] += _environment(shade, each, surface, samples, seed, batch)
    return SphereImage(radiance.reshape(size, size, channels), coverage)


def _surface(size: int, view: tuple[float, float, float]) -> tuple[Tensor, _Surface]:
    """Coverage (size, size) and the surface seen through each covered pixel."""
    place = torch.tensor(view, dtype=torch.float64)
    if tuple(place.shape) != (3,) or not bool(torch.isfinite(place).all()) or not bool(place.any()):
        raise BadInput(f"view: found {view}, expected three finite numbers, not all 0")
    forward = place / place.norm()
    right = _azimuthal(forward)
    axes = torch.stack((right, torch.linalg.cross(forward, right), forward))
    fine = size * _GRID
    ticks = ((torch.arange(fine, dtype=torch.float64) + 0.5) * (2 / fine) - 1) / RADIUS
    x, y = torch.meshgrid(ticks, -ticks, indexing="xy")
    hit = (x**2 + y**2 < 1).to(torch.float64)

    def per_pixel(values: Tensor) -> Tensor:
        return values.reshape(size, _GRID, size, _GRID).sum((1, 3))

    count = per_pixel(hit)
    index = (count.reshape(-1) > 0).nonzero()[:, 0]
    covered = count.reshape(-1)[index]
    centre = torch.stack([per_pixel(hit * p).reshape(-1)[index] / covered for p in (x, y)], 1)
    height = (1 - (centre**2).sum(1, keepdim=True)).clamp_min(0).sqrt()
    frame, wo = sphere_frames(torch.cat((centre, height), 1) @ axes, forward)
    # The last component is n·ωo; taken from the picture plane it is never negative by rounding.
    wo[:, 2:] = height
    return count / _GRID**2, _Surface(index, frame, wo)


def sphere_frames(normal: Tensor, forward: Tensor) -> tuple[Tensor, Tensor]:
    """Rows t, b, n (P, 3, 3) of the frames at unit normals (P, 3), and the direction `forward` (3,) in them (P, 3)."""
    tangent = _azimuthal(normal)
    frame = torch.stack((tangent, torch.linalg.cross(normal, tangent), normal), 1)
    return frame, frame @ forward


def _azimuthal(n: Tensor) -> Tensor:
    """norm(y × n) of unit vectors (..., 3); x at the poles, where there is none."""
    across = torch.stack((n[..., 2], torch.zeros_like(n[..., 0]), -n[..., 0]), -1)
    length = across.norm(dim=-1, keepdim=True)
    x_axis = torch.zeros_like(n)
    x_axis[..., 0] = 1
    return torch.where(length > 1e-12, across / length.clamp_min(1e-12), x_axis)


def _shader(reflectance: Reflectance, to_rgb: ToRgb | None) -> Callable[[Tensor, Tensor], Tensor]:
    """f(wi, wo) in 1 or 3 channels, checked."""
    count = len(reflectance.channels)
    if to_rgb is None and count not in (1, 3):
        raise BadInput(f"reflectance: found {count} channels, expected 1, 3 or a to_rgb conversion")
    if isinstance(to_rgb, Tensor) and tuple(to_rgb.shape) != (3, count):
        raise BadInput(f"to_rgb: found a matrix of shape {tuple(to_rgb.shape)}, expected (3, {count})")

    def shade(wi: Tensor, wo: Tensor) -> Tensor:
        values = reflectance.evaluate(wi, wo).to(torch.float64)
        if isinstance(to_rgb, Tensor):
            values = values @ to_rgb.to(values).T
        elif to_rgb is not None:
            values = to_rgb(values)
        if not bool(torch.isfinite(values).all()):
            row = int((~torch.isfinite(values)).any(1).nonzero()[0])
            where = f"wi {_words(wi[row])}, wo {_words(wo[row])}"
            raise BadInput(f"reflectance: not finite at {where}, expected finite values")
        return values

    return shade


def _words(direction: Tensor) -> str:
    return "(" + ", ".join(f"{float(c):.4f}" for c in direction) + ")"


def _directional(
    shade: Callable[[Tensor, Tensor], Tensor], light: DirectionalLight, surface: _Surface, batch: int
) -> Tensor:
    """Radiance (P, C) under one directional light; 0 where it stands under the horizon."""
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
    surface: _Surface,
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
        wi = torch.cat(
            (light.draw(first) @ frame.transpose(1, 2), _cosine(second), _mirrored(third, wo)),
            1,
        )
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
