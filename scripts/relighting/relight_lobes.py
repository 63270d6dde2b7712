"""Measure pictures with separate sharp lobes against the sum over every texel, by mesh, material and sky.

    python scripts/relighting/relight_lobes.py [--data FOLDER] [--meshes spot,bunny] [--materials NAMES] [--lobe auto]
        [--terms K] [--sun separate] [--work FILE.jsonl]

A mesh of the size 2 stands alone under a sky and is seen by a camera of 640 × 480. An error is the relative RMS of
--pixels pixels that see it, drawn by their area, rim included, against the sum over all 6 × 64² texels with the
reflectance itself (`picture` of `homofact relight`). The transport keeps --kept coefficients per vector; factors are
those of natural light. Skies: grace, stpeters and studio of the data, a sun of one texel 45° high, and stpeters turned
by 90°, for which nothing is computed anew; and an even sky with the same sun beside it as [[sun]]. A sun in a map
becomes a light of its own, as in a scene's file; --sun texels keeps it in the map. A file stands for its fit. Skies per
second are changes of the light from nothing, views per second are all vertices towards a new eye.
--work keeps each row as a JSON line, by mesh, material and settings, and beside the file a folder of fits, so that an
ended run goes on.
"""

import argparse
import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

from homofact.brdf.analytic import Lambert, Phong
from homofact.brdf.materials import material
from homofact.brdf.reflectance import Reflectance
from homofact.evaluation.machine import machine
from homofact.meshes.mesh import Mesh, read_mesh
from homofact.meshes.occlusion import Occluder
from homofact.meshes.shapes import torus_knot
from homofact.relighting.build import RelitObject
from homofact.relighting.cube import environment_cube
from homofact.relighting.errors import measured_errors
from homofact.relighting.factored_material import LOBES, factored
from homofact.relighting.lobe import SeparateLobe
from homofact.relighting.lobe_table import sun_tables
from homofact.relighting.map_sun import separate_sun
from homofact.relighting.precompute import TransportSettings, transport
from homofact.relighting.relit_mesh import RelitMesh
from homofact.relighting.seen import seen_pixels, seen_vertices
from homofact.relighting.sunlight import RADIUS, Sun, Sunlight
from homofact.rendering.environment import read_environment
from homofact.rendering.light import EnvironmentMap
from homofact.scene.cameras import Camera
from homofact.scene.file_fits import FileFits
from homofact.scene.lighting import named_environment
from homofact.scene.materials import open_material
from homofact.scene.meshes import MeshGroup

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import Finished, data_folder, finish, listed, markdown, parser_of, progress

MESHES = {"bunny": "bunny.ply", "spot": "spot.obj", "teapot": "teapot_wdas.obj"}
MODELS: dict[str, Reflectance] = {
    "lambert": Lambert((0.5, 0.5, 0.5)),
    "ashikhmin-shirley": material("ashikhmin-shirley-wang").model,
    "exponent 2000": Phong((0.1, 0.1, 0.1), (0.8, 0.8, 0.8), 2000),
}
FILES = {
    "golden yellow": "rgl/vch_golden_yellow_rgb.bsdf",
    "aurora white": "rgl/aurora_white_rgb.bsdf",
    "chm light blue": "rgl/chm_light_blue_rgb.bsdf",
}
PANORAMAS = {
    "grace": "grace_probe_latlong.hdr",
    "stpeters": "stpeters_probe_latlong.hdr",
    "studio": "studio_small_03_1k.hdr",
}
EYE = (0.9, 0.8, 3.4)
KEPT = 1024
BESIDE = "sun beside"
SUN = Sun(np.array([1.0, 1.0, 0.0]) / np.sqrt(2), np.full(3, 1.7), np.radians(RADIUS))
HEADER = ("mesh", "material", "K", "MB", "precompute, s", "skies/s", "views/s")


def skies(folder: Path) -> dict[str, EnvironmentMap]:
    """The skies."""
    found = {name: read_environment(folder / "envmaps" / file) for name, file in PANORAMAS.items()}
    sun = torch.full((256, 512, 3), 0.02, dtype=torch.float64)
    # One texel of the cube map holds it, 45° high.
    sun[63:65, 383:385] = 4000.0
    found["one-texel sun"] = EnvironmentMap(sun, name="sun")
    found["stpeters turned"] = found["stpeters"].turned(np.pi / 2)
    found[BESIDE] = EnvironmentMap(torch.full((16, 32, 3), 0.02, dtype=torch.float64), name=BESIDE)
    return found


def placed(mesh: Mesh) -> Mesh:
    """In the middle, 2 across."""
    low, high = mesh.positions.min(0), mesh.positions.max(0)
    return replace(mesh, positions=(mesh.positions - (low + high) / 2) * (2 / (high - low).max()))


@dataclass(frozen=True)
class Scene:
    """A mesh alone, and the skies."""

    mesh: Mesh
    occluder: Occluder
    lights: dict[str, EnvironmentMap]
    size: int = 64


def timed(work: Callable[[], object], least: float = 1.0) -> float:
    """Calls a second."""
    work()
    begun, count = time.perf_counter(), 0
    while time.perf_counter() - begun < least:
        work()
        count += 1
    return count / (time.perf_counter() - begun)


def key_of(mesh: str, name: str, lobe: str, terms: int | None, kept: int, pixels: int, sun: str = "separate") -> str:
    """What the file of finished rows calls one."""
    way = lobe if terms is None else f"{lobe}, {terms} terms"
    return f"{mesh} | {name} | {way} | {kept} kept | {pixels} pixels{' | own sun' if sun == 'separate' else ''}"


