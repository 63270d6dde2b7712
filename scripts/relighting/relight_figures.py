"""Repeat figures 2 and 3 of Wang, Tran and Luebke on our meshes: a highlight by K terms, a shadow by N coefficients.

    python scripts/relighting/relight_figures.py [--short] [--data FOLDER] [--out FOLDER]

Figure 2: a cow of their Ashikhmin-Shirley material in St Peter's, by 1, 2, 4, 8 and 32 in-out terms and by the
reflectance itself, with relative root mean square errors over the vertices that are seen. Theirs is under one distant
light, where as few terms are far off and leave black: its errors, and those under the lights of a studio, are printed.
Figure 3: the shadow of the bunny on
matt ground under a small light, by 16 to 256 coefficients a vertex and by 4,096; errors are of the ground that is seen.
Cube maps of 6 × 64² texels.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from matplotlib.figure import Figure

from homofact.brdf.analytic import Lambert
from homofact.brdf.source import open_source
from homofact.files.atomic import replace_file
from homofact.meshes.mesh import Mesh, read_mesh
from homofact.meshes.occlusion import Occluder
from homofact.meshes.prepare import prepared
from homofact.meshes.shapes import ground
from homofact.relighting.cube import environment_cube
from homofact.relighting.errors import relative
from homofact.relighting.factoring import factor
from homofact.relighting.picture import displayed_picture, picture
from homofact.relighting.precompute import TransportSettings, WaveletTransport, transport
from homofact.relighting.relight import Relit, shaded
from homofact.relighting.seen import SeenVertices, seen_vertices
from homofact.rendering.environment import read_environment
from homofact.rendering.light import EnvironmentMap
from homofact.scene.cameras import Camera
from homofact.scene.lighting import named_lighting, texel_directions

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import data_folder, parser_of

SUN = (0.6, 0.7, 0.5)
TERMS, KEPT = (1, 2, 4, 8, 32), (16, 32, 64, 96, 256)
COLUMNS = 3


def lamp(direction: tuple[float, float, float], degrees: float, ambient: float) -> EnvironmentMap:
    """A round light of so many degrees half width, radiance such that it sends what radiance 1 from all around does."""
    rows = 512
    w = texel_directions(rows, 2 * rows).reshape(rows, 2 * rows, 3).numpy()
    inside = w @ (np.array(direction) / np.linalg.norm(direction)) > np.cos(np.radians(degrees))
    level = 2 / (1 - np.cos(np.radians(degrees)))
    return EnvironmentMap(torch.from_numpy(np.where(inside, level, ambient)[..., None]), name="lamp")


def by_largest(made: WaveletTransport, kept: int) -> WaveletTransport:
    """The same with only the largest coefficients of each vector."""
    lengths = np.diff(made.start)
    vector = np.repeat(np.arange(len(lengths)), lengths)
    order = np.lexsort((-np.abs(made.number.astype(np.int32)), vector))
    place = np.arange(len(order)) - made.start[vector]
    chosen = np.sort(order[place < kept])
    counts = np.bincount(vector[chosen], minlength=len(lengths))
    start = np.concatenate(([0], np.cumsum(counts)))
    return replace(made, start=start, index=made.index[chosen], number=made.number[chosen])


def drawn(target: Path, pictures: list[np.ndarray], titles: list[str]) -> None:
    """The pictures in rows of `COLUMNS`, each under its title."""
    height, width = pictures[0].shape[:2]
    rows = -(-len(pictures) // COLUMNS)
    chart = Figure(figsize=(2.6 * COLUMNS, rows * (2.6 * height / width + 0.3)), layout="constrained")
    for axis, shown, title in zip(chart.subplots(rows, COLUMNS).flat, pictures, titles, strict=True):
        axis.imshow(shown)
        axis.set_title(title, fontsize=10)
        axis.axis("off")
    replace_file(target, lambda made: chart.savefig(made, dpi=130, format="png"))


def exposure_of(radiance: np.ndarray, covered: np.ndarray) -> float:
    """One factor for all pictures of a figure."""
    return 0.9 / float(np.quantile(radiance.max(-1)[covered > 0], 0.99))


def highlight(mesh: Mesh, light: EnvironmentMap, target: Path, pixels: int, size: int = 64) -> list[str]:
    """Figure 2, on cube maps of `size`; the errors under other lights, a line each."""
    reflectance = open_source("material:ashikhmin-shirley-wang").reflectance
    occluder = Occluder(mesh.positions, mesh.triangles)
    made = transport(
        mesh, factor(reflectance, max(TERMS)), TransportSettings(size, kept=min(1024, 6 * size**2)), occluder
    )
    camera = Camera((2.2, 0.9, 2.6), (0.0, 0.0, 0.0), 32.0, (pixels, pixels))
    seen = seen_vertices(mesh, reflectance, occluder, camera.eye, None)
    shots, exact, errors = by_terms(made, seen, light)
    others = {"one distant light of 4 degrees half width": lamp(SUN, 4, 0.02)}
    studio = named_lighting("studio").lights[0]
    if isinstance(studio, EnvironmentMap):
        others["the studio"] = studio
    words = []
    for name, other in others.items():
        pairs = zip(TERMS, by_terms(made, seen, other)[2], strict=True)
        words.append(f"under {name}: " + ", ".join(f"K = {terms} {error:.0%}" for terms, error in pairs))
    # Vertices turned away are mixed into the silhouette's pixels: they get the most terms.
    edge = np.setdiff1d(np.arange(len(exact)), seen.which)
    exact[edge] = shots[-1][edge]
    pictures = [picture([mesh], [each], occluder, camera, light) for each in (*shots, exact)]
    exposure = exposure_of(pictures[-1][0], pictures[-1][1])
    shown = [displayed_picture(radiance, covered, exposure) for radiance, covered in pictures]
    titles = [f"K = {terms}, error {error:.0%}" for terms, error in zip(TERMS, errors, strict=True)]
    drawn(target, shown, [*titles, "the reflectance itself"])
    return words


def by_terms(
    made: WaveletTransport, seen: SeenVertices, light: EnvironmentMap
) -> tuple[list[np.ndarray], np.ndarray, list[float]]:
    """(light (V, 3) towards the eye by each of `TERMS`; that by the reflectance itself; relative errors)."""
    relit = Relit(made)
    relit.relight(light)
    size = made.settings.cube
    exact = np.zeros((made.vertices, 3))
    exact[seen.which] = seen.dense(environment_cube(light, size), size)
    shots = []
    for terms in TERMS:
        cut = relit.tuples.copy()
        cut[:, terms:] = 0
        shots.append(shaded(made, cut, seen.eye).astype(np.float64))
    return shots, exact, [relative(each[seen.which], exact[seen.which], seen.weights) for each in shots]


def shadow(mesh: Mesh, target: Path, pixels: int, steps: int) -> None:
    """Figure 3."""
    floor = ground(1.6, float(mesh.positions[:, 1].min()), steps)
    positions = np.concatenate((mesh.positions, floor.positions))
    occluder = Occluder(positions, np.concatenate((mesh.triangles, floor.triangles + len(mesh.positions))))
    whole = 4096
    reflectance = Lambert((0.6,) * 3)
    made = transport(floor, factor(reflectance), TransportSettings(kept=whole), occluder)
    light = lamp((-0.7, 0.6, -0.2), 6, 0.15)
    camera = Camera((0.0, 2.6, 2.2), (0.15, -0.7, 0.0), 38.0, (pixels, pixels * 3 // 4))
    # What the camera sees of the ground: the rest is not in the picture.
    seen = seen_vertices(floor, reflectance, occluder, camera.eye, None)
    shown, titles = [], []
    exact = None
    grey = np.full(mesh.positions.shape, 0.05)
    for kept in (whole, *KEPT):
        relit = Relit(by_largest(made, kept))
        relit.relight(light)
        colours = relit.shade(camera.eye).astype(np.float64)
        exact = colours if exact is None else exact
        shown.append(picture([mesh, floor], [grey, colours], occluder, camera, light))
        error = f", error {relative(colours[seen.which], exact[seen.which], seen.weights):.0%}" if kept != whole else ""
        titles.append(f"N = {kept}" + error if kept != whole else "N = 4,096")
    # Room above the lit ground, which too few coefficients leave too bright.
    exposure = 0.7 * exposure_of(shown[0][0], shown[0][1])
    order = [*range(1, len(shown)), 0]
    drawn(target, [displayed_picture(shown[k][0], shown[k][1], exposure) for k in order], [titles[k] for k in order])


def main(arguments: list[str] | None = None) -> int:
    """Draw both."""
    parser = parser_of(__doc__, "data")
    parser.add_argument("--out", type=Path, default=Path("out"), help="the folder of the pictures (%(default)s)")
    chosen = parser.parse_args(arguments)
    meshes = data_folder(chosen.data) / "meshes"
    sky = data_folder(chosen.data) / "envmaps" / "stpeters_probe_latlong.hdr"
    missing = [file for file in (meshes / "spot.obj", meshes / "bunny.ply", sky) if not file.is_file()]
    if missing:
        print(f"no {missing[0]} (--data FOLDER or HOMOFACT_DATA)", file=sys.stderr)
        return 2
    chosen.out.mkdir(parents=True, exist_ok=True)
    cow, bunny = (prepared(read_mesh(meshes / name))[0] for name in ("spot.obj", "bunny.ply"))
    pixels = 40 if chosen.short else 360
    light = read_environment(sky)
    print(*highlight(cow, light, chosen.out / "relight_highlight.png", pixels, 16 if chosen.short else 64), sep="\n")
    shadow(bunny, chosen.out / "relight_shadow.png", pixels, 16 if chosen.short else 100)
    return 0


if __name__ == "__main__":
    sys.exit(main())
