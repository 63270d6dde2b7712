"""Make the gallery of editing: figures 2, 4, 5 and 6 of Ben-Artzi (2006) on our meshes, with real paints.

    python scripts/editing/editing_figures.py [--data FOLDER] [--only NAME ...] [--out docs/editing_gallery.md]

Pictures go into the folder `pictures` beside the page. Needs the shared measurements: an RGL paint, a Cornell paint,
the bunny and the Grace probe; without them our own stand in for them, and the page says so.
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

import homofact
from homofact.brdf.analytic import AshikhminShirley, CookTorrance
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.source import open_source
from homofact.editing import models
from homofact.editing.curves import Bands, band_centres
from homofact.editing.enlarged import enlarged
from homofact.editing.factored import half_and_diffuse
from homofact.editing.picture import Address, starting_curves
from homofact.editing.precompute import prepare
from homofact.editing.scene import EditObject, EditScene, PreparedScene
from homofact.editing.session import Session
from homofact.editing.wavelets import TERMS, non_linear
from homofact.evaluation.machine import machine
from homofact.files.atomic import replace_file
from homofact.linear.threads import one_thread
from homofact.meshes.mesh import Mesh, read_mesh
from homofact.meshes.shapes import ground, sphere, torus_knot
from homofact.rendering.environment import read_environment
from homofact.rendering.sphere import SphereImage
from homofact.rendering.tonemap import choose_exposure, tonemap
from homofact.scene.cameras import Camera
from homofact.scene.lighting import Lighting, named_lighting

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import data_folder, parser_of, progress, write

# Triangles of light of all figures but the fourth, whose subject they are.
LIGHTS = 2400
Panel = np.ndarray | tuple[Bands, ...]
GLOSSY = CookTorrance((0.02, 0.02, 0.02), (6.0, 5.7, 4.7), 0.03, 0.06)
PEARL = CookTorrance((0.35, 0.32, 0.3), (0.8, 0.8, 0.8), 0.02, 0.06)
TEAPOT = AshikhminShirley((0.15, 0.15, 0.16), (0.6, 0.6, 0.62), 60, 60)
TRAY = CookTorrance((0.3, 0.17, 0.08), (0.5, 0.5, 0.5), 0.25, 0.05)


@dataclass(frozen=True)
class Found:
    """What there is to make pictures of: `words` name each thing."""

    paint: Reflectance
    fit: Reflectance
    bunny: Mesh
    light: Lighting
    words: dict[str, str]


def found(folder: Path, short: bool) -> Found:
    """The shared measurements, or what stands in for them."""
    rgl, cornell = folder / "rgl" / "vch_golden_yellow_rgb.bsdf", folder / "cornell" / "garnet_red.brdf"
    bunny, probe = folder / "meshes" / "bunny.ply", folder / "envmaps" / "grace_probe_latlong.hdr"
    if short or not all(each.is_file() for each in (rgl, cornell, bunny, probe)):
        plastic = open_source("material:cook-torrance-plastic").reflectance
        words = {
            "paint": "a built-in plastic",
            "fit": "the same plastic",
            "bunny": "torus knot",
            "light": "the built-in lighting studio",
        }
        return Found(plastic, plastic, torus_knot(), named_lighting("studio"), words)
    fit = homofact.fit(homofact.read(str(cornell)), homofact.McCool(size=32))
    light = read_environment(probe)
    words = {
        "paint": f"the RGL paint {rgl.stem.removesuffix('_rgb')}",
        "fit": f"a fit (McCool's projections) of the Cornell paint {cornell.stem}",
        "bunny": "Stanford bunny",
        "light": "the environment map of Grace Cathedral",
    }
    return Found(open_source(str(rgl)).reflectance, fit.factorization, whole(read_mesh(bunny)),
                 Lighting("grace", (light,), light.describe()), words)  # fmt: skip


def whole(mesh: Mesh, size: float = 1.0, at: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Mesh:
    """A mesh within a sphere of radius `size` about a place."""
    middle = (mesh.positions.max(0) + mesh.positions.min(0)) / 2
    radius = np.linalg.norm(mesh.positions - middle, axis=1).max()
    positions = (mesh.positions - middle) / radius * size + np.array(at)
    return Mesh(positions, mesh.normals, mesh.triangles, mesh.name)


def bump(curve: Bands, at: float, width: float, height: float) -> torch.Tensor:
    """(J, 1)."""
    return torch.exp(-(((band_centres(curve.count, curve.finer) - at) / width) ** 2))[:, None] * height


def shown(prepared: PreparedScene, values: torch.Tensor, exposure: float | None = None) -> tuple[np.ndarray, float]:
    """(8-bit sRGB, the exposure) of the first view, enlarged as `homofact edit` does, the light's map behind."""
    found = enlarged(prepared, 0, values.clamp_min(0), 3)
    chosen = choose_exposure(SphereImage(found.radiance, found.coverage)) if exposure is None else exposure
    whole = SphereImage(found.radiance, torch.ones_like(found.coverage))
    return tonemap(whole, chosen).pixels.numpy(), chosen


