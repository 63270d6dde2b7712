"""Rendering: the lit sphere of a fit or a source, or a relit scene, as a picture."""

import os
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from homofact.api.places import check_file
from homofact.api.progress import Progress, ProgressSteps
from homofact.api.subjects import Place, given_fit, given_source, open_given
from homofact.brdf.source_names import MATERIAL_PREFIX
from homofact.errors import BadInput
from homofact.files.kinds import PREPARED, RELIT
from homofact.files.reading import split_member
from homofact.sections import RenderSettings, SourceSettings

if TYPE_CHECKING:
    import numpy as np

    from homofact.figures.lit_picture import LitPicture
    from homofact.relighting.lit_scene import LitScene
    from homofact.scene.cameras import Camera

_FEW = 64  # samples of a model, which nothing here looks at
_SIZE = 384  # of a sphere's picture
_SUN_IN_MAP = (
    "the sun stays in the map of this sky: its shadows are blurred and may have dark spots; in a scene that is relit"
    " under this sky it is a light of its own"
)


@dataclass(frozen=True)
class RenderResult:
    """A picture of a sphere, a relit scene or a relit mesh.

    Attributes
    ----------
    result : str
        What was drawn, in words.
    pixels : ndarray (H, W, 3)
        The picture, 8 bits, sRGB. A sphere's is square.
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
            "width": self.pixels.shape[1],
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
    size: int | None = None,
    camera: str | None = None,
    eye: tuple[float, float, float] | None = None,
    target: tuple[float, float, float] | None = None,
    progress: Progress | None = None,
) -> RenderResult:
    """Draw the sphere of a fit or a source under a light, or a scene that `relight` has precomputed.

    Parameters
    ----------
    drawn : Fit, source, RelightResult, RelitMesh or path
        A fit, a result's folder or .npz file; a source: a measurement file, "material:NAME", or an object; or what
        `relight` returned or wrote: a scene, its folder, or a mesh.
    to : path, optional
        The .png file. Without it the picture is only returned.
    light : (float, float, float), optional
        Direction towards a directional light: x right, y up, z to the viewer. Only for spheres.
    environment : path, optional
        A lat-long environment map (.hdr or .exr) that replaces the directional light or the scene's sky and suns, or
        the name of a built-in sky, such as "studio".
    exposure : float, optional
        Stops brighter than the automatic exposure.
    tonemap : {"filmic", "srgb"}, optional
        The tone curve from radiance to pixel values.
    size : int, optional
        Height of the picture in pixels. Default: 384 for a sphere, the camera's for a scene.
    camera : str, optional
        Name or number, from 1, of one of a scene's cameras. Default: the first.
    eye, target : (float, float, float), optional
        For a scene or mesh: the point to look from, and the point to look at, instead of the camera's. The default
        camera of a mesh sees all of it from the front.
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
    MissingDependency
        For a scene or mesh without Embree (the extra `relight`).

    Examples
    --------
    >>> homofact.render("material:phong-30", "phong.png", size=64).pixels.shape
    (64, 64, 3)
    >>> ball = homofact.relight("shape:sphere", "material:phong-10", terms=4, cube=8)
    >>> ball.relight("studio")
    >>> homofact.render(ball, "ball.png", eye=(1, 2, 4), size=48).pixels.shape
    (48, 64, 3)
    """
    map_file = None if environment is None else os.fspath(environment)
    file = None if to is None else Path(to)
    settings = RenderSettings(
        light, map_file, exposure, tonemap, size, camera, eye, target, None if to is None else os.fspath(to)
    )
    if file is not None:
        check_file(file, ".png")
    steps = ProgressSteps(progress)
    lit = _lit_scene(drawn, settings, steps)
    words, picture, shown = _sphere(drawn, settings, steps) if lit is None else _scene_picture(*lit, settings, steps)
    if file is not None:
        file.parent.mkdir(parents=True, exist_ok=True)
        picture.write(file)
    report = picture.report
    return RenderResult(
        words, picture.pixels, file, shown, picture.caption, report.exposure, report.curve, report.clipped
    )


def _sphere(drawn: Any, settings: RenderSettings, steps: ProgressSteps) -> "tuple[str, LitPicture, str]":
    """Return the words for what is drawn, the picture of its sphere, and the light in words."""
    for name in ("camera", "eye", "target"):
        if getattr(settings, name) is not None:
            raise BadInput(where=name, found="it with a sphere", expected="it with a scene that relight wrote")
    is_fit = _is_fit(drawn)
    source, given = (None, given_fit(drawn)) if is_fit else (given_source(drawn), None)

    from homofact.brdf.channels import display_of
    from homofact.brdf.source import open_source
    from homofact.figures.lit_picture import drawn_sphere
    from homofact.rendering.light import DEFAULT_LIGHT, DirectionalLight
    from homofact.scene.lighting import open_environment

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
        reflectance,
        light=lit,
        stops=settings.exposure,
        curve=settings.tonemap,
        size=settings.size or _SIZE,
        to_rgb=display_of(reflectance.channels),
    )
    return words, picture, lit.describe()


def _lit_scene(drawn: Any, settings: RenderSettings, steps: ProgressSteps) -> "tuple[str, LitScene, Camera] | None":
    """Return the name, the lit objects and the camera of a relit scene or mesh; None for anything else."""
    place = Path(drawn) if isinstance(drawn, str | os.PathLike) else None
    if place is not None and PREPARED.is_at(place):
        raise BadInput(where=place, found="a prepared scene", expected="a relit scene, a fit or a source")
    if place is not None and not RELIT.is_at(place):
        return None
    if place is None and not callable(getattr(drawn, "lit", None)):
        return None

    from homofact.relighting.relit_mesh import RelitMesh
    from homofact.relighting.result import RelightResult, open_relit
    from homofact.scene.cameras import camera_on, chosen_camera
    from homofact.scene.lighting import open_environment

    steps.stage("reading")
    found = drawn if place is None else open_relit(place)
    if not isinstance(found, RelightResult | RelitMesh):
        return None
    if settings.light is not None:
        raise BadInput(where="light", found="it with a relit scene", expected="an environment map")
    environment = None
    if settings.environment is not None:
        environment = open_environment(settings.environment, "environment")
    steps.stage("lighting the objects")
    if isinstance(found, RelightResult):
        name, camera = found.name, chosen_camera(found.cameras, settings.camera)
    elif settings.camera is not None:
        raise BadInput(where="camera", found="it with a mesh", expected="an eye, or a scene with cameras")
    else:
        name, camera = found.mesh.name, camera_on(found.mesh.positions)
    lit = found.lit(environment)
    if lit.has_sun_in_map:
        steps.note(_SUN_IN_MAP)
    return (name if place is None else str(place)), lit, camera


def _scene_picture(
    words: str, lit: "LitScene", camera: "Camera", settings: RenderSettings, steps: ProgressSteps
) -> "tuple[str, LitPicture, str]":
    """Return the name, the picture of a lit scene, and the light in words."""
    from homofact.figures.lit_picture import shown_scene

    width, height = camera.pixels
    if settings.size is not None:
        width, height = max(round(width * settings.size / height), 1), settings.size
    camera = replace(
        camera, eye=settings.eye or camera.eye, target=settings.target or camera.target, pixels=(width, height)
    )
    steps.stage("rendering")
    radiance, coverage = lit.radiance(camera)
    picture = shown_scene(radiance, coverage, lit.describe(), settings.exposure, settings.tonemap)
    return words, picture, lit.describe()


def _is_fit(drawn: Any) -> bool:
    """Return whether `drawn` is a fit: neither a material, nor FILE#NAME, nor a file other than .npz."""
    if isinstance(drawn, str | os.PathLike):
        text, place = os.fspath(drawn), Path(drawn)
        if text.startswith(MATERIAL_PREFIX) or (split_member(text)[1] is not None and not place.exists()):
            return False
        return not (place.is_file() and place.suffix.lower() != ".npz")
    return not isinstance(drawn, SourceSettings) and callable(getattr(drawn, "save", None))
