"""Pictures for people: a source beside its fits on a lit sphere, their differences, and the numbers.

All spheres share one light and one exposure, chosen from the source. A difference is signed and relative:
(fit − source)/(source + 1% of white) in luminance (Rec. 709 weights), white being the radiance that the
exposure shows as 1; the 1% keeps pixels that are black in the picture from dominating it. Every sphere is
drawn pixel for pixel, so nothing is resampled.
"""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from PIL import Image, PngImagePlugin
from torch import Tensor

from homofact.brdf.reflectance import Reflectance
from homofact.errors import BadInput
from homofact.files.atomic import replace_file
from homofact.render.filtered import draw_sphere
from homofact.render.light import DEFAULT_LIGHT, DirectionalLight, EnvironmentMap, Light
from homofact.render.sphere import SphereImage, render_sphere
from homofact.render.surface import ToRgb
from homofact.render.tonemap import choose_exposure, choose_middle, tonemap

FLOOR = 0.01
_LUMINANCE = (0.2126, 0.7152, 0.0722)
_RANGES = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0)
# Diverging, told apart under all common colour deficiencies; unlit pixels and the surroundings are grey.
_MAP = "RdBu_r"
_UNLIT = (0.55, 0.55, 0.55)
_DPI, _GAP, _TEXT, _LINE = 100, 24, 10.0, 19


class PictureReport(NamedTuple):
    """What a picture was drawn with: exposure, clipped shares (source first), ± range of the colour bar, the curve."""

    exposure: float
    clipped: tuple[float, ...]
    difference_range: float | None
    curve: str = "srgb"


def relative_difference(fit: SphereImage, source: SphereImage, exposure: float) -> Tensor:
    """Signed relative luminance difference (H, W), as in the module's head; NaN where both are black."""
    ours, theirs = _luminance(fit.radiance), _luminance(source.radiance)
    difference = (ours - theirs) / (theirs + FLOOR / exposure)
    black = (source.coverage == 0) | ((ours == 0) & (theirs == 0))
    return torch.where(black, torch.full_like(difference, torch.nan), difference)


def compare_picture(
    path: str | os.PathLike[str],
    source: tuple[str, Reflectance],
    fits: Sequence[tuple[str, Reflectance, Sequence[str]]],
    *,
    light: Light | Sequence[Light] = DEFAULT_LIGHT,
    exposure: float | None = None,
    size: int = 256,
    view: tuple[float, float, float] = (0.0, 0.0, 1.0),
    to_rgb: ToRgb | None = None,
    samples: int = 256,
    seed: int = 0,
    notes: Sequence[str] = (),
) -> PictureReport:
    """Draw `source` (title, reflectance) and `fits` (title, reflectance, caption lines) into a PNG at `path`.

    `notes` are lines under the source. `to_rgb`, `view`, `samples` and `seed` are `render_sphere`'s.
    Raises BadInput for no fits, what `render_sphere` refuses, and a place that cannot be written.
    """
    if not fits:
        raise BadInput("comparison picture: found no fits, expected at least one")
    titles = [source[0], *(title for title, _, _ in fits)]
    images = [
        render_sphere(each, light, size, view=view, to_rgb=to_rgb, samples=samples, seed=seed)
        for each in (source[1], *(fit for _, fit, _ in fits))
    ]
    factor = choose_exposure(images[0]) if exposure is None else exposure
    shown = [tonemap(image, factor) for image in images]
    differences = [relative_difference(image, images[0], factor).numpy() for image in images[1:]]
    reach = _reach(differences)
    clipped = tuple(each.clipped for each in shown)
    page = _Page(max(size, 250), len(images))
    captions = [list(notes), *([*lines] for _, _, lines in fits)]
    report = PictureReport(factor, clipped, reach)
    footer = caption(light, report)
    page.draw(titles, [each.pixels.numpy() for each in shown], differences, reach, captions, footer, size)
    replace_file(path, page.save)
    return report


