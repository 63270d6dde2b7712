"""A sphere of an isotropic material under an environment, without noise: filtered light instead of samples.

The view is from far away, so that the radiance of an isotropic material depends on the normal alone. Light directions
are counted from the half vector h as in `geometry.quadrature`, and split by a smooth window m(θh), 1 up to `_WINDOW`[0]
and 0 beyond `_WINDOW`[1]:

* the lobe, f m: patches in rings round h = n, fine at the centre. Each holds the flux ∫ f cosθi m dωi of its part, from
  several values a patch, at `_LEVELS` angles θo, linear between. At every pixel a patch reads the environment once,
  averaged over somewhat more than its own solid angle (`render.octahedral`);
* the rest, f (1 − m), which is smooth: the environment as lamps, of `_CELLS` a side where it is dark to where it is
  bright, summed at all θo levels × `_AZIMUTHS` normals; cubic round the sphere's axis, linear between levels.

What is lost is detail of f (1 − m) under some degrees, such as a narrow peak on the way back, and a little sharpness of
reflections at grazing angles, where patches are long and their averages round.
"""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numba
import numpy as np
import torch
from torch import Tensor

from homofact.brdf.reflectance import Reflectance
from homofact.brdf.symmetry import find_symmetry
from homofact.geometry.directions import from_spherical
from homofact.render.light import EnvironmentMap, Light
from homofact.render.octahedral import Pyramid, fetch
from homofact.render.sphere import SphereImage, render_sphere
from homofact.render.surface import ToRgb, seen_surface, shader

Shade = Callable[[Tensor, Tensor], Tensor]
SAMPLES = 128
_LEVELS, _STEEPEST = 64, math.radians(89.5)
_WINDOW = (math.radians(3.0), math.radians(10.0))
# Patches of the lobe, values in each along its radius, and what is one patch in the middle.
_RINGS, _SPOKES, _FINER, _CORE = 28, 36, 4, 7
# The table of the rest, over θh/θmax and φh, its lamps and normals.
_REST_RINGS, _REST_SPOKES, _CELLS, _AZIMUTHS = 48, 48, (32, 128), 192
# Averages reach so many powers of two beyond their patch, which hides the gaps between round ones.
_OVERLAP = 0.5
_BATCH = 1 << 17


class _Lobe(NamedTuple):
    """Patches J of each level: `flux` (L, J, 3), where they lie, and how wide the light there is averaged.

    `towards` (L, J, 3) are in the frame (e, e × v, v), v towards the viewer, e ⟂ v to the normal's side; `size` (L, J)
    is half the binary logarithm of a solid angle.
    """

    flux: np.ndarray
    towards: np.ndarray
    size: np.ndarray


def draw_sphere(
    reflectance: Reflectance,
    light: Light | Sequence[Light],
    size: int,
    *,
    view: tuple[float, float, float] = (0.0, 0.0, 1.0),
    to_rgb: ToRgb | None = None,
    seed: int = 0,
) -> SphereImage:
    """The sphere by the quicker way: `render_filtered` where it holds, else `render_sphere` of `SAMPLES` a pixel.

    It holds for one environment and a material that turns out to be isotropic (`brdf.symmetry`). Raises as they do.
    """
    if isinstance(light, EnvironmentMap) and find_symmetry(reflectance).isotropic:
        return render_filtered(reflectance, light, size, view=view, to_rgb=to_rgb)
    return render_sphere(reflectance, light, size, view=view, to_rgb=to_rgb, samples=SAMPLES, seed=seed)


