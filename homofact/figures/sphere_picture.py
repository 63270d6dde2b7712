"""One lit sphere as a picture file, and the words that say how a sphere was drawn."""

import os
from collections.abc import Sequence
from typing import NamedTuple

from PIL import Image, PngImagePlugin

from homofact.brdf.reflectance import Reflectance
from homofact.files.atomic import replace_file
from homofact.render.filtered import draw_sphere
from homofact.render.light import DEFAULT_LIGHT, DirectionalLight, EnvironmentMap, Light
from homofact.render.surface import ToRgb
from homofact.render.tonemap import choose_middle, tonemap


class PictureReport(NamedTuple):
    """What a picture was drawn with: exposure, the share of clipped pixels, the curve."""

    exposure: float
    clipped: float
    curve: str = "srgb"


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
    report = PictureReport(factor, shown.clipped, curve)
    text = PngImagePlugin.PngInfo()
    text.add_text("Description", caption(light, report))
    picture = Image.fromarray(shown.pixels.numpy())
    replace_file(path, lambda beside: picture.save(beside, format="PNG", pnginfo=text))
    return report


def caption(light: Light | Sequence[Light], report: PictureReport) -> str:
    """The line that states light, exposure, white point and the share of clipped pixels."""
    lights = [light] if isinstance(light, DirectionalLight | EnvironmentMap) else light
    return (
        f"Light: {'; '.join(each.describe() for each in lights)}. Exposure {report.exposure:.4g}, linear sRGB, white"
        f" point D65, {curve_in_words(report.curve)} curve. Pixels clipped to the gamut: {report.clipped:.1%}."
    )


def curve_in_words(curve: str) -> str:
    """A curve of `render.tonemap` as it is written in a sentence."""
    return curve.replace("srgb", "sRGB")
