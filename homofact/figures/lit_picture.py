"""Pictures of one lit sphere or scene: tone-mapped, described in words, and written to a file."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from PIL import Image, PngImagePlugin

from homofact.brdf.reflectance import Reflectance
from homofact.files.atomic import replace_file
from homofact.rendering.filtered import draw_sphere
from homofact.rendering.light import DEFAULT_LIGHT, DirectionalLight, EnvironmentMap, Light
from homofact.rendering.surface import ToRgb
from homofact.rendering.tonemap import DEFAULT_CURVE, automatic_exposure, tonemap, tonemap_scene


class PictureReport(NamedTuple):
    """The rendering settings of a picture: its exposure, the share of clipped pixels, and its tone curve."""

    exposure: float
    clipped: float
    curve: str = DEFAULT_CURVE


@dataclass(frozen=True)
class LitPicture:
    """A picture: pixels (H, W, 3) uint8, a report of its rendering, and a caption with these figures."""

    pixels: np.ndarray
    report: PictureReport
    caption: str

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write a PNG with the caption in its text chunk `Description`. Raises BadInput for an unwritable path."""
        text = PngImagePlugin.PngInfo()
        text.add_text("Description", self.caption)
        picture = Image.fromarray(self.pixels)
        replace_file(path, lambda beside: picture.save(beside, format="PNG", pnginfo=text))


def drawn_sphere(
    reflectance: Reflectance,
    *,
    light: Light | Sequence[Light] = DEFAULT_LIGHT,
    exposure: float | None = None,
    stops: float = 0.0,
    curve: str = DEFAULT_CURVE,
    size: int = 512,
    view: tuple[float, float, float] = (0.0, 0.0, 1.0),
    to_rgb: ToRgb | None = None,
) -> LitPicture:
    """Render a sphere under the lights and tone-map it.

    `exposure` is a factor; by default it is `automatic_exposure`. `stops` multiplies it by 2**stops. Raises BadInput
    for input that `draw_sphere` and `tonemap` reject.
    """
    image = draw_sphere(reflectance, light, size, view=view, to_rgb=to_rgb)
    factor = (automatic_exposure(image) if exposure is None else exposure) * 2**stops
    shown = tonemap(image, factor, curve=curve)
    report = PictureReport(factor, shown.clipped, curve)
    return LitPicture(shown.pixels.numpy(), report, caption(light, report))


def shown_scene(
    radiance: np.ndarray, coverage: np.ndarray, light: str, stops: float = 0.0, curve: str = DEFAULT_CURVE
) -> LitPicture:
    """Tone-map the radiance (H, W, 3) of a scene in front of its `light`, in words, as `tonemap_scene`."""
    shown, factor = tonemap_scene(torch.from_numpy(radiance), torch.from_numpy(coverage), stops=stops, curve=curve)
    report = PictureReport(factor, shown.clipped, curve)
    return LitPicture(shown.pixels.numpy(), report, caption(light, report))


def caption(light: str | Light | Sequence[Light], report: PictureReport) -> str:
    """Return a caption with light, exposure, white point, curve, and the share of clipped pixels."""
    lights = [light] if isinstance(light, DirectionalLight | EnvironmentMap) else light
    words = lights if isinstance(lights, str) else "; ".join(light.describe() for light in lights)
    return (
        f"Light: {words}. Exposure {report.exposure:.4g}, linear sRGB, white"
        f" point D65, {curve_in_words(report.curve)} curve. Pixels clipped to the gamut: {report.clipped:.1%}."
    )


def curve_in_words(curve: str) -> str:
    """Return the name of a curve of `rendering.tonemap` as it is written in a sentence."""
    return curve.replace("srgb", "sRGB")
