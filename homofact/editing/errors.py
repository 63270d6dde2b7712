"""What a prepared scene's pictures are off: low rank, and lights and bands.

Both are relative RMS over some pixels. Low rank is against all bands (`lowrank.LowRank.error`), of curves as they start
and of trial edits (`basis.trial_edits`). Lights and bands are as the curves start, against a finer division of the
light, the materials themselves asked at the middles of four parts of each triangle: no bands, no curves.
"""

from dataclasses import dataclass, replace

import numpy as np
import torch

from homofact.editing.basis import trial_edits
from homofact.editing.lights import TriangleLights, triangle_lights
from homofact.editing.lowrank import LowRank
from homofact.editing.picture import factor_of, starting_curves, summed_curves
from homofact.editing.precompute import visible_lights
from homofact.editing.quotient import LightPoints, lit
from homofact.editing.scene import EditObject, PreparedScene
from homofact.scene.meshes import MeshGroup
from homofact.scene.visibility import VisiblePixels

# Pixels that are asked, lights of the finer division by those of the scene, and how often each of these is divided.
PIXELS, FINER, DIVIDED = 384, 8, 1


@dataclass(frozen=True)
class PartError:
    """One term of one object in one view: pixels, bands, rank, and the low rank's error, the worst trial edit's."""

    view: str
    material: str
    term: str
    pixels: int
    bands: tuple[int, ...]
    rank: int
    error: float


def rank_errors(prepared: PreparedScene) -> tuple[PartError, ...]:
    """Return the low rank's error of every part, by its probes."""
    curves, found = starting_curves(prepared), []
    for part in prepared.parts:
        if isinstance(part.transport, LowRank):
            material = prepared.scene.objects[part.object].material
            start = summed_curves(part, material, curves)
            error = max(map(part.transport.error, [start, *trial_edits(start)]))
            view = prepared.scene.view_names[part.view]
            kept = part.transport
            found.append(PartError(view, material.name, part.term, len(part.rows), kept.bands, kept.rank, error))
    return tuple(found)


def light_error(prepared: PreparedScene) -> dict[str, float]:
    """By the name of each view: relative RMS of some pixels against `FINER` times as many lights."""
    scene, curves = prepared.scene, starting_curves(prepared)
    finer = triangle_lights(scene.lighting, FINER * prepared.lights.count, len(scene.channels))
    meshes = MeshGroup([edited.mesh for edited in scene.objects])
    generator, found = np.random.default_rng(0), {}
    for view, seen in enumerate(prepared.pixels):
        rows = np.sort(generator.permutation(len(seen))[:PIXELS])
        if not len(rows):
            continue
        some = seen.some(rows)
        exact = torch.zeros(len(rows), len(scene.channels), dtype=torch.float64)
        for which, edited in enumerate(scene.objects):
            own = np.flatnonzero(some.objects == which)
            if len(own):
                exact[own] = _asked(some.some(own), edited, finer, meshes)
        shown = torch.zeros_like(exact)
        for part in prepared.parts:
            if part.view == view:
                place = np.flatnonzero(np.isin(rows, part.rows))
                inside = np.searchsorted(part.rows, rows[place])
                material = scene.objects[part.object].material
                picture = part.transport.picture(summed_curves(part, material, curves))
                shown[place] += (picture * factor_of(part, material, curves))[inside]
        size = float(exact.square().mean().sqrt())
        found[scene.view_names[view]] = float((shown - exact).square().mean().sqrt()) / size if size > 0 else 0.0
    return found


def _asked(pixels: VisiblePixels, edited: EditObject, lights: TriangleLights, meshes: MeshGroup) -> torch.Tensor:
    """R (P, C) of an object's pixels, each light asked at `DIVIDED` points."""
    begins, numbers = visible_lights(pixels, lights, meshes)
    owner = np.repeat(np.arange(len(pixels)), np.diff(begins))
    points = LightPoints.of(lights, DIVIDED)
    total = torch.zeros(len(pixels), lights.channels, dtype=torch.float64)
    for term in edited.material.terms:
        whole = replace(term, quotient=term.evaluate)
        values = torch.from_numpy(lit(pixels, lights, points, owner, numbers, edited.material, whole))
        part = torch.zeros_like(total).index_add_(0, torch.from_numpy(owner), values)
        pattern = edited.patterns.get(term.name)
        total += part if pattern is None else part * torch.from_numpy(pattern(pixels.points, pixels.uv))
    return total
