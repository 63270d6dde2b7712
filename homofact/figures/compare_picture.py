"""Draw a source beside its fits on spheres under three lights, with difference images and numbers.

The lights are a point light, a round lamp of the same direction and irradiance, and a sky (`rendering.fixed_lights`).
All spheres under one light share the exposure, `automatic_exposure` of the source, and the filmic curve.

A difference is signed and relative: (fit − source)/(source + `FLOOR` of white) in luminance (Rec. 709 weights). White
is the radiance that the exposure maps to 1 before the curve. The floor keeps nearly black pixels from dominating the
difference image. All differences share one colour scale, so the paler of two fits is the better one. The scale goes
from −100% to +100%; it is linear below 2% and logarithmic above (asinh), so that small errors of a good fit remain
visible. The text under each difference states the range that contains 98% of its pixels.

If the source interpolates samples, the region beyond the measurement (`figures.measured_range`) is hatched alike in the
source, the fits and the differences. Pixels beyond the measurement do not count in the ranges.
"""

import math
import os
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch
from matplotlib import colormaps
from matplotlib.colors import AsinhNorm
from torch import Tensor

from homofact.brdf.reflectance import Reflectance
from homofact.brdf.scattered import interpolated_samples
from homofact.errors import BadInput
from homofact.evaluation.bar.error_bar import ErrorBars
from homofact.evaluation.wording import brief_figure
from homofact.figures.albedo_band import albedo_band
from homofact.figures.hatching import NARROWEST, SMALLEST, hatched
from homofact.figures.lit_picture import curve_in_words
from homofact.figures.measured_range import beyond_the_measurement
from homofact.figures.page import LINE, PicturePage
from homofact.files.atomic import replace_file
from homofact.linear.threads import in_parallel
from homofact.rendering.filtered import FilteredMaterial, Surroundings
from homofact.rendering.fixed_lights import LAMP_RADIUS, lamp_map, sky_map
from homofact.rendering.light import DEFAULT_LIGHT
from homofact.rendering.lobe_patches import DRAFT
from homofact.rendering.sphere import SphereImage, render_sphere
from homofact.rendering.surface import ToRgb
from homofact.rendering.tonemap import DEFAULT_CURVE, automatic_exposure, tonemap

FLOOR = 0.05
# The part of the pixels that the range under a difference holds.
HELD = 0.98
_BLACK = 1e-4  # of white: a fortieth of the darkest code value that is not 0
LIGHTS = ("point light", f"round lamp {2 * LAMP_RADIUS:g}° wide", "sky")
_LUMINANCE = (0.2126, 0.7152, 0.0722)
# The differences' scale of colours: linear below the first, to the second; with lines in its bar at the others.
_LINEAR, _MOST, _MARKED = 0.02, 1.0, (-0.1, -0.01, 0.01, 0.1)
# Diverging, told apart under all common colour deficiencies; unlit pixels and the surroundings are grey.
_MAP = "RdBu_r"
_UNLIT, _MARK = (0.55, 0.55, 0.55), (0.2, 0.2, 0.2)
_GAP, _LEAST, _BAR = 16, 150, 8


class LightReport(NamedTuple):
    """How one row was drawn: light, exposure, curve, and statistics of its pixels.

    `clipped` are the shares of pixels clipped to the gamut, source first; `ranges` are the limits ± that contain 98% of
    each fit's differences; `beyond` is the share of lit pixels beyond the measurement, or None if the source does not
    interpolate samples.
    """

    light: str
    exposure: float
    curve: str
    clipped: tuple[float, ...]
    ranges: tuple[float, ...]
    beyond: float | None


class FitPanel(NamedTuple):
    """A fit in the picture: its title, the text lines under it, and its error bars if it has a verdict."""

    title: str
    fit: Reflectance
    lines: Sequence[str] = ()
    bars: ErrorBars | None = None


class _Row(NamedTuple):
    report: LightReport
    shown: list[np.ndarray]
    differences: list[np.ndarray]


def relative_difference(fit: SphereImage, source: SphereImage, exposure: float) -> Tensor:
    """Return the signed relative luminance difference (H, W) of the module's docstring; NaN where both are black."""
    ours, theirs = _luminance(fit.radiance), _luminance(source.radiance)
    difference = (ours - theirs) / (theirs + FLOOR / exposure)
    black = (source.coverage == 0) | (torch.maximum(ours, theirs) * exposure < _BLACK)
    return torch.where(black, torch.full_like(difference, torch.nan), difference)


