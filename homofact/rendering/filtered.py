"""A sphere under an environment, without noise: filtered light instead of samples.

The view is from far away and the tangents follow the sphere, so that the radiance depends on the normal alone: on θo
and, for anisotropic materials, on the azimuth around the view. Light directions are counted from the half vector h as
in `geometry.quadrature`, and split by a smooth window m(θh), 1 up to 3° and 0 beyond 10° (`lobe_patches.WINDOW`):

* the lobe, (f − b) m, where b is the least f at the end of the window. It is divided into patches in rings around h =
  n, fine at the centre. Each patch stores its flux ∫ (f − b) cosθi m dωi, from several values of f, at some normals,
  and is interpolated linearly between them. At every pixel a patch looks up the environment once, averaged over
  somewhat more than its own solid angle
  (`rendering.octahedral`);
* the rest, f (1 − m) + b m, which is smooth: the environment is replaced by lamps, one per cell, on a grid whose
  resolution lies between the two numbers of `cells`, finest where it is bright. The lamps are summed at normals of all
  θo levels × `azimuths`. The sum is interpolated cubically around the sphere's axis and linearly between levels.

The method loses detail of f (1 − m) finer than some degrees, such as a narrow retroreflective peak. At grazing angles,
where patches are long and their averages round, reflections are slightly blurred. Peaks that are several times narrower
along one axis than along the other spread a little.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch

from homofact.brdf.reflectance import Reflectance
from homofact.brdf.symmetry import find_symmetry
from homofact.linear.kernels import kernel
from homofact.rendering.light import EnvironmentMap, Light
from homofact.rendering.lobe_patches import (
    FULL,
    STEEPEST,
    Fineness,
    PatchedLobe,
    PatchedMaterial,
    base_of,
    lobe_of,
    rest_of,
    turns_of,
)
from homofact.rendering.octahedral import Pyramid, fetch
from homofact.rendering.sphere import SphereImage, render_sphere
from homofact.rendering.surface import ToRgb, seen_surface, shader, view_axes


def draw_sphere(
    reflectance: Reflectance,
    light: Light | Sequence[Light],
    size: int,
    *,
    view: tuple[float, float, float] = (0.0, 0.0, 1.0),
    to_rgb: ToRgb | None = None,
) -> SphereImage:
    """Render the sphere by `render_filtered` if the light is one environment, else by `render_sphere`."""
    if isinstance(light, EnvironmentMap):
        return render_filtered(reflectance, light, size, view=view, to_rgb=to_rgb)
    return render_sphere(reflectance, light, size, view=view, to_rgb=to_rgb)


def render_filtered(
    reflectance: Reflectance,
    light: EnvironmentMap,
    size: int = 256,
    *,
    view: tuple[float, float, float] = (0.0, 0.0, 1.0),
    to_rgb: ToRgb | None = None,
) -> SphereImage:
    """Return the sphere of `reflectance` in size × size pixels, laid out and coloured as by `render_sphere`.

    For every size of picture, an isotropic material is evaluated at 300,000 pairs, or half of them if it is also
    mirror-symmetric (detected by `brdf.symmetry`). Any other material is evaluated at two million pairs. Raises
    BadInput for channels that do not fit, and reflectances that are not finite.
    """
    return FilteredMaterial.of(reflectance, view=view, to_rgb=to_rgb).under(Surroundings.of(light, size, view))


class Surroundings(NamedTuple):
    """The data of an environment for pictures of one size from one view, the same for every material.

    `light` is the environment itself. `places` (P,) and `azimuths` (P,) locate the normals of the covered pixels, by θo
    and by the azimuth around the view. `pixels` (P,) are the indices of these pixels. `lamps` (directions and lights,
    (K, 3) each) approximate the whole environment.
    """

    light: EnvironmentMap
    coverage: torch.Tensor
    pixels: torch.Tensor
    places: np.ndarray
    azimuths: np.ndarray
    pyramid: Pyramid
    lamps: tuple[np.ndarray, np.ndarray]

    @classmethod
    def of(
        cls,
        light: EnvironmentMap,
        size: int,
        view: tuple[float, float, float] = (0.0, 0.0, 1.0),
        fineness: Fineness = FULL,
    ) -> "Surroundings":
        """Return `light` for pictures of size × size pixels.

        Raises BadInput for a size below 8 and a view of length 0.
        """
        coverage, surface = seen_surface(size, view)
        return cls._around(
            light, coverage, surface.pixels, surface.frame[:, 2] @ surface.axes.T, surface.axes, fineness
        )

    @classmethod
    def at_normals(
        cls, light: EnvironmentMap, normals: torch.Tensor, view: tuple[float, float, float], fineness: Fineness = FULL
    ) -> "Surroundings":
        """Return `light` for a one-row picture with unit normals (P, 3) in the world, all facing the view."""
        axes, count = view_axes(view), len(normals)
        coverage = torch.ones(1, count, dtype=torch.float64)
        return cls._around(light, coverage, torch.arange(count), normals @ axes.T, axes, fineness)

    @classmethod
    def _around(
        cls,
        light: EnvironmentMap,
        coverage: torch.Tensor,
        pixels: torch.Tensor,
        normal: torch.Tensor,
        axes: torch.Tensor,
        fineness: Fineness,
    ) -> "Surroundings":
        """With the normals (P, 3) of `pixels` in the frame whose unit vectors are the rows of `axes`, the view last."""
        pyramid = Pyramid.of(light, axes)
        return cls(
            light,
            coverage,
            pixels,
            torch.acos(normal[:, 2].clamp(-1, 1)).numpy(),
            torch.atan2(normal[:, 1], normal[:, 0]).numpy(),
            pyramid,
            pyramid.lamps(*fineness.cells),
        )


class FilteredMaterial(NamedTuple):
    """The data of a material for pictures from one view under any surroundings, so it is evaluated only once.

    `around` is the number of azimuths at which the light of the rest is summed. `channels` is the number of channels of
    the picture, 1 or 3.
    """

    lobe: PatchedLobe
    rest: np.ndarray
    around: int
    channels: int

    @classmethod
    def of(
        cls,
        reflectance: Reflectance,
        *,
        view: tuple[float, float, float] = (0.0, 0.0, 1.0),
        to_rgb: ToRgb | None = None,
        fineness: Fineness = FULL,
    ) -> "FilteredMaterial":
        """Evaluate a material on the grids of `fineness`. Raises BadInput as `render_filtered`."""
        axes, shade = view_axes(view), shader(reflectance, to_rgb)
        symmetry = find_symmetry(reflectance)
        grid = fineness.isotropic if symmetry.isotropic else fineness.anisotropic
        material = PatchedMaterial(shade, grid, turns_of(grid, axes), symmetry.isotropic and symmetry.mirrored)
        base = base_of(material)
        channels = int(shade(axes[2:], axes[2:]).shape[1])
        return cls(lobe_of(material, base), rest_of(material, base), fineness.azimuths, channels)

    def under(self, surroundings: Surroundings) -> SphereImage:
        """Return the sphere in `surroundings` of the same view."""
        turns, levels = self.rest.shape[:2]
        theta = np.linspace(0, STEEPEST, levels)
        coarse = _summed(self.rest, theta, *surroundings.lamps, self.around, 0)
        if turns > 1:
            # Normals between those asked: linear in what the material does there.
            part = (np.arange(self.around) * turns / self.around % 1)[:, None]
            coarse = (1 - part) * coarse + part * _summed(self.rest, theta, *surroundings.lamps, self.around, 1)
        place, pyramid = surroundings.places / theta[1], surroundings.pyramid
        light = pyramid.texels, pyramid.starts, pyramid.sides
        colours = _gathered(place, surroundings.azimuths, *self.lobe, _finer(coarse), *light)
        channels = max(self.channels, int(surroundings.light.radiance.shape[2]))
        radiance = torch.zeros(surroundings.coverage.numel(), channels, dtype=torch.float64)
        radiance[surroundings.pixels] = torch.from_numpy(colours)[:, :channels]
        return SphereImage(radiance.reshape(*surroundings.coverage.shape, channels), surroundings.coverage)


def _finer(coarse: np.ndarray) -> np.ndarray:
    """(L, azimuths, 3) at four times as many azimuths, by Catmull and Rom's cubics."""
    before, behind, beyond = (np.roll(coarse, -k, 1) for k in (-1, 1, 2))
    parts = []
    for x in (0.0, 0.25, 0.5, 0.75):
        slope, bend = behind - before, 2 * before - 5 * coarse + 4 * behind - beyond
        parts.append(coarse + x / 2 * (slope + x * (bend + x * (3 * (coarse - behind) + beyond - before))))
    return np.stack(parts, 2).reshape(len(coarse), -1, 3).astype(np.float32)


