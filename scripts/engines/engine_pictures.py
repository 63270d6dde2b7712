"""Draw one material under one light by our renderer and by engines that load its exports: picture and table.

    python scripts/engines/engine_pictures.py [--data FOLDER] [--size 256] [--sky FILE.hdr] [--out FILE.jpg]

With `--sky` the spheres are under that lat-long map instead of the lamp, and ours are integrated without noise.

A row each for a satin paint of the RGL database (Dupuy and Jakob 2018) and for Ward's brushed aluminium (Ward 1992),
fitted with three textures of 32². Every engine gets what `homofact export --engine` writes; for Godot under a sky that
is with `--prefilter`. The table says how far an engine's linear pixels are from our renderer's of the same stored
texels, but for the silhouette; below it stands what the exports need on a GPU. Mitsuba gets the fit itself, by our
plugin. Needed are packages of npm (`npm ci --prefix tests/containers/node`), Debian's chromium, chromium-driver and
xvfb, MaterialX and Mitsuba (`pip install 'homofact[materialx,mitsuba]'`). With `--sky`, and HOMOFACT_BLENDER set, there
is a column of Blender too.
"""

import os
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from PIL import Image, ImageDraw, ImageFont

from homofact.brdf.reflectance import Reflectance
from homofact.brdf.source import open_source
from homofact.brdf.source_names import HELD_OUT
from homofact.containers.formats import format_named
from homofact.evaluation.compare import fit_and_measure
from homofact.exporting.engine_light import EngineLight
from homofact.exporting.engines.base import Added
from homofact.exporting.engines.blender import BLENDER
from homofact.exporting.engines.blender import NAME as BLENDER_SCRIPT
from homofact.exporting.engines.gltf import NAME as LOOK_ALIKE
from homofact.exporting.engines.table import ENGINES
from homofact.exporting.exported import Exported, exported, write_exported
from homofact.exporting.prefiltered import prefiltered_export
from homofact.methods.search import Search
from homofact.rendering.environment import read_environment
from homofact.rendering.filtered import draw_sphere
from homofact.rendering.light import DEFAULT_LIGHT, EnvironmentMap
from homofact.rendering.sphere import SphereImage
from homofact.rendering.surface import RADIUS
from homofact.rendering.tonemap import DEFAULT_CURVE, automatic_exposure, displayed, encode_srgb
from homofact.shading.cost import cost_of

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.engines.draw_godot import godot_sphere
from scripts.engines.draw_materialx import materialx_sphere
from scripts.engines.draw_mitsuba import mitsuba_sphere
from scripts.engines.draw_three import three_sphere
from scripts.engines.with_blender import blender_sphere
from scripts.shared.harness import ROOT, add_effort, data_folder, markdown, parser_of
from scripts.shared.headless import chromium

PLACE = ROOT / "docs" / "pictures" / "engines.jpg"
MATERIALS = (("golden yellow", "rgl/vch_golden_yellow_rgb.bsdf"), ("brushed aluminium", "material:ward-brushed"))
PANELS = ("source", "homofact's renderer", "three.js", "MaterialX", "Mitsuba 3", "Godot 4", "glTF look-alike, three.js")
BLENDER_PANEL = "Blender, Cycles"
BOUND = 0.85  # of the radius: beyond, a pixel's mean and its middle differ
DRAWN = ("three", "materialx", "godot", "gltf")
COSTS = ("bytes of texels", "operations for a lamp", "bytes for skies", "operations for a sky")
MARGIN, CAPTION = 10, 34
BACKGROUND = 0.008  # linear


def difference(found: np.ndarray, expected: np.ndarray) -> tuple[float, float]:
    """Median and 99th percentile of the relative differences inside BOUND, dark pixels against 5% of the mean."""
    size = len(found)
    y, x = np.mgrid[:size, :size] + 0.5 - size / 2
    inner = np.hypot(x, y) < BOUND * RADIUS * size / 2
    off = np.abs(found - expected)[inner] / np.maximum(expected, 0.05 * expected[inner].mean())[inner]
    return float(np.median(off)), float(np.quantile(off, 0.99))


