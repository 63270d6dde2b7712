"""How far the split sum of a sky's chain is from the exact integration: a table, and pictures of spheres.

    python scripts/engines/split_sum_errors.py [--data FOLDER] [--effort quick] [--picture PLACE.png] [--short]

Relative RMS of a sphere's picture of 96² pixels against `render_filtered` of the same fit. "2 lobes" under a sky of 256
texels a side is what `homofact export --prefilter` writes; beside it one lobe, and a sky of 128 texels.
"""

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from matplotlib.figure import Figure

from homofact.brdf.source import open_source
from homofact.evaluation.machine import machine
from homofact.exporting.prefiltered import SIZE, compared, in_halves, picture
from homofact.files.atomic import replace_file
from homofact.methods.search import Search
from homofact.rendering.environment import read_environment
from homofact.rendering.filtered import render_filtered
from homofact.rendering.light import EnvironmentMap
from homofact.rendering.prefilter import prefiltered
from homofact.rendering.sky_chain import SIDE, chain_of
from homofact.rendering.sphere import SphereImage
from homofact.rendering.split_sum import response_of
from homofact.rendering.tonemap import choose_exposure, tonemap

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import add_effort, data_folder, figure, finish, markdown, parser_of

NAMED = ("lafortune-blue-paint", "phong-30", "ward-brushed")
RGL = ("vch_golden_yellow", "aurora_white", "chm_light_blue")
# Texels of the sky, and lobes.
WAYS = ((SIDE, 2), (SIDE, 1), (SIDE // 2, 2))
SKIES = ("grace_probe_latlong", "stpeters_probe_latlong", "studio_small_03_1k")


def made_up() -> EnvironmentMap:
    """A sky with one soft lamp, where no measured ones are there."""
    level = torch.ones(32, 64, 1, dtype=torch.float64)
    level[6:10, 40:48] = 30
    return EnvironmentMap(level, name="lamp")


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
    add_effort(parser, "quick")
    options = parser.parse_args(arguments)
    folder = data_folder(options.data)
    places = {name: f"material:{name}" for name in NAMED}
    files = {name: folder / "rgl" / f"{name}_rgb.bsdf" for name in RGL}
    skies = [folder / "envmaps" / f"{name}.hdr" for name in SKIES]
    for file in (*files.values(), *skies):
        if not file.is_file():
            print(f"skipped {file.stem}: no {file} (--data FOLDER or HOMOFACT_DATA names it)", file=sys.stderr)
    places |= {name: str(file) for name, file in files.items() if file.is_file()}
    lights = [read_environment(file) for file in skies if file.is_file()] or [made_up()]
    if options.short:
        places, lights = {NAMED[1]: places[NAMED[1]]}, [made_up()]
    effort = 1.0 if options.short else options.effort
    sides = {side for side, _ in WAYS} if not options.short else {SIDE // 4}
    ways = [(side if side in sides else SIDE // 4, lobes) for side, lobes in WAYS]
    skies_of = {(side, light.name): in_halves(chain_of(light, side)) for side in sides for light in lights}
    rows, spheres = [], []
    for name, place in places.items():
        source = open_source(place)
        method = Search(textures=2, size=16, epsilon=source.default_epsilon, effort=effort)
        fitted = method.fit(source.samples).factorization
        responses = [response_of(fitted, side, lobes) for side, lobes in ways]
        seen = []
        for k, light in enumerate(lights):
            exact = render_filtered(fitted, light, SIZE)
            found = [picture(prefiltered(each, skies_of[each.side, light.name]), SIZE) for each in responses]
            rows.append((name if k == 0 else "", light.name, *(figure(compared(each, exact)) for each in found)))
            seen.append((name, exact, found[0]))
        spheres.append(seen[-1])
    sizes = ", ".join(
        f"{skies_of[side, lights[0].name].nbytes / 2**20:.2f} MiB of {side}²" for side in sorted(sides, reverse=True)
    )
    text = "\n\n".join(
        [
            markdown(
                ("material", "environment", *(f"{side}², {lobes} lobe{'s' * (lobes > 1)}" for side, lobes in ways)),
                rows,
                2,
            ),
            f"A sky for all materials: {sizes}. Fits of two textures of 16², searched with effort {effort}."
            + f" {machine()}",
        ]
    )
    finish(text, options)
    if options.picture is not None:
        drawn(options.picture, spheres)
    return 0


if __name__ == "__main__":
    sys.exit(main())
