"""The errors of a prepared scene's pictures: from low rank, and from lights and bands.

Both are relative RMS errors over some pixels. The error of the low rank is measured against all bands
(`lowrank.LowRank.error`), for the start curves and for trial edits (`basis.trial_edits`). For light from other surfaces
it is relative to all light of the object. The error of lights and bands is measured for the start curves, against a
finer division of the light. This reference has no bands and no curves: it evaluates the materials themselves at the
centres of four parts of each triangle. In it, other surfaces reflect by their own materials, not as matt ones, under
fewer lights.
"""

from dataclasses import dataclass, replace

import numpy as np
import torch

from homofact.editing.basis import trial_edits
from homofact.editing.interreflection import Bounce
from homofact.editing.lights import triangle_lights
from homofact.editing.lowrank import LowRank
from homofact.editing.picture import Curves, add_part, part_picture, starting_curves, summed_curves
from homofact.editing.quotient import LightPoints, lit
from homofact.editing.reaching import BouncedLight, DirectLight, Light
from homofact.editing.scene import EditObject, EditScene, PreparedScene, PreparedTerm
from homofact.scene.meshes import MeshGroup
from homofact.scene.visibility import VisiblePixels

# Pixels that are asked, lights of the finer division by those of the scene, and how often each of these is divided.
PIXELS, FINER, DIVIDED = 384, 8, 1
# With light from surfaces: pixels, each with hundreds of surface points, and lights of these points.
BOUNCED_PIXELS, BOUNCED_LIGHTS = 64, 400
_PIECE = 2048


@dataclass(frozen=True)
class PartError:
    """One term of one object in one view: pixels, bands, rank, the low rank's error and its worst trial edit's.

    `bounced` is true for light from other surfaces.
    """

    view: str
    material: str
    term: str
    pixels: int
    bands: tuple[int, ...]
    rank: int
    error: float
    bounced: bool = False

    @property
    def words(self) -> str:
        """Return the term's name and the source of its light."""
        return f"{self.term}, from surfaces" if self.bounced else self.term


def rank_errors(prepared: PreparedScene) -> tuple[PartError, ...]:
    """Return the low rank's error of every part, by its probes."""
    curves, found = starting_curves(prepared), []
    for part in prepared.parts:
        if isinstance(part.transport, LowRank):
            material = prepared.scene.objects[part.object].material
            start = summed_curves(part, material, curves)
            error = max(map(part.transport.error, [start, *trial_edits(start)]))
            bounced = part.senders is not None
            if bounced:
                error *= _share(prepared, part, curves)
            view, kept = prepared.scene.view_names[part.view], part.transport
            found.append(
                PartError(view, material.name, part.term, len(part.rows), kept.bands, kept.rank, error, bounced)
            )
    return tuple(found)


def _share(prepared: PreparedScene, part: PreparedTerm, curves: Curves) -> float:
    """Return the RMS of a part's light divided by the RMS of all light of its object in its view."""
    own = prepared.pixels[part.view].objects == part.object
    sizes = []
    for parts in ([part], [each for each in prepared.parts if each.view == part.view and each.object == part.object]):
        total = torch.zeros(len(own), len(prepared.scene.channels), dtype=torch.float64)
        for each in parts:
            add_part(total, prepared, each, part_picture(prepared, each, curves), curves)
        sizes.append(float(total.square().sum().sqrt()))
    return sizes[0] / sizes[1] if sizes[1] > 0 else 0.0


def light_error(prepared: PreparedScene) -> dict[str, float]:
    """Return, by view name, the relative RMS of some pixels against `FINER` times as many lights."""
    scene, curves = prepared.scene, starting_curves(prepared)
    finer = triangle_lights(scene.lighting, FINER * prepared.lights.count, len(scene.channels))
    meshes = MeshGroup([edited.mesh for edited in scene.objects])
    generator, found = np.random.default_rng(0), {}
    for view, seen in enumerate(prepared.pixels):
        count = BOUNCED_PIXELS if scene.bounces else PIXELS
        rows = np.sort(generator.permutation(len(seen))[:count])
        if not len(rows):
            continue
        some = seen.some(rows)
        exact = _asked_of_all(scene, DirectLight(some, finer, meshes))
        if scene.bounces:
            exact += _asked_of_all(scene, _sent(scene, some, meshes))
        shown = torch.zeros(len(seen), len(scene.channels), dtype=torch.float64)
        for part in prepared.parts:
            if part.view == view:
                add_part(shown, prepared, part, part_picture(prepared, part, curves), curves)
        size = float(exact.square().mean().sqrt())
        found[scene.view_names[view]] = float((shown[rows] - exact).square().mean().sqrt()) / size if size > 0 else 0.0
    return found


def _sent(scene: EditScene, pixels: VisiblePixels, meshes: MeshGroup) -> BouncedLight:
    """Return the light that pixels receive from surfaces, evaluating their materials directly."""
    bounce = Bounce.of(meshes, len(scene.channels))
    met = bounce.met(pixels)
    lights = triangle_lights(scene.lighting, BOUNCED_LIGHTS, len(scene.channels))
    radiance = _asked_of_all(scene, DirectLight(bounce.surfaces(met), lights, meshes))
    return bounce.gathered(pixels, [(met, radiance.numpy())])[0]


def _asked_of_all(scene: EditScene, light: Light) -> torch.Tensor:
    """Return the radiance R (P, C) of the pixels, each with its object's material."""
    found = torch.zeros(len(light.pixels), len(scene.channels), dtype=torch.float64)
    for which, edited in enumerate(scene.objects):
        own = np.flatnonzero(light.pixels.objects == which)
        for begin in range(0, len(own), _PIECE):
            rows = own[begin : begin + _PIECE]
            found[rows] = _asked(light.some(rows), edited)
    return found


def _asked(light: Light, edited: EditObject) -> torch.Tensor:
    """Return R (P, C) of an object's pixels, with `DIVIDED` points per triangle of light."""
    pixels, reaching = light.pixels, light.reaching()
    points = LightPoints.of(light.lights, DIVIDED)
    total = torch.zeros(len(pixels), light.lights.channels, dtype=torch.float64)
    for term in edited.material.terms:
        whole = replace(term, quotient=term.evaluate)
        values = torch.from_numpy(lit(pixels, light.lights, points, reaching, edited.material, whole))
        part = torch.zeros_like(total).index_add_(0, torch.from_numpy(reaching.owner), values)
        pattern = edited.patterns.get(term.name)
        total += part if pattern is None else part * torch.from_numpy(pattern(pixels.points, pixels.uv))
    return total