def drawn(
    driver: Any, place: Path, path: str, size: int, effort: Any, sky: EnvironmentMap | None
) -> tuple[list[np.ndarray], list[list[str]], list[str]]:
    """The spheres (size, size, 3), linear; rows of the table: engine, median, 99th percentile; and the costs."""

    def ours(reflectance: Reflectance) -> np.ndarray:
        return draw_sphere(reflectance, sky or DEFAULT_LIGHT, size).radiance.expand(-1, -1, 3).numpy()

    source = open_source(path, count=45_000 if isinstance(effort, str) else 2000)
    settings = Search(textures=3, size=32 if isinstance(effort, str) else 4, effort=effort)
    fit = fit_and_measure(source, settings, HELD_OUT).factorization
    spheres = [ours(source.reflectance)]
    made, added = {}, {}
    for name in DRAWN:
        engine = ENGINES[name]
        made[name] = exported(fit, format_named(engine.formats[0]))
        if name == "godot" and sky is not None:
            each = made[name]
            made[name] = replace(each, prefiltered=prefiltered_export(each.stored, sky, each.format))
        added[name] = engine.add(made[name])
        write_exported(place / name, made[name], {}, engine=name, files=added[name].files)
    fit.save(place / "fit.npz")
    spheres.append(ours(made["materialx"].stored))
    lamps = [] if sky else [DEFAULT_LIGHT]
    draw: dict[str, Callable[[], np.ndarray]] = {
        "three": lambda: three_sphere(driver, place / "a", place / "three", size, RADIUS, lamps, sky),
        "materialx": lambda: materialx_sphere(place / "materialx", size, RADIUS, lamps, sky),
        "mitsuba": lambda: mitsuba_sphere(place / "fit.npz", size, RADIUS, lamps, sky),
        "godot": lambda: godot_sphere(driver, place / "b", place / "godot", size, RADIUS, lamps, sky),
        "gltf": lambda: three_sphere(driver, place / "c", place / "gltf", size, RADIUS, lamps, sky, glb=LOOK_ALIKE),
    }
    titles: dict[str, str] = dict(zip(draw, PANELS[2:], strict=True))
    if sky is not None and "HOMOFACT_BLENDER" in os.environ:
        titles["blender"] = BLENDER_PANEL
        made["blender"] = made["materialx"]
        (place / BLENDER_SCRIPT).write_text(str(BLENDER.add(made["blender"]).files[BLENDER_SCRIPT]), encoding="utf-8")
        draw["blender"] = lambda: blender_sphere(place / "d", place / BLENDER_SCRIPT, size, [], sky)
    rows = []
    for name, way in draw.items():
        found = way()
        stored = ours(made[name].stored if name in made else fit)
        spheres.append(found)
        rows.append([titles[name], *(f"{float(f'{100 * x:.2g}'):g}%" for x in difference(found, stored))])
    return spheres, rows, costs(made["three"], added["three"])


def costs(made: Exported, added: Added) -> list[str]:
    """Bytes of the texels and scalar operations of a lamp, of the sky's table and of the sky, as three.js gets them."""
    light = added.light
    assert isinstance(light, EngineLight)
    sky = cost_of(light.program(), light.texels.nbytes)
    return [f"{made.cost.nbytes:,}", f"{made.cost.scalar}", f"{sky.nbytes:,}", f"{sky.scalar}"]


def sheet(rows: list[tuple[str, list[np.ndarray]]]) -> Image.Image:
    """The picture: a row a material, a column a renderer, one exposure a row, as in `homofact render`."""
    size = rows[0][1][0].shape[0]
    panels = (*PANELS, BLENDER_PANEL)[: len(rows[0][1])]
    wide = MARGIN + len(panels) * (size + MARGIN)
    grey = int((encode_srgb(torch.tensor(BACKGROUND)) * 255).round())
    picture = Image.new("RGB", (wide, CAPTION + len(rows) * (size + CAPTION)), (grey, grey, grey))
    pen, font = ImageDraw.Draw(picture), ImageFont.load_default(max(12, size // 18))
    y, x = np.mgrid[:size, :size] + 0.5 - size / 2
    inside = torch.from_numpy(np.clip(RADIUS * size / 2 - np.hypot(x, y) + 0.5, 0, 1))
    for k, title in enumerate(panels):
        middle = MARGIN + k * (size + MARGIN) + size // 2
        pen.text((middle, CAPTION // 2), title, (230, 230, 230), font, anchor="mm")
    for line, (name, spheres) in enumerate(rows):
        top = CAPTION + line * (size + CAPTION)
        images = [SphereImage(torch.tensor(each.copy(), dtype=torch.float64), inside) for each in spheres]
        exposure = automatic_exposure(images[0])
        for k, image in enumerate(images):
            levels = (displayed(image, exposure, BACKGROUND, DEFAULT_CURVE) * 255).round().to(torch.uint8)
            picture.paste(Image.fromarray(levels.numpy()), (MARGIN + k * (size + MARGIN), top))
        pen.text((MARGIN, top + size + CAPTION // 2), name, (230, 230, 230), font, anchor="lm")
    return picture


def main(arguments: list[str] | None = None) -> int:
    """Fit, export, draw, write the picture and print the table; 2 where the measurement is missing."""
    parser = parser_of(__doc__, "data")
    parser.add_argument("--out", type=Path, default=PLACE, help="where the picture goes")
    parser.add_argument("--sky", type=Path, help="a lat-long map, .hdr or .exr, in place of the lamp")
    parser.add_argument("--size", type=int, default=256, help="pixels of a sphere's side")
    add_effort(parser, "quick")
    chosen = parser.parse_args(arguments)
    folder = data_folder(chosen.data)
    size, effort = (64, 30) if chosen.short else (chosen.size, chosen.effort)
    sky = None if chosen.sky is None else read_environment(chosen.sky)
    rows, table, spent = [], [], []
    with tempfile.TemporaryDirectory() as place, chromium(Path(place) / "profile") as driver:
        for name, path in MATERIALS:
            where = path if path.startswith("material:") else str(folder / path)
            if where != path and not Path(where).is_file():
                print(f"nothing is drawn: no {where} (--data or HOMOFACT_DATA names the measurements)", file=sys.stderr)
                return 2
            spheres, off, cost = drawn(driver, Path(place) / name, where, size, effort, sky)
            rows.append((name, spheres))
            table += [[name, *line] for line in off]
            spent.append([name, *cost])
    chosen.out.parent.mkdir(parents=True, exist_ok=True)
    sheet(rows).save(chosen.out, quality=90)
    print(markdown(("material", "engine", "median", "99th percentile"), table, 2))
    print(markdown(("material", *COSTS), spent, 1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
