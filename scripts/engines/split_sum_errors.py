"""Compare the split sum of prefiltered skies with the exact integration: a table, and pictures of spheres.

    python scripts/engines/split_sum_errors.py [--data FOLDER] [--effort quick] [--three] [--shape knot]
        [--picture PLACE.png] [--materials NAME ...]

Relative RMS of a sphere's picture of 96² pixels against `render_filtered` of the same fit, three textures of 32². "own
chain" is what `homofact export --prefilter` writes; "GGX, 3 lobes" what the export for three.js reads of three's own
chain, whose kernels are integrated here; with `--three` the pixels of three itself, in a headless Chromium, stand
beside them. No table was fitted to a sky. `--shape knot` measures over the pixels of a torus knot instead
(`scripts/engines/knot.py`).
"""

import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from matplotlib.figure import Figure

from homofact.brdf.source import open_source
from homofact.containers.formats import format_named
from homofact.evaluation.machine import machine
from homofact.exporting.engine_light import LOBES
from homofact.exporting.engines.three import KERNELS, THREE
from homofact.exporting.exported import exported, write_exported
from homofact.exporting.prefiltered import SIZE, compared, in_halves, picture
from homofact.factor.fitted import Fitted
from homofact.files.atomic import replace_file
from homofact.methods.search import Search
from homofact.rendering.environment import read_environment
from homofact.rendering.filtered import render_filtered
from homofact.rendering.light import EnvironmentMap
from homofact.rendering.made_skies import MADE_SKIES, made_sky
from homofact.rendering.prefilter import Prefiltered, prefiltered
from homofact.rendering.sky_chain import FilteredSky, chain_of, own_kernels
from homofact.rendering.sphere import SphereImage
from homofact.rendering.split_sum import response_of
from homofact.rendering.surface import RADIUS, seen_surface
from homofact.rendering.tonemap import choose_exposure, tonemap

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.engines.knot import Knot
from scripts.shared.harness import add_effort, data_folder, figure, finish, markdown, parser_of

NAMED = ("lafortune-blue-paint", "phong-30", "ward-brushed")
RGL = ("vch_golden_yellow", "aurora_white", "chm_light_blue")
SIDE = 256  # texels of a face of our own chain
SKIES = ("grace_probe_latlong", "stpeters_probe_latlong", "studio_small_03_1k")


def by_three(fitted: Fitted, lights: Sequence[EnvironmentMap]) -> list[SphereImage]:
    """The sphere under each light as three draws it with what `homofact export --engine three` writes."""
    from scripts.engines.draw_three import three_sphere
    from scripts.shared.headless import chromium

    with tempfile.TemporaryDirectory() as folder, chromium(Path(folder) / "profile") as driver:
        place = Path(folder)
        made = exported(fitted, format_named(THREE.formats[0]))
        write_exported(place / "fit", made, {}, engine=THREE.name, files=THREE.add(made).files)
        shown = []
        for k, light in enumerate(lights):
            pixels = three_sphere(driver, place / f"page{k}", place / "fit", SIZE, RADIUS, (), light)
            coverage, _ = seen_surface(SIZE, (0.0, 0.0, 1.0))
            # Pixels that the silhouette crosses are their middle's there, and left out.
            shown.append(SphereImage(torch.from_numpy(pixels.copy()).double(), (coverage == 1).double()))
    return shown


def shown(data: Prefiltered, knot: Knot | None) -> SphereImage:
    """The sphere or the knot by the split sum."""
    return picture(data, SIZE) if knot is None else knot.by_split_sum(data)