def sphere_picture(
    path: str | os.PathLike[str],
    reflectance: Reflectance,
    *,
    light: Light | Sequence[Light] = DEFAULT_LIGHT,
    exposure: float | None = None,
    stops: float = 0.0,
    curve: str = "srgb",
    size: int = 512,
    view: tuple[float, float, float] = (0.0, 0.0, 1.0),
    to_rgb: ToRgb | None = None,
) -> PictureReport:
    """One sphere as a PNG whose text chunk `Description` holds light, exposure, curve and white point.

    `exposure` is a factor, else that of `choose_middle`; `stops` are powers of two on top of it. Raises BadInput for
    what `draw_sphere` and `tonemap` refuse and a place that cannot be written.
    """
    image = draw_sphere(reflectance, light, size, view=view, to_rgb=to_rgb)
    factor = (choose_middle(image) if exposure is None else exposure) * 2**stops
    shown = tonemap(image, factor, curve=curve)
    report = PictureReport(factor, (shown.clipped,), None, curve)
    text = PngImagePlugin.PngInfo()
    text.add_text("Description", caption(light, report))
    picture = Image.fromarray(shown.pixels.numpy())
    replace_file(path, lambda beside: picture.save(beside, format="PNG", pnginfo=text))
    return report


def caption(light: Light | Sequence[Light], report: PictureReport) -> str:
    """The line that states light, exposure, white point and the share of clipped pixels."""
    lights = [light] if isinstance(light, DirectionalLight | EnvironmentMap) else light
    shares = ", ".join(f"{share:.1%}" for share in report.clipped)
    return (
        f"Light: {'; '.join(each.describe() for each in lights)}. Exposure {report.exposure:.4g}"
        f"{' for all' if len(report.clipped) > 1 else ''}, linear sRGB, white point D65,"
        f" {report.curve.replace('srgb', 'sRGB')} curve. Pixels clipped to the gamut: {shares}."
    )


def _luminance(radiance: Tensor) -> Tensor:
    if radiance.shape[2] == 1:
        return radiance[..., 0]
    return radiance @ torch.tensor(_LUMINANCE, dtype=radiance.dtype)


def _reach(differences: Sequence[np.ndarray]) -> float:
    """The smallest round range that holds 98% of the pixels of every difference."""
    sizes = [np.abs(each[np.isfinite(each)]) for each in differences]
    largest = max((float(np.quantile(each, 0.98)) for each in sizes if each.size), default=0.0)
    return next((each for each in _RANGES if each >= largest), _RANGES[-1])