def drawn(target: Path, rows: Sequence[Sequence[tuple[str, Panel]]], wide: float = 2.3) -> None:
    """Panels in rows with their titles: pictures (H, W, 3), or a curve's first channel (before, after) over degrees."""
    columns = max(len(row) for row in rows)
    first = next(what for row in rows for _, what in row if isinstance(what, np.ndarray))
    tall = wide * first.shape[0] / first.shape[1]
    figure = Figure(figsize=(wide * columns, (tall + 0.32) * len(rows)), layout="constrained")
    axes = figure.subplots(len(rows), columns, squeeze=False)
    for place in axes.flat:
        place.set_axis_off()
    for row, line in zip(rows, axes, strict=True):
        for (title, what), place in zip(row, line, strict=False):
            place.set_title(title, fontsize=8)
            if isinstance(what, np.ndarray):
                place.imshow(what, interpolation="antialiased")
                continue
            place.set_axis_on()
            lowest_shown = 1e-3 * max(float(each.values[:, 0].max()) for each in what)
            for curve, style in zip(what, ("0.6", "C0", "C3"), strict=False):
                degrees = np.degrees(band_centres(curve.count, curve.finer).numpy())
                place.semilogy(degrees, np.maximum(curve.values[:, 0].numpy(), lowest_shown), color=style, linewidth=1)
            lowest, highest = place.get_ylim()
            place.yaxis.set_major_formatter("{x:g}")
            # Little more than a decade has hardly any labels but those between.
            place.yaxis.set_minor_formatter("{x:g}" if highest < 15 * lowest else NullFormatter())
            place.tick_params(which="both", labelsize=6)
            place.set_xlabel("degrees", fontsize=6)
    target.parent.mkdir(parents=True, exist_ok=True)
    replace_file(target, lambda place: figure.savefig(place, dpi=110, format="png"))