def drawn(path: Path, rows: list[tuple[str, SphereImage, SphereImage]]) -> None:
    """Each material's exact sphere, the split sum's, and the difference, in one exposure."""
    page = Figure(figsize=(6.6, 2.3 * len(rows)), dpi=110, facecolor="white")
    axes = page.subplots(len(rows), 3, squeeze=False)
    for line, (name, exact, found) in zip(axes, rows, strict=True):
        exposure = choose_exposure(exact)
        shown = [tonemap(image, exposure).pixels.numpy() / 255.0 for image in (exact, found)]
        difference = np.abs(shown[1] - shown[0]).mean(2)
        for place, image, title in zip(line, (*shown, difference), ("exact", "split sum", "|difference|"), strict=True):
            place.imshow(image, **({} if image.ndim == 3 else {"cmap": "magma", "vmin": 0, "vmax": 0.2}))
            place.set_title(f"{name}: {title}" if title == "exact" else title, fontsize=8)
            place.set_axis_off()
    page.tight_layout()
    replace_file(path, lambda beside: page.savefig(beside, format="png"))


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table."""
    parser = parser_of(__doc__, "data", "out")
    parser.add_argument("--picture", type=Path, help="spheres under the last environment")
    parser.add_argument("--three", action="store_true", help="draw by three.js too")
    parser.add_argument("--shape", choices=("sphere", "knot"), default="sphere", help="what is drawn")
    parser.add_argument("--materials", nargs="+", choices=(*NAMED, *RGL), help="these alone")
    add_effort(parser, "quick")
    options = parser.parse_args(arguments)
    if options.three and options.shape != "sphere":
        parser.error("--three draws spheres only")
    knot = None if options.shape == "sphere" else Knot.of(SIZE)
    folder = data_folder(options.data)
    places = {name: f"material:{name}" for name in NAMED}
    files = {name: folder / "rgl" / f"{name}_rgb.bsdf" for name in RGL}
    skies = [folder / "envmaps" / f"{name}.hdr" for name in SKIES]
    for file in (*files.values(), *skies):
        if not file.is_file():
            print(f"skipped {file.stem}: no {file} (--data FOLDER or HOMOFACT_DATA names it)", file=sys.stderr)
    places |= {name: str(file) for name, file in files.items() if file.is_file()}
    places = {name: place for name, place in places.items() if name in (options.materials or places)}
    lights = [read_environment(file) for file in skies if file.is_file()] + [made_sky(name) for name in MADE_SKIES]
    if options.short:
        places, lights = {NAMED[1]: f"material:{NAMED[1]}"}, lights[-2:-1]
    effort, size = (1.0, 8) if options.short else (options.effort, 32)
    side = 64 if options.short else SIDE
    lobes = 1 if options.short else LOBES
    known = [(own_kernels(side), 2), (KERNELS, lobes)]
    chains = {light.name: (in_halves(chain_of(light, side)), FilteredSky.of(light, KERNELS)) for light in lights}
    rows, spheres, worst = [], [], []
    for name, place in places.items():
        source = open_source(place)
        method = Search(textures=3, size=size, epsilon=source.default_epsilon, effort=effort)
        fitted = method.fit(source.samples).factorization
        responses = [response_of(fitted, kernels, count) for kernels, count in known]
        drawn_by_three = by_three(fitted, lights) if options.three else [None] * len(lights)
        seen, errors = [], []
        for light, three in zip(lights, drawn_by_three, strict=True):
            exact = render_filtered(fitted, light, SIZE) if knot is None else knot.exact(fitted, light)
            chain, sky = chains[light.name]
            ours, ggx = responses
            found = [shown(prefiltered(ours, chain), knot), shown(prefiltered(ggx, sky), knot)]
            off = [compared(each, exact) for each in found]
            if three is not None:
                off.append(compared(three, SphereImage(exact.radiance, three.coverage)))
            errors.append(off)
            rows.append(("" if seen else name, light.name, *map(figure, off)))
            seen.append((name, exact, found[-1]))
        spheres.append(seen[-1])
        columns = list(zip(*errors, strict=True))
        worst.append((name, *(f"{np.median(column):.3f} ({max(column):.3f})" for column in columns)))
    ways = (f"own chain, {side}²", f"GGX, {lobes} lobes", *["three.js"] * options.three)
    text = "\n\n".join(
        [
            markdown(("material", "environment", *ways), rows, 2),
            "Median (worst) of the environments:",
            markdown(("material", *ways), worst, 1),
            f"Fits of three textures of {size}², searched with effort {effort}. {machine()}",
        ]
    )
    finish(text, options)
    if options.picture is not None:
        drawn(options.picture, spheres)
    return 0


if __name__ == "__main__":
    sys.exit(main())