def render_filtered(
    reflectance: Reflectance,
    light: EnvironmentMap,
    size: int = 256,
    *,
    view: tuple[float, float, float] = (0.0, 0.0, 1.0),
    to_rgb: ToRgb | None = None,
) -> SphereImage:
    """The sphere of an isotropic `reflectance` in size × size pixels, laid out and coloured as by `render_sphere`.

    About 400,000 values of the reflectance are asked for, half of them where it is mirrored, however large the picture.
    Raises BadInput for channels that do not fit, and reflectances that are not finite.
    """
    coverage, surface = seen_surface(size, view)
    shade = shader(reflectance, to_rgb)
    mirrored = find_symmetry(reflectance).mirrored
    levels = torch.linspace(0, _STEEPEST, _LEVELS, dtype=torch.float64)
    pyramid = Pyramid.of(light, surface.axes)
    lobe = _lobe(shade, levels, mirrored)
    rest = _finer(_summed(_rest(shade, levels, mirrored), levels.numpy(), *pyramid.lamps(*_CELLS)))
    normal = surface.frame[:, 2] @ surface.axes.T
    place = (torch.acos(surface.wo[:, 2].clamp(-1, 1)) / (_STEEPEST / (_LEVELS - 1))).numpy()
    azimuth = torch.atan2(normal[:, 1], normal[:, 0]).numpy()
    found = torch.from_numpy(_gathered(place, azimuth, *lobe, rest, pyramid.texels, pyramid.starts, pyramid.sides))
    channels = max(int(shade(surface.wo[:1], surface.wo[:1]).shape[1]), int(light.radiance.shape[2]))
    radiance = torch.zeros(size * size, channels, dtype=torch.float64)
    radiance[surface.pixels] = found[:, :channels]
    return SphereImage(radiance.reshape(size, size, channels), coverage)


def _limit(theta: Tensor, turn: Tensor) -> Tensor:
    """θmax (L, S) of `geometry.quadrature` for θo (L,) and φh (S,)."""
    sine, cosine = torch.sin(theta)[:, None], torch.cos(theta)[:, None]
    return (math.pi / 2 + torch.atan2(sine * torch.cos(turn), cosine)) / 2


def _mirrored(theta: Tensor, polar: Tensor, turn: Tensor) -> tuple[Tensor, Tensor]:
    """(ωi, ωo) (L, R, S, 3): ωo at θo (L,), azimuth 0, mirrored at h of polar angles (L, R, S) and azimuths (S,)."""
    h = from_spherical(polar, turn.expand_as(polar))
    wo = from_spherical(theta, torch.zeros_like(theta))[:, None, None].expand_as(h)
    return 2 * (h * wo).sum(-1, keepdim=True) * h - wo, wo


def _asked(shade: Shade, wi: Tensor, wo: Tensor) -> Tensor:
    """f (..., 3), one channel spread over three."""
    flat = zip(wi.reshape(-1, 3).split(_BATCH), wo.reshape(-1, 3).split(_BATCH), strict=True)
    values = torch.cat([shade(one, two) for one, two in flat])
    return values.expand(-1, 3).reshape(*wi.shape[:-1], 3)


def _window(theta: Tensor) -> Tensor:
    x = ((_WINDOW[1] - theta) / (_WINDOW[1] - _WINDOW[0])).clamp(0, 1)
    return x * x * (3 - 2 * x)


