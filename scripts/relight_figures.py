"""Wang, Tran and Luebke's figures 2 and 3 on our meshes: a highlight by K terms, a shadow by N coefficients.

    python scripts/relight_figures.py [--short] [--data FOLDER] [--out FOLDER]

Figure 2: a cow of their Ashikhmin-Shirley material under one distant light, by 1, 2, 4 and 8 in-out terms and by the
reflectance itself, with relative root mean square errors over the vertices that are seen. Figure 3: the shadow of the
bunny on matt ground under a small light, by 16 to 256 coefficients a vertex and by 4,096. Cube maps of 6 × 64² texels.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from conditions import data_folder, parser_of
from matplotlib.figure import Figure

from homofact.brdf.analytic import Lambert
from homofact.brdf.source import open_source
from homofact.files.atomic import replace_file
from homofact.meshes.mesh import Mesh, read_mesh
from homofact.meshes.occlusion import Occluder
from homofact.meshes.prepare import prepared
from homofact.meshes.shapes import ground
from homofact.render.light import EnvironmentMap
from homofact.scene.placed import Camera
from homofact.scene.transport.cube import environment_cube
from homofact.scene.transport.factors import factor
from homofact.scene.transport.ledger import relative, seen_vertices
from homofact.scene.transport.picture import picture
from homofact.scene.transport.precompute import Transport, TransportSettings, transport
from homofact.scene.transport.relight import Relit, shaded
from homofact.scene.transport.result import displayed_picture

TERMS, KEPT = (1, 2, 4, 8), (16, 32, 64, 96, 256)


def lamp(direction: tuple[float, float, float], degrees: float, ambient: float) -> EnvironmentMap:
    """A round light of so many degrees half width, radiance such that it sends what radiance 1 from all around does."""
    rows = 512
    polar, azimuth = np.meshgrid(
        (np.arange(rows) + 0.5) / rows * np.pi, ((np.arange(2 * rows) + 0.5) / rows - 1) * np.pi, indexing="ij"
    )
    w = np.stack((np.sin(polar) * np.sin(azimuth), np.cos(polar), -np.sin(polar) * np.cos(azimuth)), -1)
    inside = w @ (np.array(direction) / np.linalg.norm(direction)) > np.cos(np.radians(degrees))
    level = 2 / (1 - np.cos(np.radians(degrees)))
    return EnvironmentMap(torch.from_numpy(np.where(inside, level, ambient)[..., None]), name="lamp")


def by_largest(made: Transport, kept: int) -> Transport:
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
    """The pictures in a row, each under its title."""
    height, width = pictures[0].shape[:2]
    chart = Figure(figsize=(2.6 * len(pictures), 2.6 * height / width + 0.45), layout="constrained")
    for axis, shown, title in zip(chart.subplots(1, len(pictures)), pictures, titles, strict=True):
        axis.imshow(shown)
        axis.set_title(title, fontsize=9)
        axis.axis("off")
    replace_file(target, lambda made: chart.savefig(made, dpi=130, format="png"))


def exposure_of(radiance: np.ndarray, covered: np.ndarray) -> float:
    """One factor for all pictures of a figure."""
    return 0.9 / float(np.quantile(radiance.max(-1)[covered > 0], 0.99))


def highlight(mesh: Mesh, target: Path, pixels: int) -> None:
    """Figure 2."""
    reflectance = open_source("material:ashikhmin-shirley-wang").reflectance
    occluder = Occluder(mesh.positions, mesh.triangles)
    made = transport(mesh, factor(reflectance, max(TERMS)), TransportSettings(kept=1024), occluder)
    light = lamp((0.6, 0.7, 0.5), 4, 0.02)
    relit = Relit(made)
    relit.relight(light)
    camera = Camera((2.2, 0.9, 2.6), (0.0, 0.0, 0.0), 32.0, (pixels, pixels))
    seen = seen_vertices(mesh, reflectance, occluder, camera.eye, len(mesh.positions))
    exact = np.zeros((len(mesh.positions), 3))
    exact[seen.which] = seen.dense(environment_cube(light, 64), 64)
    shots, titles = [], []
    for terms in TERMS:
        cut = relit.tuples.copy()
        cut[:, terms:] = 0
        shots.append(shaded(made, cut, camera.eye).astype(np.float64))
        titles.append(f"K = {terms}, error {relative(shots[-1][seen.which], exact[seen.which]):.0%}")
    # Vertices at grazing angles are not asked in full: they get the nearest number of terms.
    edge = np.setdiff1d(np.arange(len(exact)), seen.which)
    exact[edge] = shots[-1][edge]
    pictures = [picture([mesh], [each], occluder, camera, light) for each in (*shots, exact)]
    exposure = exposure_of(pictures[-1][0], pictures[-1][1])
    shown = [displayed_picture(radiance, covered, exposure) for radiance, covered in pictures]
    drawn(target, shown, [*titles, "the reflectance itself"])


def shadow(mesh: Mesh, target: Path, pixels: int, steps: int) -> None:
    """Figure 3."""
    floor = ground(1.6, float(mesh.positions[:, 1].min()), steps)
    positions = np.concatenate((mesh.positions, floor.positions))
    occluder = Occluder(positions, np.concatenate((mesh.triangles, floor.triangles + len(mesh.positions))))
    whole = 4096
    made = transport(floor, factor(Lambert((0.6,) * 3)), TransportSettings(kept=whole), occluder)
    light = lamp((-0.5, 0.8, 0.35), 3, 0.15)
    camera = Camera((0.0, 2.6, 2.2), (0.15, -0.7, 0.0), 38.0, (pixels, pixels * 3 // 4))
    shown, titles = [], []
    exact = None
    grey = np.full(mesh.positions.shape, 0.05)
    for kept in (whole, *KEPT):
        relit = Relit(by_largest(made, kept))
        relit.relight(light)
        colours = relit.shade(camera.eye).astype(np.float64)
        exact = colours if exact is None else exact
        shown.append(picture([mesh, floor], [grey, colours], occluder, camera, light))
        error = f", error {relative(colours, exact):.0%}" if kept != whole else ""
        titles.append(f"N = {kept}" + error if kept != whole else "N = 4,096")
    exposure = exposure_of(shown[0][0], shown[0][1])
    order = [*range(1, len(shown)), 0]
    drawn(target, [displayed_picture(shown[k][0], shown[k][1], exposure) for k in order], [titles[k] for k in order])


def main(arguments: list[str] | None = None) -> int:
    """Draw both."""
    parser = parser_of(__doc__)
    parser.add_argument("--data", type=Path, default=None, help="the folder of real measurements")
    parser.add_argument("--out", type=Path, default=Path("out"), help="the folder of the pictures (%(default)s)")
    chosen = parser.parse_args(arguments)
    meshes = data_folder(chosen.data) / "meshes"
    missing = [name for name in ("spot.obj", "bunny.ply") if not (meshes / name).is_file()]
    if missing:
        print(f"no {meshes / missing[0]} (--data FOLDER or HOMOFACT_DATA)", file=sys.stderr)
        return 2
    chosen.out.mkdir(parents=True, exist_ok=True)
    cow, bunny = (prepared(read_mesh(meshes / name))[0] for name in ("spot.obj", "bunny.ply"))
    pixels = 40 if chosen.short else 360
    highlight(cow, chosen.out / "relight_terms.png", pixels)
    shadow(bunny, chosen.out / "relight_shadow.png", pixels, 16 if chosen.short else 100)
    return 0


if __name__ == "__main__":
    sys.exit(main())
