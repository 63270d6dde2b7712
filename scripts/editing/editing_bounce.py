"""Compare light between surfaces in edited scenes with Mitsuba's paths: an edited knot on edited matt ground.

    python scripts/editing/editing_bounce.py [--materials matt,CT,AS] [--pixels 64] [--samples 256] [--short]

The sky is the embedded one, with its sun. Materials are edited after the scene is prepared: of the knot those of
`editing_truth`, a matt one turns from grey to red; the ground turns from grey to ochre. Pictures have four precomputed
points per pixel. Errors are relative RMS over pixels that are all surface, all channels, against Mitsuba's `path` of
depth 3: light from the sky by way of no surface or one. "Direct" compares the light by way of none with Mitsuba's
`direct`, "bounce alone" the rest, relative to all light; its noise is that of two pictures. The noise is the relative
RMS of the standard error of Mitsuba's `path`. Seconds are the processor's, of precomputing; milliseconds are those of
a picture after one curve has changed, the median of several.
"""

import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import torch

from homofact.brdf.analytic import Lambert
from homofact.editing import models
from homofact.editing.curves import Bands
from homofact.editing.material import Editable, Place
from homofact.editing.picture import image
from homofact.editing.precompute import prepare
from homofact.editing.scene import EditObject, EditScene
from homofact.editing.session import Session
from homofact.evaluation.machine import machine
from homofact.linear.threads import one_thread
from homofact.meshes.mesh import read_mesh
from homofact.meshes.shapes import ground
from homofact.relighting.reference import Geometry, Material, scene_picture
from homofact.rendering.environment import read_environment
from homofact.scene.cameras import Camera
from homofact.scene.lighting import Lighting
from homofact.scene.meshes import lowest

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.editing.editing_truth import DATA, cases
from scripts.shared.harness import figure, finish, markdown, parser_of, progress

EYE, TARGET, FIELD = (0.6, 0.9, 3.6), (0.0, -0.15, 0.0), 36
FINER, EDITS = 2, 7
MATT, GROUND = "matt", "ground"
HEADER = (
    "knot of", "bounce of all light", "direct", "without bounce", "with bounce", "bounce alone", "noise", "MB without",
    "MB with", "s without", "s with", "ms without", "ms with",
)  # fmt: skip


@dataclass(frozen=True)
class Edited:
    """A material with its edit, and the edited one for Mitsuba."""

    material: Editable
    curves: dict[Place, Bands]
    shown: Material


def main(arguments: list[str] | None = None) -> int:
    """Measure every material."""
    parser = parser_of(__doc__, "out")
    parser.add_argument("--materials", default=f"{MATT},CT,AS", help="of the knot; also fit, sharp, mirror")
    parser.add_argument("--pixels", type=int, default=64, help="along the longer side (%(default)s)")
    parser.add_argument("--samples", type=int, default=256, help="of Mitsuba, per pixel and run (%(default)s)")
    parser.add_argument("--triangles", type=int, default=4000, help="of light (%(default)s)")
    chosen = parser.parse_args(arguments)
    names, size = chosen.materials.split(","), (chosen.pixels, chosen.samples, chosen.triangles, 48)
    if chosen.short:
        names, size = names[:1], (16, 16, 400, 16)
    rows = []
    with TemporaryDirectory() as folder:
        known = knots(Path(folder))
        for name in names:
            progress(name)
            rows.append(cells(name, measured(known[name], *size)))
    return finish([machine(), markdown(HEADER, rows)], chosen)


def knots(folder: Path) -> dict[str, Edited]:
    """The knot's materials by their names; `folder` gets the edited fit."""
    found = {MATT: recoloured(Lambert((0.5, 0.5, 0.5)), (1.6, 0.5, 0.3), "knot")}
    for case in cases(folder):
        material = replace(case.material, name="knot")
        found.setdefault(case.material.name, Edited(material, case.curves, case.shown))
    return found


def recoloured(model: Lambert, times: tuple[float, float, float], name: str) -> Edited:
    """A matt material of another colour."""
    material = models.light_view(model, name)
    start = material.banded_start()["diffuse", "incident"]
    edit = {("diffuse", "incident"): replace(start, values=start.values * torch.tensor(times, dtype=torch.float64))}
    return Edited(material, edit, material.edited(edit))


