"""The whole picture of a relit scene against the sum over every texel at each of its pixels: relative RMS, PSNR, FLIP.

The pictures show the first camera at `ROWS` rows with one ray per pixel. The approximate picture uses the factors,
lobes and suns. The exact one uses the reflectance itself under every texel of the cube map and 64 directions of each
sun. Both are tone-mapped by the filmic curve at the automatic exposure of the exact picture, as pictures and the page
are, and compared before they are rounded to 8 bits; PSNR and FLIP are means over the objects' pixels. Both leave out
the soft edge of the ground.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch

from homofact.errors import BadInput, MissingDependency
from homofact.evaluation.image_metrics import flip, psnr
from homofact.relighting.build import RelightScene, RelitObject
from homofact.relighting.cube import environment_cube
from homofact.relighting.errors import relative, sending_surfaces
from homofact.relighting.seen import seen_pixels
from homofact.relighting.sending_surfaces import FEW_NODES
from homofact.relighting.sunlight import SAMPLES, summed
from homofact.rendering.sphere import SphereImage
from homofact.rendering.tonemap import DEFAULT_CURVE, automatic_exposure, displayed

ROWS = 60
_PART = 64  # pixels between two reports of progress


@dataclass(frozen=True)
class PictureLikeness:
    """How close a relit picture is to the exact one: relative RMS (linear), PSNR in dB and FLIP (tone-mapped).

    `pixels` are width and height; `flip` is None without the library that computes it.
    """

    pixels: tuple[int, int]
    error: float
    psnr: float
    flip: float | None

    def record(self) -> dict[str, object]:
        """The JSON form."""
        found: dict[str, object] = {"pixels": list(self.pixels), "error": self.error, "curve": DEFAULT_CURVE}
        return found | {name: value for name, value in (("psnr", self.psnr), ("flip", self.flip)) if _finite(value)}


def picture_likeness(
    scene: RelightScene,
    objects: Sequence[RelitObject],
    rows: int = ROWS,
    progress: Callable[[int, int], object] | None = None,
) -> PictureLikeness | None:
    """Compare pictures of the first camera, `rows` pixels high; None if it sees no object.

    `progress` is called with (pixels done, pixels).
    """
    camera = scene.file.cameras[0]
    height = min(rows, camera.pixels[1])
    width = max(8, round(camera.pixels[0] * height / camera.pixels[1]))
    camera = replace(camera, pixels=(width, height))
    meshes = [relit.mesh for relit in objects]
    behind = scene.file.light.look_up(torch.from_numpy(camera.rays().reshape(-1, 3)))[0].numpy()
    exact = np.broadcast_to(behind, (width * height, 3)).copy()
    shown, cover = exact.copy(), np.zeros(width * height)
    seen = []
    for number, placed in enumerate(scene.objects):
        try:
            given = (placed.reflectance, scene.occluder, camera, None)
            found = seen_pixels(meshes, number, *given, tint=placed.tint, bumps=placed.bumps)
        except BadInput:
            continue
        seen.append((objects[number], found))
    if not seen:
        return None
    count, done = sum(len(found.numbers) for _, found in seen), 0
    radiance, around = environment_cube(scene.file.light, scene.file.settings.cube), sending_surfaces(scene)
    for relit, found in seen:
        lit = found.lit_points(relit.mesh)
        seen_suns = lit.seen(scene.file.lights, scene.occluder, SAMPLES)
        sight = lit.sight(scene.occluder)
        shown[found.numbers] = relit.lit(radiance).between(found.mixture, camera.eye, seen_suns, sight)
        points, suns = found.points, scene.file.lights
        exact[found.numbers] = summed(points.reflectance, suns, lit, points.wo, scene.occluder, points.tint)
        for first in range(0, len(found.numbers), _PART):
            part = slice(first, first + _PART)
            points = replace(found.points, which=found.points.which[part])
            exact[found.numbers[part]] += points.dense(radiance, radiance.shape[1])
            if around is not None:
                exact[found.numbers[part]] += around.bounced(points, scene.file.light, FEW_NODES)
            done += len(found.numbers[part])
            if progress is not None:
                progress(done, count)
        cover[found.numbers] = 1
    inside = cover > 0
    pictures = [torch.from_numpy(values.reshape(height, width, 3)) for values in (exact, shown)]
    mask = torch.from_numpy(inside.reshape(height, width))
    exposure = automatic_exposure(SphereImage(pictures[0], mask.double()))
    whole = torch.ones(height, width, dtype=torch.float64)
    first, second = (
        displayed(SphereImage(each.clamp_min(0), whole), exposure, curve=DEFAULT_CURVE) for each in pictures
    )
    try:
        looks = flip(first, second, mask)
    except MissingDependency:
        looks = None
    return PictureLikeness((width, height), relative(shown[inside], exact[inside]), psnr(first, second, mask), looks)


def _finite(value: float | None) -> bool:
    return value is not None and math.isfinite(value)