def figure_4(have: Found, target: Path, pixels: int, few: bool) -> list[str]:
    """Triangles against points, of a mirror-like ball."""
    view = Camera((0.0, 0.3, 4.0), (0.0, 0.0, 0.0), 31, (pixels // 2, pixels // 2), "ball")
    counts = ((30, 60, 120), (30, 60, 120)) if few else ((100, 400, 4000), (400, 4000, 10_000))
    rows, exposure = [], None
    for word, material, numbers in (
        ("triangles", models.cook_torrance(GLOSSY, "x", (256, 32)), counts[0]),
        ("points", models.from_reflectance(GLOSSY, ("theta_i",), "x", (32,)), counts[1]),
    ):
        row = []
        for number in numbers:
            scene = EditScene((EditObject(sphere(48), material),), have.light, (view,))
            prepared = prepare(scene, number, divided=0 if word == "points" else None)
            values = Session(prepared).picture(0)
            if exposure is None:
                _, exposure = shown(prepared, values)
            row.append((f"{number} {word}", shown(prepared, values, exposure)[0]))
        rows.append(row)
    drawn(target, rows)
    return [
        "Area lights compared with point lights, as in figure 4 of Ben-Artzi et al. 2006. The ball has Cook and"
        f" Torrance's model with sigma 0.03, under {have.words['light']}. The environment map is divided into"
        " triangles. Point lights evaluate the material only at the centres of the triangles."
    ]


def figure_5(have: Found, target: Path, pixels: int, few: bool) -> list[str]:
    """Increments against non-linear approximation by as many wavelets."""
    view = Camera((0.0, 0.4, 3.6), (0.0, 0.0, 0.0), 36, (pixels, pixels), "knot")
    scene = EditScene((EditObject(torus_knot(), models.cook_torrance(PEARL, "pearl")),), have.light, (view,))
    prepared = prepare(scene, 60 if few else LIGHTS)
    session, address = Session(prepared), ("pearl", "specular", "distribution")
    start = session.curves[address]
    tint = torch.tensor([[1.0, 0.55, 0.25]], dtype=torch.float64)
    # A hand's line: steep on one side, with a dent.
    gamma = band_centres(start.count, start.finer)[:, None]
    rise = torch.where(gamma > 0.45, torch.exp(-(gamma - 0.45) / 0.35), 0.0) * (1 + 0.3 * torch.sin(40 * gamma))
    edited = replace(start, values=start.values + 3.0 * rise * tint)
    session.picture(0)
    stroke = session.stroke(address)
    stroke.set(edited)
    stroke.update(TERMS)
    incremental = stroke.picture(0)
    session.set({address: edited})
    reference = session.picture(0)
    ((number, _),) = stroke.parts.items()
    part = prepared.parts[number]
    table = part.transport.frozen(0, [edited.values, session.curves["pearl", "specular", "fresnel"].values])
    rest = reference - part_of(table, edited.values)
    approximated = rest + non_linear(table, edited.values, TERMS)
    size = float(reference.square().mean().sqrt())
    errors = [float((each - reference).square().mean().sqrt()) / size for each in (incremental, approximated)]
    picture, exposure = shown(prepared, reference)
    rows = [[
        ("the curve, before and after", (start, edited)),
        ("all 256 bands", picture),
        (f"increment of {TERMS} wavelets", shown(prepared, incremental, exposure)[0]),
        (f"{TERMS} wavelets of the curve", shown(prepared, approximated, exposure)[0]),
    ]]  # fmt: skip
    drawn(target, rows)
    return [
        "Incremental updates compared with non-linear approximation, as in figure 5. The edit draws a coloured rise"
        f" beside the narrow peak of a Cook-Torrance curve. One frame adds {TERMS} wavelets of the change of the curve."
        f" After this frame, the error of the picture is {errors[0]:.2%}. With the {TERMS} largest wavelets of the"
        f" curve itself, the error is {errors[1]:.2%}. Both are relative RMS errors, compared with the picture from all"
        " bands."
    ]


def part_of(table: torch.Tensor, curve: torch.Tensor) -> torch.Tensor:
    """R (P, C) of one part."""
    return torch.einsum("pcj,jc->pc", table.double(), curve)


def told(prepared: PreparedScene, steps: list[tuple[str, dict[Address, Bands]]], target: Path) -> None:
    """A session as pictures, with the curve that each step changed under it."""
    session = Session(prepared)
    picture, exposure = shown(prepared, session.picture(0))
    pictures: list[tuple[str, Panel]] = [("(a) as it starts", picture)]
    curves: list[tuple[str, Panel]] = [("", np.full((8, 8, 3), 255, np.uint8))]
    for letter, (words, changes) in zip("bcdefg", steps, strict=False):
        before = session.curves
        session.set(changes)
        pictures.append((f"({letter}) {words}", shown(prepared, session.picture(0), exposure)[0]))
        address = next(iter(changes))
        curves.append((": ".join(address), (before[address], session.curves[address])))
    drawn(target, [pictures, curves])


def session_2(have: Found, target: Path, pixels: int, few: bool) -> list[str]:
    """In the manner of figure 2: an RGL paint and a Cornell paint, freehand, and a model by its sliders."""
    floor = float(have.bunny.positions[:, 1].min())
    things = (
        EditObject(have.bunny, models.from_reflectance(have.paint, ("theta_h", "theta_d"), "bunny", (128, 32))),
        EditObject(whole(sphere(40), 0.42, (0.95, floor + 0.42, 0.75)),
              models.from_reflectance(have.fit, ("theta_h", "theta_d"), "ball", (128, 32))),
        EditObject(ground(1.9, floor, 24), models.cook_torrance(TRAY, "floor", (128, 32))),
    )  # fmt: skip
    view = Camera((0.5, 1.3, 4.6), (0.2, -0.15, 0.0), 30, (pixels * 4 // 3, pixels), "front")
    prepared = prepare(EditScene(things, have.light, (view,)), 60 if few else LIGHTS)
    gloss, haze, edge = ("bunny", "whole", "theta_h"), ("ball", "whole", "theta_h"), ("ball", "whole", "theta_d")
    # All three are 1 as they start.
    one, other = starting_curves(prepared)[gloss], starting_curves(prepared)[edge]
    sharp = one.values * (0.35 + bump(one, 0.0, 0.12, 6.0))
    golden = torch.tensor([[9.0, 6.0, 1.0]], dtype=torch.float64)
    steps = [
        ("bunny: a sharper gloss", {gloss: replace(one, values=sharp)}),
        ("bunny: and a haze", {gloss: replace(one, values=sharp + bump(one, 0.55, 0.2, 1.5))}),
        ("ball: a golden ring", {haze: replace(one, values=one.values + bump(one, 0.5, 0.12, 1.0) * golden)}),
        ("ball: brighter at grazing", {edge: replace(other, values=other.values + bump(other, 1.5, 0.35, 6.0))}),
    ]
    told(prepared, steps, target)
    return [
        f"An editing session as in figure 2, under {have.words['light']}. The {have.words['bunny']} has"
        f" {have.words['paint']}. The ball has {have.words['fit']}. All curves are drawn by hand and edit measured"
        " materials. A grey curve is from before the step, a blue curve from after it."
    ]


def session_6(have: Found, target: Path, pixels: int, few: bool) -> list[str]:
    """In the manner of figure 6: anisotropy, a sharper tray, another metal."""
    things = (
        EditObject(whole(torus_knot(), 0.95, (-0.2, 0.2, 0.0)), models.ashikhmin_shirley(TEAPOT, "knot")),
        EditObject(whole(sphere(40), 0.35, (0.95, -0.4, 0.6)), half_and_diffuse(have.paint, "ball", (128, 32))),
        EditObject(ground(1.7, -0.75, 24), models.cook_torrance(TRAY, "tray", (128, 32))),
    )
    view = Camera((0.0, 1.7, 4.6), (0.1, -0.15, 0.0), 30, (pixels * 4 // 3, pixels), "front")
    prepared = prepare(EditScene(things, have.light, (view,)), 60 if few else LIGHTS)
    made = {thing.material.name: thing.material for thing in things}

    def slid(address: Address, **values: float) -> dict[Address, Bands]:
        slot = made[address[0]].slot(address[1:])
        assert slot.sliders is not None
        return {address: slot.banded(slot.sliders.curve(**values))}

    half, green = ("ball", "specular", "half"), torch.tensor([[0.4, 1.5, 8.0]], dtype=torch.float64)
    start = made["ball"].banded_start()["specular", "half"]
    steps = [
        ("knot: brushed, nu 60 to 6", slid(("knot", "specular", "alpha"), nu=6)),
        ("knot: nv 60 to 600", slid(("knot", "specular", "beta"), nv=600)),
        (
            "tray: sigma 0.25 to 0.06, n 4",
            slid(("tray", "specular", "distribution"), sigma=0.06) | slid(("tray", "specular", "fresnel"), n=4.0),
        ),
        ("ball: green highlights", {half: replace(start, values=start.values * green)}),
    ]
    told(prepared, steps, target)
    return [
        f"An editing session as in figure 6, under {have.words['light']}. The knot has Ashikhmin and Shirley's model,"
        f" the tray has Cook and Torrance's model, and the ball has {have.words['paint']} in the HD form"
        " ([curves](editing.md#materials)). The steps move sliders; the last step draws a freehand curve."
    ]


FIGURES = {"area-lights": figure_4, "increments": figure_5, "session-paints": session_2, "session-tray": session_6}


def main(arguments: list[str]) -> str:
    """Draw, and give the page."""
    parser = parser_of(__doc__, "data")
    parser.add_argument("--only", nargs="+", choices=tuple(FIGURES), help="these figures alone; all unless given")
    parser.add_argument("--pixels", type=int, default=144, help="rows of a picture (%(default)s)")
    parser.add_argument("--out", type=Path, help="the page; nothing is written beside it unless given")
    given = parser.parse_args(arguments)
    page = given.out or Path("out/editing_gallery.md")
    have = found(data_folder(given.data), given.short)
    opening = (
        "This page shows what an edit looks like and how accurate its pictures are. It repeats figures 4 and 5 of"
        " Ben-Artzi, Overbeck and Ramamoorthi (2006), and shows two editing sessions like those of their figures 2"
        " and 6. [Edit a scene](editing.md) explains how to make such edits."
    )
    lines = ["# Editing: a gallery", "", opening, "",
             "Made by `python scripts/editing/editing_figures.py --out docs/editing_gallery.md`.",
             f"{machine()}.", ""]  # fmt: skip
    for name, draw in FIGURES.items():
        if name in (given.only or FIGURES):
            words = draw(have, page.parent / "pictures" / f"editing-{name}.png", 16 if given.short else given.pixels,
                         given.short)  # fmt: skip
            lines += [*words, "", f"![{name}](pictures/editing-{name}.png)", ""]
            progress(name, words[0])
    text = "\n".join(lines)
    write(page, text)
    return text


if __name__ == "__main__":
    print(one_thread(main)(sys.argv[1:]))