def compare_picture(
    path: str | os.PathLike[str],
    source: tuple[str, Reflectance],
    fits: Sequence[FitPanel],
    *,
    size: int = 160,
    to_rgb: ToRgb | None = None,
) -> tuple[LightReport, ...]:
    """Draw `source` (title, reflectance) and `fits` into a PNG at `path`.

    `size` is the side of each sphere picture in pixels; `to_rgb` is that of `render_sphere`. Returns a report for each
    of `LIGHTS`. Raises BadInput for no fits, for input that `render_sphere` rejects, and for a path that cannot be
    written.
    """
    if not fits:
        raise BadInput(where="comparison picture", found="no fits", expected="at least one")
    rows = _rows([source[1], *(panel.fit for panel in fits)], size, to_rgb)
    panel = max(size, _LEAST)
    page = PicturePage(_GAP + (1 + 2 * len(fits)) * (panel + _GAP), _GAP)
    lefts, pair = [_GAP + column * (panel + _GAP) for column in range(1 + 2 * len(fits))], 2 * panel + _GAP
    heads = [
        (source[0], lefts[0], panel),
        *((fit.title, left, pair) for fit, left in zip(fits, lefts[1::2], strict=True)),
    ]
    below = max(page.text(title, left, _GAP // 2, width, bold=True) for title, left, width in heads)
    bar, ends_at = _bar(size), (f"−{_MOST:.0%}", f"+{_MOST:.0%}")
    for row in rows:
        top = page.text(_words(row.report), _GAP, below + 6, page.width - 2 * _GAP) + 4
        for left, pixels in zip([lefts[0], *lefts[1::2]], row.shown, strict=True):
            page.picture(pixels, left, top)
        for left, difference, reach in zip(lefts[2::2], row.differences, row.report.ranges, strict=True):
            page.picture(difference, left, top)
            under = page.picture(bar, left, top + size + 4) + 1
            page.text(ends_at[0], left, under, size)
            right = left + size - math.ceil(page.extent(ends_at[1]))
            below = page.text(ends_at[1], right, under, size)
            below = page.text(f"{HELD:.0%} within ±{brief_figure(100 * reach)}%", left, below, panel)
    samples = interpolated_samples(source[1])
    notes = [] if samples is None else [f"Interpolated from {len(samples):,} samples"]
    captions = [
        (notes, None, lefts[0], panel),
        *((fit.lines, fit.bars, left, pair) for fit, left in zip(fits, lefts[1::2], strict=True)),
    ]
    ends, charted = [below + 8], False
    for lines, bars, left, width in captions:
        end = below + 8
        for line in lines:
            end = page.text(line, left, end, width)
        if bars is not None:
            said = bars.sentence()
            end = page.text(said[0].upper() + said[1:], left, end, width)
            band = albedo_band(bars, width)
            if band is not None:
                end, charted = page.picture(band, left, end + 4), True
        ends.append(end)
    end = max(ends) + 6
    if samples is not None:
        end = _explain_hatching(page, end) + 4
    page.text(
        f"Right of each fit: (fit − source) / (source + {FLOOR:.0%} of white) in luminance; red is too bright, blue too"
        " dark, grey is unlit. All differences have one scale, with lines at ±1% and ±10%, and below it the range that"
        f" holds {HELD:.0%} of the pixels.{' The charts of error bars have scales of their own.' * charted} Linear"
        " sRGB, white point D65.",
        _GAP,
        end,
        page.width - 2 * _GAP,
    )
    replace_file(path, page.save)
    return tuple(row.report for row in rows)


def _explain_hatching(page: PicturePage, top: int) -> int:
    """Write the legend of the hatching at `top`; return its bottom in pixels."""
    size = LINE - 4, 2 * LINE
    page.picture(hatched(np.full((*size, 3), _UNLIT), np.ones(size, dtype=bool)), _GAP, top + 2)
    words = (
        "beyond the measurement: most of the light comes from directions that were not measured for this view. Areas"
        f" narrower than {NARROWEST:.0%} of the picture, such as the rim, or smaller than {SMALLEST:.0%} of the lit"
        " pixels are not hatched, but count in the share above each row."
    )
    return page.text(words, _GAP + size[1] + 8, top, page.width - 3 * _GAP - size[1])


def _rows(reflectances: Sequence[Reflectance], size: int, to_rgb: ToRgb | None) -> list[_Row]:
    """Return the pictures of source and fits under each light, source first."""
    surroundings = [Surroundings.of(light, size, fineness=DRAFT) for light in (lamp_map(), sky_map())]

    def lit(reflectance: Reflectance) -> list[SphereImage]:
        material = FilteredMaterial.of(reflectance, to_rgb=to_rgb, fineness=DRAFT)
        directly = render_sphere(reflectance, DEFAULT_LIGHT, size, to_rgb=to_rgb)
        return [directly, *(material.under(light) for light in surroundings)]

    images = [list(row) for row in zip(*in_parallel(lit, reflectances), strict=True)]
    marks = beyond_the_measurement(reflectances[0], [DEFAULT_LIGHT, *surroundings], size)
    return [
        _row(light, pictures, None if marks is None else marks[number])
        for number, (light, pictures) in enumerate(zip(LIGHTS, images, strict=True))
    ]


def _row(light: str, images: list[SphereImage], marks: tuple[Tensor, Tensor] | None) -> _Row:
    """Return the displayed pictures and differences under one light."""
    beyond, wide = (None, None) if marks is None else (each.numpy() for each in marks)
    exposure = automatic_exposure(images[0])
    toned = [tonemap(image, exposure, curve=DEFAULT_CURVE) for image in images]
    shown = [picture.pixels.numpy() / 255 for picture in toned]
    differences = [relative_difference(image, images[0], exposure).numpy() for image in images[1:]]
    lit = np.isfinite(differences).any(0)
    known = lit if beyond is None else lit & ~beyond
    sizes = [np.abs(difference[known & np.isfinite(difference)]) for difference in differences]
    ranges = tuple(float(np.quantile(values, HELD)) if values.size else 0.0 for values in sizes)
    coloured = [_coloured(each) for each in differences]
    if wide is not None:
        shown = [hatched(each, wide) for each in shown]
        coloured = [hatched(each, wide) for each in coloured]
    share = None if beyond is None else float(beyond[lit].mean()) if lit.any() else 0.0
    clipped = tuple(picture.clipped for picture in toned)
    return _Row(LightReport(light, exposure, DEFAULT_CURVE, clipped, ranges, share), shown, coloured)


def _words(report: LightReport) -> str:
    """Return the line of text above a row."""
    # Of red, green and blue: one figure says whether white is the material's or the curve's.
    most = max(report.clipped)
    clipped = f", at most {most:.1%} of a sphere's pixels clipped to white" if most >= 0.0005 else ""
    known = "" if report.beyond is None else f", {report.beyond:.0%} of the pixels beyond the measurement"
    return (
        f"{report.light[0].upper()}{report.light[1:]}: exposure {report.exposure:.3g}, {curve_in_words(report.curve)}"
        f" curve{clipped}{known}"
    )


def _luminance(radiance: Tensor) -> Tensor:
    if radiance.shape[2] == 1:
        return radiance[..., 0]
    return radiance @ torch.tensor(_LUMINANCE, dtype=radiance.dtype)


def _scale() -> AsinhNorm:
    return AsinhNorm(_LINEAR, -_MOST, _MOST, clip=True)


def _bar(width: int) -> np.ndarray:
    """The colours of differences from −`_MOST` to `_MOST` (`_BAR`, width, 3), with lines at `_MARKED`."""
    bar = colormaps[_MAP](np.linspace(0, 1, width))[None, :, :3].repeat(_BAR, 0)
    bar[:, np.rint(np.asarray(_scale()(_MARKED)) * (width - 1)).astype(int)] = _MARK
    return bar


def _coloured(difference: np.ndarray) -> np.ndarray:
    """A difference in the colours of the bar, (H, W, 3) in [0, 1]; grey where it is NaN."""
    colours = colormaps[_MAP](_scale()(np.nan_to_num(difference)))[..., :3]
    return np.where(np.isfinite(difference)[..., None], colours, _UNLIT)