@one_thread
def measured(knot: Edited, pixels: int, samples: int, triangles: int, steps: int) -> dict[str, float]:
    """One material's row, with a ground of so many squares along a side."""
    mesh = read_mesh(DATA / "knot.ply")
    floor = recoloured(Lambert((0.5, 0.5, 0.5)), (1.3, 0.9, 0.5), GROUND)
    size = pixels, pixels * 3 // 4
    camera = Camera(EYE, TARGET, FIELD, size, "front")
    sky = read_environment(DATA / "sky.hdr")
    meshes = mesh, ground(4.0, lowest([mesh]), steps)
    objects = tuple(EditObject(*pair) for pair in zip(meshes, (knot.material, floor.material), strict=True))
    finer = replace(camera, pixels=(size[0] * FINER, size[1] * FINER))
    scene = EditScene(objects, Lighting("sky", (sky,)), (finer,))
    found, shown = {}, []
    for bounces in (0, 1):
        began = time.process_time()
        session = Session(prepare(replace(scene, bounces=bounces), triangles))
        found |= {f"seconds {bounces}": time.process_time() - began, f"bytes {bounces}": session.prepared.nbytes}
        session.set({("knot", *place): curve for place, curve in knot.curves.items()})
        session.set({(GROUND, *place): curve for place, curve in floor.curves.items()})
        found[f"edit {bounces}"] = edit_time(session)
        shown.append(reduced(session))
    (without, covered), (whole, _) = shown
    pairs = [
        (Geometry(each.positions, each.normals, each.triangles), edited.shown)
        for each, edited in zip(meshes, (knot, floor), strict=True)
    ]
    progress("Mitsuba")
    direct, bounced = (scene_picture(pairs, sky, camera, samples, 2, bounces=count) for count in (0, 1))
    inside = bounced.seen & covered
    difference = (bounced.radiance - direct.radiance)[inside]
    light = bounced.radiance[inside]
    return found | {
        "noise": bounced.noise,
        "share": float(difference.sum() / light.sum()),
        "direct": relative(without[inside], direct.radiance[inside]),
        "without": relative(without[inside], light),
        "with": relative(whole[inside], light),
        "alone": relative((whole - without)[inside], difference, light),
    }


def reduced(session: Session) -> tuple[np.ndarray, np.ndarray]:
    """The picture (H, W, 3), a mean of the precomputed points of each pixel, and which pixels are all covered."""
    radiance, coverage = image(session.prepared, 0, session.picture(0))
    height, width = (side // FINER for side in coverage.shape)
    shape = height, FINER, width, FINER
    covered = np.asarray(coverage.numpy().reshape(shape).min((1, 3)) > 0)
    return radiance.numpy().reshape(*shape, 3).mean((1, 3)), covered


def edit_time(session: Session) -> float:
    """Milliseconds of the processor from a change of the knot's last curve in the sum to the picture; undone."""
    session.picture(0)
    name = session.prepared.scene.materials[0]
    place = next(place for place in reversed(name.places) if name.slot(place).in_sum)
    curve, times = session.curves["knot", *place], []
    for k in range(EDITS):
        began = time.process_time()
        session.set({("knot", *place): replace(curve, values=curve.values * (1 + 0.1 * (k + 1)))})
        session.picture(0)
        times.append(1000 * (time.process_time() - began))
        session.undo()
    return float(np.median(times))


def relative(found: np.ndarray, exact: np.ndarray, of: np.ndarray | None = None) -> float:
    """Relative RMS, to the size of another picture where one is given."""
    return float(np.sqrt(((found - exact) ** 2).sum() / ((exact if of is None else of) ** 2).sum()))


def cells(name: str, row: Mapping[str, float]) -> Sequence[str]:
    """As the table has it."""
    shown = [name, *(f"{row[key]:.2%}" for key in ("share", "direct", "without", "with", "alone", "noise"))]
    shown += [f"{row[f'bytes {count}'] / 1e6:.1f}" for count in (0, 1)]
    return shown + [figure(row[f"{key} {count}"]) for key in ("seconds", "edit") for count in (0, 1)]


if __name__ == "__main__":
    raise SystemExit(main())