def opened(name: str, folder: Path, fits: FileFits) -> Reflectance:
    """A material by its name here: a model, or the fit of a file, made once."""
    if name not in FILES:
        return MODELS[name]
    progress(f"fitting {name}")
    return open_material(str(folder / FILES[name]), fits).reflectance


def row_of(mesh_name: str, name: str, given: Reflectance, scene: Scene, chosen: argparse.Namespace) -> dict[str, Any]:
    """K, MB, seconds of precomputing, skies and views a second, and the picture's error under each sky."""
    mesh, occluder = scene.mesh, scene.occluder
    made = factored(given, chosen.lobe, chosen.terms)
    begun, processor = time.perf_counter(), time.process_time()
    lobe = SeparateLobe.traced(made.lobe, mesh, occluder, scene.size, None)
    sight = None if lobe is None else lobe.sight
    moved = transport(mesh, made.factors, TransportSettings(scene.size, kept=chosen.kept), occluder, sight=sight)
    spent, processor = time.perf_counter() - begun, time.process_time() - processor
    stored = moved.nbytes + made.factors.view.nbytes + (0 if lobe is None else lobe.nbytes)
    pixels = seen_pixels([mesh], 0, given, occluder, Camera(EYE, field=36.0, pixels=(640, 480)), chosen.pixels)
    those = seen_vertices(mesh, given, occluder, EYE, 4)
    errors = {}
    tables = sun_tables(given, made.lobe)
    for light_name, light in scene.lights.items():
        progress(f"{mesh_name}, {name}, {light_name}")
        sky, sun = separate_sun(light) if chosen.sun == "separate" else (light, None)
        suns = (SUN,) if light_name == BESIDE else () if sun is None else (sun,)
        sunlight = Sunlight.traced(suns, tables, mesh, occluder) if suns else None
        relit = RelitObject(mesh, "", moved, None, lobe=lobe, sunlight=sunlight)
        errors[light_name] = measured_errors(those, relit, sky, ("picture",), pixels).errors["picture"]
    relit = RelitMesh(mesh, moved, (), lobe)
    radiance = environment_cube(next(iter(scene.lights.values())), scene.size)
    return {
        "terms": made.factors.terms,
        "separate": made.lobe is not None,
        "MB": stored / 1e6,
        "seconds": spent,
        "CPU seconds": processor,
        "skies": timed(lambda: relit.relight(radiance)),
        "views": timed(lambda: relit.shade(EYE)),
        "errors": errors,
    }


def main(arguments: list[str] | None = None) -> int:
    """Measure, and print the table."""
    parser = parser_of(__doc__, "data", "out")
    parser.add_argument("--meshes", help="of bunny, spot, teapot, by commas; all unless given")
    parser.add_argument("--materials", help="by commas; all unless given")
    parser.add_argument("--lobe", choices=LOBES, default="auto", help="as in a scene's file")
    parser.add_argument("--terms", type=int, help="of the factors; the rule of the scene's file unless given")
    parser.add_argument("--pixels", type=int, default=100, help="at which errors are measured")
    parser.add_argument("--kept", type=int, default=KEPT, help="coefficients of a transport vector")
    parser.add_argument("--sun", choices=("separate", "texels"), default="separate", help="of a map")
    parser.add_argument("--work", type=Path, help="keep finished rows in this file, and leave them out the next time")
    chosen = parser.parse_args(arguments)
    folder = data_folder(chosen.data)
    if not chosen.short and not (folder / "meshes").is_dir():
        print(f"no {folder / 'meshes'} (--data FOLDER or HOMOFACT_DATA)", file=sys.stderr)
        return 2
    meshes = ["knot"] if chosen.short else listed(chosen.meshes, list(MESHES), "--meshes")
    names = listed("exponent 2000" if chosen.short else chosen.materials, [*MODELS, *FILES], "--materials")
    finished = Finished(chosen.work)
    fits = FileFits(None if chosen.work is None else chosen.work.with_suffix(".fits"), chosen.work is not None)
    lights = {"studio": named_environment("studio")} if chosen.short else skies(folder)
    rows, errors = [], []
    for mesh_name in meshes:
        keys = {
            name: key_of(mesh_name, name, chosen.lobe, chosen.terms, chosen.kept, chosen.pixels, chosen.sun)
            for name in names
        }
        missing = [name for name, key in keys.items() if key not in finished]
        if missing:
            mesh = placed(torus_knot(48, 12) if chosen.short else read_mesh(folder / "meshes" / MESHES[mesh_name]))
            scene = Scene(mesh, MeshGroup([mesh]).occluder, lights, 16 if chosen.short else 64)
            for name in missing:
                given = opened(name, folder, fits)
                finished.keep(keys[name], row_of(mesh_name, name, given, scene, chosen))
        for name, key in keys.items():
            row = finished[key]
            found = list(row["errors"].values())
            errors += found
            figures = (f"{row['terms']:.0f}", f"{row['MB']:.0f}", f"{row['seconds']:.0f}")
            speeds = (f"{row['skies']:.1f}", f"{row['views']:.1f}")
            rows.append([mesh_name, name, *figures, *speeds, *(f"{each:.1%}" for each in found)])
    table = markdown((*HEADER, *lights), rows, 2)
    last = f"Median {statistics.median(errors):.1%}, worst {max(errors):.1%}. {machine()}."
    return finish(f"{table}\n\n{last}", chosen)


if __name__ == "__main__":
    raise SystemExit(main())
