"""Measure relighting at the size of Wang, Tran and Luebke 2004: precomputation, storage, speed and errors.

The bunny on a matt ground, as many vertices as in their tables 1 and 2, their Ashikhmin-Shirley material, K = 4 terms,
N = 96 coefficients, 6 × 64² texels. Light changes are of an environment that turns by 2° a frame: from nothing, and by
the largest coefficients of the change, of which so many a frame are brought in; the light's Haar transform is counted
in both, its resampling to the cube map in neither. The error of a frame is the relative root mean
square of the light towards the eye against the exact light of that frame. The clustered form's error and that of all
stages together is against the dense sum of the reflectance itself, at vertices that the eye sees.

    python scripts/relighting/relight_numbers.py [--short] [--data FOLDER] [--out FILE.md]

--short takes every 200th vertex of both.
"""

import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from homofact.brdf.analytic import Lambert
from homofact.brdf.source import open_source
from homofact.evaluation.machine import machine
from homofact.meshes.mesh import Mesh, read_mesh
from homofact.meshes.occlusion import Occluder
from homofact.meshes.shapes import ground
from homofact.relighting.build import RelitObject
from homofact.relighting.clusters import clustered
from homofact.relighting.cube import environment_cube
from homofact.relighting.errors import measured_errors, relative
from homofact.relighting.factoring import factor
from homofact.relighting.precompute import TransportSettings, WaveletTransport, transport
from homofact.relighting.relight import Relit, shaded
from homofact.relighting.seen import seen_vertices
from homofact.rendering.environment import read_environment

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import data_folder, figure, markdown, parser_of, write

MATERIAL = "material:ashikhmin-shirley-wang"
EYE = (0.6, 0.5, 3.0)
TERMS, KEPT, FRAMES, A_FRAME = 4, 96, 20, 100
LEDGER_VERTICES = 100


def fastest(run: Callable[[], object], times: int = 10) -> float:
    """Seconds of the fastest of so many runs: other work on a machine can only add."""
    found = []
    for _ in range(times):
        began = time.perf_counter()
        run()
        found.append(time.perf_counter() - began)
    return min(found)


def thinned(mesh: Mesh, every: int) -> Mesh:
    """Every so many vertices: transport of fewer points, in the shadow of the whole."""
    kept = np.arange(0, len(mesh.positions), every)
    return replace(mesh, positions=mesh.positions[kept], normals=mesh.normals[kept])


def both(relits: list[Relit], what: Callable[[Relit], object]) -> Callable[[], object]:
    """The same for object and ground."""
    return lambda: [what(each) for each in relits]


def turning(relits: list[Relit], skies: list[np.ndarray]) -> tuple[float, list[float]]:
    """(seconds per frame of steps under a turning light, their errors frame by frame)."""
    exact = [Relit(each.transport) for each in relits]
    seconds, errors = [], []
    for sky in skies:
        began = time.perf_counter()
        for each in relits:
            each.ask(sky)
            each.step(A_FRAME)
        seconds.append(time.perf_counter() - began)
        for each in exact:
            each.relight(sky)
        shown = [np.concatenate([one.shade(EYE) for one in some]) for some in (relits, exact)]
        errors.append(relative(shown[0], shown[1]))
    return float(np.median(seconds)), errors


