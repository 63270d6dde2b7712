"""Compare light between surfaces with Mitsuba's paths: a knot on matt ground, without and with one bounce.

    python scripts/relighting/relight_bounce.py [--materials albedo,phong-30,car-paint-red] [--pixels 120]
        [--samples 256]

The sky is the embedded one without its sun. Errors are relative RMS over pixels that are all surface, all channels,
against Mitsuba's `path` of depth 3: light from the sky by way of no surface or one. "Direct" compares the light by way
of none with Mitsuba's `direct`, "bounce alone" the rest, relative to all light; its noise is that of two pictures. The
noise is the relative RMS of the standard error of Mitsuba's `path`.
"""

import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from homofact.evaluation.machine import machine
from homofact.relighting.build import RelightScene, RelitObject, open_relight_scene, relit_objects
from homofact.relighting.cube import environment_cube
from homofact.relighting.errors import relative
from homofact.relighting.picture import picture
from homofact.relighting.reference import Geometry, scene_picture
from homofact.relighting.scene_file import read_relight_scene
from homofact.scene.cameras import Camera

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import figure, finish, markdown, parser_of, progress

ROOT = Path(__file__).resolve().parents[2]
ALBEDO = "albedo"
SCENE = """
[[object]]
mesh = "{root}/data_synthetic/knot.ply"
{material}
[ground]
albedo = [0.6, 0.45, 0.3]
half = 4
steps = {steps}
[lighting]
environment = "{root}/data_synthetic/sky.hdr"
[[camera]]
eye = [0.6, 0.9, 3.6]
target = [0, -0.15, 0]
field = 36
[transport]
bounces = {bounces}
"""
HEADER = (
    "material", "bounce of all light", "direct", "without bounce", "with bounce", "bounce alone", "noise", "MB without",
    "MB with", "s without", "s with",
)  # fmt: skip


def main(arguments: list[str] | None = None) -> int:
    """Measure every material."""
    parser = parser_of(__doc__, "out")
    parser.add_argument("--materials", default=f"{ALBEDO},phong-30,car-paint-red")
    parser.add_argument("--pixels", type=int, default=120)
    parser.add_argument("--samples", type=int, default=256)
    chosen = parser.parse_args(arguments)
    names, size = chosen.materials.split(","), (chosen.pixels, chosen.samples, 48)
    if chosen.short:
        names, size = names[:1], (24, 16, 16)
    rows = [cells(measured(name, *size)) for name in names]
    return finish([machine(), markdown(HEADER, rows)], chosen)


def measured(name: str, pixels: int, samples: int, steps: int = 48) -> dict[str, object]:
    """One material's row, with a ground of so many squares along a side."""
    camera = Camera((0.6, 0.9, 3.6), (0.0, -0.15, 0.0), 36.0, (pixels, pixels * 3 // 4))
    shown, found = [], {}
    for bounces in (0, 1):
        progress(f"{name}, {bounces} bounces")
        began = time.perf_counter()
        scene, objects = relit(name, bounces, steps)
        found[f"seconds {bounces}"] = time.perf_counter() - began
        found[f"bytes {bounces}"] = sum(each.nbytes for each in objects)
        shown.append(rendered(scene, objects, camera))
    pairs = [
        (Geometry(each.mesh.positions, each.mesh.normals, each.mesh.triangles), each.material.reflectance)
        for each in scene.objects
    ]
    progress(f"{name}, Mitsuba")
    direct, bounced = (scene_picture(pairs, scene.file.light, camera, samples, 2, bounces=count) for count in (0, 1))
    inside = bounced.seen & (shown[1][1] > 0.999)
    (without, _), (whole, _) = shown
    difference = (bounced.radiance - direct.radiance)[inside]
    return {
        "material": name, **found, "noise": bounced.noise,
        "share": float(difference.sum() / bounced.radiance[inside].sum()),
        "direct": relative(without[inside], direct.radiance[inside]),
        "without": relative(without[inside], bounced.radiance[inside]),
        "with": relative(whole[inside], bounced.radiance[inside]),
        "alone": relative((whole - without)[inside], difference, of=bounced.radiance[inside]),
    }  # fmt: skip


def relit(name: str, bounces: int, steps: int = 48) -> tuple[RelightScene, tuple[RelitObject, ...]]:
    """The scene with the knot's material, relit."""
    material = "albedo = [0.7, 0.5, 0.3]" if name == ALBEDO else f'material = "material:{name}"'
    with TemporaryDirectory() as folder:
        file = Path(folder) / "scene.toml"
        file.write_text(SCENE.format(root=ROOT, material=material, bounces=bounces, steps=steps))
        given = read_relight_scene(file)
    scene = open_relight_scene(replace(given, suns=()))
    return scene, relit_objects(scene)


def rendered(scene: RelightScene, objects: Sequence[RelitObject], camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """The library's picture, and what of each pixel is surface."""
    light = environment_cube(scene.file.light, scene.file.settings.cube)
    lit = [each.lit(light) for each in objects]
    colours = [each.terms(camera.eye) for each in lit]
    return picture([each.mesh for each in objects], colours, scene.occluder, camera, scene.file.light, lit)


def cells(row: Mapping[str, object]) -> list[str]:
    """As the table has it."""
    names = ("share", "direct", "without", "with", "alone", "noise")
    shown = [str(row["material"]), *(f"{row[name]:.1%}" for name in names)]
    shown += [f"{float(str(row[f'bytes {count}'])) / 1e6:.1f}" for count in (0, 1)]
    return shown + [figure(float(str(row[f"seconds {count}"]))) for count in (0, 1)]


if __name__ == "__main__":
    raise SystemExit(main())