class _Page:
    """A figure laid out in whole pixels from the top: titles, spheres, differences, captions, footer."""

    def __init__(self, panel: int, columns: int) -> None:
        """An empty page for `columns` panels of `panel` pixels."""
        self.panel, self.columns = panel, columns
        self.width = columns * (panel + _GAP) + _GAP
        self.figure = Figure(figsize=(1, 1), dpi=_DPI, facecolor="white")
        self.canvas = FigureCanvasAgg(self.figure)

    def draw(
        self,
        titles: Sequence[str],
        pictures: Sequence[np.ndarray],
        differences: Sequence[np.ndarray],
        reach: float,
        captions: Sequence[Sequence[str]],
        footer: str,
        size: int,
    ) -> None:
        """Fill the page; its height follows from the text."""
        heads = [self._wrap(title, self.panel, bold=True) for title in titles]
        below = [[part for line in lines for part in self._wrap(line, self.panel)] for lines in captions]
        feet = self._wrap(footer, self.width - 2 * _GAP)
        top = _GAP // 2 + _LINE * max(map(len, heads))
        under = top + size + 10
        text = under + size + 8
        # The source's column has the colour bar where the others have a difference.
        label = self._wrap(f"Right: (fit − source) / (source + {FLOOR:.0%} of white), luminance", self.panel)
        notes = under + _LINE * (len(label) + 1) + 40
        foot = max(text + _LINE * max(map(len, below[1:])), notes + _LINE * len(below[0])) + 14
        height = foot + _LINE * len(feet) + _GAP // 2
        self.figure.set_size_inches(self.width / _DPI, height / _DPI)
        self.height = height
        for column, (head, picture) in enumerate(zip(heads, pictures, strict=True)):
            left = _GAP + column * (self.panel + _GAP)
            self._lines(head, left, top - _LINE * len(head) - 3, bold=True)
            self._image(picture, left, top, size)
        for column, difference in enumerate(differences, 1):
            left = _GAP + column * (self.panel + _GAP)
            self._image(_coloured(difference, reach), left, under, size)
            self._lines(below[column], left, text)
        self._lines(label, _GAP, under)
        self._bar(_GAP + 14, under + _LINE * len(label) + 8, reach)
        self._lines(below[0], _GAP, notes)
        self._lines(feet, _GAP, foot)

    def save(self, path: Path) -> None:
        """Write the page as a PNG."""
        self.figure.savefig(path, format="png", dpi=_DPI)

    def _image(self, pixels: np.ndarray, left: float, top: float, size: int) -> None:
        axes = self._axes(left, top, size, size)
        axes.imshow(pixels, interpolation="none", aspect="auto")
        axes.set_axis_off()

    def _axes(self, left: float, top: float, width: float, height: float) -> Axes:
        bottom = self.height - top - height
        return self.figure.add_axes((left / self.width, bottom / self.height, width / self.width, height / self.height))

    def _lines(self, lines: Sequence[str], left: float, top: float, bold: bool = False) -> None:
        x, weight = left / self.width, "bold" if bold else "normal"
        for number, line in enumerate(lines):
            y = 1 - (top + (number + 0.5) * _LINE) / self.height
            self.figure.text(x, y, line, fontsize=_TEXT, weight=weight, va="center", parse_math=False)

    def _bar(self, left: float, top: float, reach: float) -> None:
        axes = self._axes(left, top, self.panel - 28, 16)
        bar = self.figure.colorbar(
            ScalarMappable(Normalize(-reach, reach), colormaps[_MAP]), cax=axes, orientation="horizontal"
        )
        ticks = (-reach, -reach / 2, 0.0, reach / 2, reach)
        bar.set_ticks(ticks, labels=["0" if t == 0 else f"{t * 100:+.3g}%".replace("-", "−") for t in ticks])
        axes.tick_params(labelsize=_TEXT - 1)

    def _wrap(self, text: str, width: float, bold: bool = False) -> list[str]:
        """`text` broken at spaces into lines that fit `width` pixels; a longer word is broken anywhere."""
        lines, line = [], ""
        for word in text.split():
            while word:
                candidate = f"{line} {word}" if line else word
                if self._extent(candidate, bold) <= width:
                    line, word = candidate, ""
                elif line:
                    lines.append(line)
                    line = ""
                else:
                    cut = len(word) - 1
                    while cut > 1 and self._extent(word[:cut], bold) > width:
                        cut -= 1
                    lines.append(word[:cut])
                    word = word[cut:]
        return [*lines, line] if line else lines

    def _extent(self, text: str, bold: bool) -> float:
        weight = "bold" if bold else "normal"
        drawn = self.figure.text(0, 0, text, fontsize=_TEXT, weight=weight, parse_math=False)
        extent = drawn.get_window_extent(self.canvas.get_renderer()).width
        drawn.remove()
        return extent


def _coloured(difference: np.ndarray, reach: float) -> np.ndarray:
    """A difference in the colours of the bar, (H, W, 3) in [0, 1]; grey where it is NaN."""
    colours = colormaps[_MAP](Normalize(-reach, reach, clip=True)(np.nan_to_num(difference)))[..., :3]
    return np.where(np.isfinite(difference)[..., None], colours, _UNLIT)
