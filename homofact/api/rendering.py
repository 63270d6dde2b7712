"""Rendering: the lit sphere of a fit or a source, as a picture."""

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from homofact.api.places import check_file
from homofact.api.progress import Progress, ProgressSteps
from homofact.api.subjects import Place, given_fit, given_source, open_given
from homofact.brdf.source_names import MATERIAL_PREFIX
from homofact.files.reading import split_member
from homofact.sections import RenderSettings, SourceSettings

if TYPE_CHECKING:
    import numpy as np

_FEW = 64  # samples of a model, which nothing here looks at


@dataclass(frozen=True)
class RenderResult:
    """A picture of a sphere.

    Attributes
    ----------
    result : str
        What was drawn, in words.
    pixels : ndarray (size, size, 3)
        The picture, 8 bits, sRGB.
    file : Path or None
        Where it was written.
    light : str
        The light in words.
    caption : str
        Light, exposure, curve and white point in a sentence.
    exposure : float
        The exposure factor, applied before the tone curve.
    tonemap : str
        The curve.
    clipped : float
        The share of pixels that were clipped to the gamut.
    """

    result: str
    pixels: "np.ndarray" = field(repr=False)
    file: Path | None
    light: str
    caption: str
    exposure: float
    tonemap: str
    clipped: float

    def record(self) -> dict[str, Any]:
        """Return the JSON form."""
        return {
            "result": self.result,
            "picture": None if self.file is None else str(self.file),
            "size": len(self.pixels),
            "light": self.light,
            "exposure": self.exposure,
            "tonemap": self.tonemap,
            "clipped": self.clipped,
        }


def render(
    drawn: Any,
    to: Place | None = None,
    *,
    light: tuple[float, float, float] | None = None,
    environment: Place | None = None,
    exposure: float = 0.0,
    tonemap: str = "filmic",
    size: int = 384,
    progress: Progress | None = None,
) -> RenderResult:
    """Draw the sphere of a fit or a source under a directional light or an environment map.

    Parameters
    ----------
    drawn : Fit, source or path
        A fit, a result's folder or .npz file; or a source: a measurement file, "material:NAME", or an object.
    to : path, optional
        The .png file. Without it the picture is only returned.
    light : (float, float, float), optional
        Direction towards a directional light: x right, y up, z to the viewer.
    environment : path, optional
        A lat-long environment map (.hdr or .exr) that replaces the directional light, or the name of a built-in sky,
        such as "studio".
    exposure : float, optional
        Stops brighter than the automatic exposure.
    tonemap : {"filmic", "srgb"}, optional
        The tone curve from radiance to pixel values.
    size : int, optional
        Pixels per side.
    progress : callable, optional
        Called with a `ProgressStep` on the way.

    Returns
    -------
    RenderResult
        The pixels, and what they were drawn with.

    Raises
    ------
    BadInput
        For what cannot be read or drawn, and a file that cannot be written.

    Examples
    --------
    >>> homofact.render("material:phong-30", "phong.png", size=64).pixels.shape
    (64, 64, 3)
    """
    map_file = None if environment is None else os.fspath(environment)
    settings = RenderSettings(light, map_file, exposure, tonemap, size, None if to is None else os.fspath(to))
    target = None if to is None else Path(to)
    if target is not None:
        check_file(target, ".png")
    is_fit = _is_fit(drawn)
    source, given = (None, given_fit(drawn)) if is_fit else (given_source(drawn), None)

    from homofact.brdf.channels import display_of
    from homofact.brdf.source import open_source
    from homofact.figures.sphere_picture import drawn_sphere
    from homofact.rendering.light import DEFAULT_LIGHT, DirectionalLight
    from homofact.scene.lighting import open_environment

    steps = ProgressSteps(progress)
    steps.stage("reading")
    if given is not None:
        words, reflectance = given.words, given.open()
    else:
        opened = open_source(source, count=_FEW) if isinstance(source, str) else open_given(source)
        words, reflectance = source if isinstance(source, str) else opened.name, opened.reflectance
    if settings.environment is not None:
        lit = open_environment(settings.environment, "environment")
    else:
        lit = DEFAULT_LIGHT if settings.light is None else DirectionalLight(settings.light)
    steps.stage("drawing")
    picture = drawn_sphere(
        reflectance, light=lit, stops=exposure, curve=tonemap, size=size, to_rgb=display_of(reflectance.channels)
    )
    if target is not None:
        target.parent.mkdir(parents=True, exist_ok=True)
        picture.write(target)
    report = picture.report
    return RenderResult(
        words, picture.pixels, target, lit.describe(), picture.caption, report.exposure, report.curve, report.clipped
    )


def _is_fit(drawn: Any) -> bool:
    """Return whether `drawn` is a fit: neither a material, nor FILE#NAME, nor a file other than .npz."""
    if isinstance(drawn, str | os.PathLike):
        text, place = os.fspath(drawn), Path(drawn)
        if text.startswith(MATERIAL_PREFIX) or (split_member(text)[1] is not None and not place.exists()):
            return False
        return not (place.is_file() and place.suffix.lower() != ".npz")
    return not isinstance(drawn, SourceSettings) and callable(getattr(drawn, "save", None))