def main(arguments: list[str] | None = None) -> int:
    """Measure, print, and write where it is asked for."""
    parser = parser_of(__doc__, "data", "out")
    chosen = parser.parse_args(arguments)
    every = 200 if chosen.short else 1
    folder = data_folder(chosen.data)
    if not (folder / "meshes" / "bunny.ply").is_file():
        print(f"no {folder / 'meshes' / 'bunny.ply'} (--data FOLDER or HOMOFACT_DATA)", file=sys.stderr)
        return 2
    sky = read_environment(folder / "envmaps" / "stpeters_probe_latlong.hdr")
    bunny = read_mesh(folder / "meshes" / "bunny.ply")
    floor = ground(2.5, float(bunny.positions[:, 1].min()), 147)
    occluder = Occluder(
        np.concatenate((bunny.positions, floor.positions)),
        np.concatenate((bunny.triangles, floor.triangles + len(bunny.positions))),
    )
    reflectance = open_source(MATERIAL).reflectance
    factors, matt = factor(reflectance, TERMS), factor(Lambert((0.5,) * 3))
    settings = TransportSettings(kept=KEPT)
    # Compiled before anything is timed.
    transport(thinned(bunny, len(bunny.positions) // 4), factors, settings, occluder)
    began = time.perf_counter()
    made: list[WaveletTransport] = [
        transport(thinned(mesh, every), each, settings, occluder) for mesh, each in ((bunny, factors), (floor, matt))
    ]
    precomputed = time.perf_counter() - began
    relits = [Relit(each) for each in made]
    skies = [environment_cube(sky.turned(np.radians(2 * k)), 64) for k in range(FRAMES + 1)]
    for each in relits:
        each.relight(skies[0])
        each.ask(skies[1])
        each.step(A_FRAME)
        each.relight(skies[0])
    light = fastest(both(relits, lambda each: each.relight(skies[0])))
    view = fastest(both(relits, lambda each: each.shade(EYE)))
    step, errors = turning(relits, skies[1:])
    relits[0].relight(skies[0])
    exact = relits[0].shade(EYE)
    began = time.perf_counter()
    compact = clustered(made[0])
    clustering = time.perf_counter() - began
    floor_compact = clustered(made[1])
    basis = Relit(compact.basis)
    basis.relight(skies[0])
    off = relative(shaded(made[0], compact.mixed(basis.tuples), EYE), exact)
    seen = seen_vertices(bunny, reflectance, occluder, EYE, LEDGER_VERTICES) if every == 1 else None
    plain = RelitObject(bunny, MATERIAL, made[0], None)
    stages = ("truncation", "quantisation", "together")
    whole = None if seen is None else measured_errors(seen, plain, sky, stages)
    packed = None if seen is None else measured_errors(seen, replace(plain, compact=compact), sky, ("together",))
    coefficients = sum(len(each.index) for each in made)
    megabytes = sum(each.nbytes for each in made) / 1e6
    small = (compact.nbytes + floor_compact.nbytes) / 1e6
    vertices = f"{made[0].vertices} + {made[1].vertices}"
    rows = [
        ("vertices, object + ground", "36 k + 22 k", vertices),
        ("precomputation, s", "4200", figure(precomputed)),
        ("stored, MB", "84", figure(megabytes)),
        ("light change from nothing, frames per second", "7.2", figure(1 / light)),
        ("the same, million RGB coefficients per second", "–", figure(coefficients / light / 1e6)),
        (f"light change by {A_FRAME} coefficients per frame, frames per second", "–", figure(1 / step)),
        ("its error while the light turns 2° a frame: median, largest", "–",
         f"{figure(float(np.median(errors)))}, {figure(max(errors))}"),
        ("view change, frames per second", "63", figure(1 / view)),
        ("clustered, MB", "–", figure(small)),
        ("clustering the object, s", "–", figure(clustering)),
        ("clustered against not clustered, relative RMS", "–", figure(off)),
    ]  # fmt: skip
    if whole is not None and packed is not None:
        rows += [(f"against the dense sum: {name}", "–", figure(value)) for name, value in whole.errors.items()]
        rows.append(("against the dense sum, clustered: together", "–", figure(packed.errors["together"])))
        rows.append(("light below zero", "–", f"{whole.below_zero:.2%}"))
    text = f"K = {TERMS}, N = {KEPT}, 6 × 64², {MATERIAL}, St Peter's. {machine()}\n\n"
    text += markdown(("", "Wang 2004", "here"), rows)
    print(text)
    if chosen.out is not None:
        write(Path(chosen.out), text + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