def _lobe(shade: Shade, theta: Tensor, mirrored: bool) -> _Lobe:
    fine = _RINGS * _FINER
    t = (torch.arange(fine, dtype=torch.float64) + 0.5) / fine
    turn = (torch.arange(_SPOKES, dtype=torch.float64) + 0.5) * (2 * math.pi / _SPOKES)
    limit = _limit(theta, turn)[:, None]
    polar = limit * t[:, None] ** 4
    wi, wo = _mirrored(theta, polar, turn)
    cosine = ((1 + (wi * wo).sum(-1)) / 2).clamp_min(0).sqrt()
    solid = 4 * cosine * torch.sin(polar) * limit * 4 * t[:, None] ** 3 * (2 * math.pi / _SPOKES / fine)
    inside = _window(polar)
    use = (inside > 0) & (wi[..., 2] > 0)
    half = _SPOKES // 2
    if mirrored:
        use[:, :, half:] = False
    values = torch.zeros(*wi.shape, dtype=torch.float64)
    values[use] = _asked(shade, wi[use], wo[use])
    if mirrored:
        values[:, :, half:] = values[:, :, :half].flip(2)
    flux = values * (solid * inside * wi[..., 2])[..., None]
    shape = (len(theta), _RINGS, _FINER, _SPOKES)
    flux, solid = flux.reshape(*shape, 3).sum(2), solid.reshape(shape).sum(2)
    middle = wi.reshape(*shape, 3)[:, :, _FINER // 2]

    def joined(values: Tensor, core: Tensor) -> Tensor:
        """The patches beyond the core, flat, behind the core."""
        return torch.cat((core[:, None], values[:, _CORE:].flatten(1, 2)), 1)

    core = from_spherical(-theta, torch.zeros_like(theta))
    flux, towards = joined(flux, flux[:, :_CORE].sum((1, 2))), joined(middle, core)
    size = torch.log2(joined(solid, solid[:, :_CORE].sum((1, 2)))) / 2 + _OVERLAP
    # From the frame of the normal, ωo in its xz-plane, to that of the view.
    sine, cosine = torch.sin(theta)[:, None], torch.cos(theta)[:, None]
    x, y, z = towards.unbind(-1)
    turned = torch.stack((z * sine - x * cosine, y, x * sine + z * cosine), -1)
    return _Lobe(*(each.to(torch.float32).contiguous().numpy() for each in (flux, turned, size)))


def _rest(shade: Shade, theta: Tensor, mirrored: bool) -> np.ndarray:
    """f cosθi (1 − m) (L, R, S, 3) at even steps of θh/θmax, both ends included, and of φh."""
    part = torch.linspace(0, 1, _REST_RINGS, dtype=torch.float64)
    turn = torch.arange(_REST_SPOKES, dtype=torch.float64) * (2 * math.pi / _REST_SPOKES)
    polar = _limit(theta, turn)[:, None] * part[:, None]
    wi, wo = _mirrored(theta, polar, turn)
    weight = (1 - _window(polar)) * wi[..., 2].clamp_min(0)
    use = weight > 1e-9
    half = _REST_SPOKES // 2
    if mirrored:
        use[:, :, half + 1 :] = False
    values = torch.zeros(*wi.shape, dtype=torch.float64)
    values[use] = _asked(shade, wi[use], wo[use])
    if mirrored:
        values[:, :, half + 1 :] = values[:, :, 1:half].flip(2)
    return (values * weight[..., None]).to(torch.float32).numpy()


def _finer(coarse: np.ndarray) -> np.ndarray:
    """(L, azimuths, 3) at four times as many azimuths, by Catmull and Rom's cubics."""
    before, behind, beyond = (np.roll(coarse, -k, 1) for k in (-1, 1, 2))
    parts = []
    for x in (0.0, 0.25, 0.5, 0.75):
        slope, bend = behind - before, 2 * before - 5 * coarse + 4 * behind - beyond
        parts.append(coarse + x / 2 * (slope + x * (bend + x * (3 * (coarse - behind) + beyond - before))))
    return np.stack(parts, 2).reshape(len(coarse), -1, 3).astype(np.float32)


@numba.njit(cache=True, nogil=True, fastmath=True)
def _summed(table, theta, places, lights):  # pragma: no cover (compiled)
    """Σ over lamps (K, 3) at `places` (K, 3) of the table's values, at all levels × azimuths: (L, azimuths, 3)."""
    levels, rings, spokes, _ = table.shape
    found = np.zeros((levels, _AZIMUTHS, 3))
    for level in range(levels):
        sine, cosine = math.sin(theta[level]), math.cos(theta[level])
        for azimuth in range(_AZIMUTHS):
            turn = 2 * math.pi * azimuth / _AZIMUTHS
            ex, ey = math.cos(turn), math.sin(turn)
            red = green = blue = 0.0
            for lamp in range(len(places)):
                a = ex * places[lamp, 0] + ey * places[lamp, 1]
                v = places[lamp, 2]
                if sine * a + cosine * v <= 0:
                    continue
                # ωi + ωo in the frame of the normal.
                x = sine * v - cosine * a + sine
                y = ey * places[lamp, 0] - ex * places[lamp, 1]
                z = sine * a + cosine * v + cosine
                flat = math.sqrt(x * x + y * y)
                along = x / flat if flat > 0 else 1.0
                limit = (math.pi / 2 + math.atan2(sine * along, cosine)) / 2
                row = min(math.atan2(flat, z) / limit, 1.0) * (rings - 1)
                column = math.atan2(y, x) * (spokes / (2 * math.pi))
                if column < 0:
                    column += spokes
                r, s = min(int(row), rings - 2), int(column)
                up, right = row - r, column - s
                s = s % spokes
                n = (s + 1) % spokes
                w0, w1 = (1 - up) * (1 - right), (1 - up) * right
                w2, w3 = up * (1 - right), up * right
                here, above = table[level, r], table[level, r + 1]
                red += lights[lamp, 0] * (w0 * here[s, 0] + w1 * here[n, 0] + w2 * above[s, 0] + w3 * above[n, 0])
                green += lights[lamp, 1] * (w0 * here[s, 1] + w1 * here[n, 1] + w2 * above[s, 1] + w3 * above[n, 1])
                blue += lights[lamp, 2] * (w0 * here[s, 2] + w1 * here[n, 2] + w2 * above[s, 2] + w3 * above[n, 2])
            found[level, azimuth, 0] = red
            found[level, azimuth, 1] = green
            found[level, azimuth, 2] = blue
    return found


@numba.njit(cache=True, nogil=True, fastmath=True)
def _gathered(place, azimuth, flux, towards, size, rest, texels, starts, sides):  # pragma: no cover (compiled)
    """Radiance (P, 3) of pixels at levels `place` (P,) and `azimuth` (P,) round the view."""
    levels, patches, _ = flux.shape
    around = rest.shape[1]
    found = np.zeros((len(place), 3))
    for pixel in range(len(place)):
        level = min(int(place[pixel]), levels - 2)
        up = np.float32(min(place[pixel] - level, 1.0))
        low = np.float32(1) - up
        ex, ey = np.float32(math.cos(azimuth[pixel])), np.float32(math.sin(azimuth[pixel]))
        red = green = blue = np.float32(0)
        for j in range(patches):
            r = low * flux[level, j, 0] + up * flux[level + 1, j, 0]
            g = low * flux[level, j, 1] + up * flux[level + 1, j, 1]
            b = low * flux[level, j, 2] + up * flux[level + 1, j, 2]
            if r == 0 and g == 0 and b == 0:
                continue
            a = low * towards[level, j, 0] + up * towards[level + 1, j, 0]
            c = low * towards[level, j, 1] + up * towards[level + 1, j, 1]
            v = low * towards[level, j, 2] + up * towards[level + 1, j, 2]
            wide = low * size[level, j] + up * size[level + 1, j]
            one, two, three = fetch(texels, starts, sides, a * ex + c * ey, a * ey - c * ex, v, wide)
            red += r * one
            green += g * two
            blue += b * three
        turn = azimuth[pixel] * (around / (2 * math.pi))
        if turn < 0:
            turn += around
        k = int(turn)
        right = turn - k
        k = k % around
        n = (k + 1) % around
        for channel in range(3):
            below = (1 - right) * rest[level, k, channel] + right * rest[level, n, channel]
            above = (1 - right) * rest[level + 1, k, channel] + right * rest[level + 1, n, channel]
            found[pixel, channel] = low * below + up * above
        found[pixel, 0] += red
        found[pixel, 1] += green
        found[pixel, 2] += blue
    return found