@kernel(nogil=True, fastmath=True)
def _summed(table, theta, places, lights, azimuths, behind):  # pragma: no cover (compiled)
    """Σ over lamps (K, 3) at `places` (K, 3) of the table's values, at all levels × azimuths: (L, azimuths, 3).

    The table's turn is the last one before an azimuth, or so many `behind` it.
    """
    turns, levels, rings, spokes, _ = table.shape
    summed = np.zeros((levels, azimuths, 3))
    for level in range(levels):
        sine, cosine = math.sin(theta[level]), math.cos(theta[level])
        for azimuth in range(azimuths):
            turn = 2 * math.pi * azimuth / azimuths
            ex, ey = math.cos(turn), math.sin(turn)
            own = (azimuth * turns // azimuths + behind) % turns
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
                here, above = table[own, level, r], table[own, level, r + 1]
                red += lights[lamp, 0] * (w0 * here[s, 0] + w1 * here[n, 0] + w2 * above[s, 0] + w3 * above[n, 0])
                green += lights[lamp, 1] * (w0 * here[s, 1] + w1 * here[n, 1] + w2 * above[s, 1] + w3 * above[n, 1])
                blue += lights[lamp, 2] * (w0 * here[s, 2] + w1 * here[n, 2] + w2 * above[s, 2] + w3 * above[n, 2])
            summed[level, azimuth, 0] = red
            summed[level, azimuth, 1] = green
            summed[level, azimuth, 2] = blue
    return summed


@kernel(nogil=True, fastmath=True)
def _gathered(place, azimuth, flux, towards, size, rest, texels, starts, sides):  # pragma: no cover (compiled)
    """Radiance (P, 3) of pixels at levels `place` (P,) and `azimuth` (P,) round the view."""
    levels, turns, patches, _ = flux.shape
    around = rest.shape[1]
    gathered = np.zeros((len(place), 3))
    for pixel in range(len(place)):
        level = min(int(place[pixel]), levels - 2)
        up = np.float32(min(place[pixel] - level, 1.0))
        low = np.float32(1) - up
        ex, ey = np.float32(math.cos(azimuth[pixel])), np.float32(math.sin(azimuth[pixel]))
        turn = azimuth[pixel] * (turns / (2 * math.pi)) + turns
        k = int(turn)
        over = np.float32(turn - k) if turns > 1 else np.float32(0)
        k = k % turns
        n = (k + 1) % turns
        w0, w1 = low * (1 - over), up * (1 - over)
        w2, w3 = low * over, up * over
        red = green = blue = np.float32(0)
        for j in range(patches):
            r = w0 * flux[level, k, j, 0] + w1 * flux[level + 1, k, j, 0]
            g = w0 * flux[level, k, j, 1] + w1 * flux[level + 1, k, j, 1]
            b = w0 * flux[level, k, j, 2] + w1 * flux[level + 1, k, j, 2]
            if over > 0:
                r += w2 * flux[level, n, j, 0] + w3 * flux[level + 1, n, j, 0]
                g += w2 * flux[level, n, j, 1] + w3 * flux[level + 1, n, j, 1]
                b += w2 * flux[level, n, j, 2] + w3 * flux[level + 1, n, j, 2]
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
            gathered[pixel, channel] = low * below + up * above
        gathered[pixel, 0] += red
        gathered[pixel, 1] += green
        gathered[pixel, 2] += blue
    return gathered
