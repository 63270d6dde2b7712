"""Draw README's picture of the demo: a plastic and the blue paint, model and fit, under a lamp and a sky.

    python scripts/pictures/demo_picture.py [--out docs/pictures/demo.png]

Both are models from the literature that come with homofact; each fit is that of `make demo`: two searched textures of
16 × 16 texels.
"""

import sys
from pathlib import Path

from homofact.brdf.reflectance import Reflectance
from homofact.brdf.source import open_source
from homofact.brdf.source_names import HELD_OUT
from homofact.evaluation.compare import fit_and_measure
from homofact.figures.page import PicturePage
from homofact.files.atomic import replace_file
from homofact.methods.search import Search
from homofact.rendering.filtered import FilteredMaterial, Surroundings
from homofact.rendering.fixed_lights import sky_map
from homofact.rendering.light import DEFAULT_LIGHT
from homofact.rendering.sphere import SphereImage, render_sphere
from homofact.rendering.tonemap import DEFAULT_CURVE, automatic_exposure, tonemap

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import ROOT, parser_of

SIDE, GAP = 208, 12
MATERIALS = (
    ("Plastic, Cook and Torrance 1982", "material:cook-torrance-plastic"),
    ("Blue paint, Lafortune et al. 1997", "material:lafortune-blue-paint"),
)


def spheres(reflectance: Reflectance, sky: Surroundings) -> list[SphereImage]:
    """The sphere under the point light and under the fixed sky."""
    return [render_sphere(reflectance, DEFAULT_LIGHT, SIDE), FilteredMaterial.of(reflectance).under(sky)]


def main(arguments: list[str] | None = None) -> int:
    """Fit both, draw their spheres, write the page."""
    parser = parser_of(__doc__)
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "pictures" / "demo.png")
    chosen = parser.parse_args(arguments)
    page = PicturePage(GAP + 2 * len(MATERIALS) * (SIDE + GAP), GAP)
    sky = Surroundings.of(sky_map(), SIDE)
    for number, (title, name) in enumerate(MATERIALS):
        source = open_source(name, count=400 if chosen.short else 4000)
        settings = Search(textures=2, size=4 if chosen.short else 16, effort=1.0 if chosen.short else "normal")
        fit = fit_and_measure(source, settings, HELD_OUT).factorization
        lefts = [GAP + (2 * number + part) * (SIDE + GAP) for part in (0, 1)]
        below = page.text(title, lefts[0], GAP // 2, 2 * SIDE + GAP, bold=True)
        pairs = zip(spheres(source.reflectance, sky), spheres(fit, sky), strict=True)
        for pair in pairs:
            top, exposure = below + GAP // 2, automatic_exposure(pair[0])
            for image, left in zip(pair, lefts, strict=True):
                below = page.picture(tonemap(image, exposure, curve=DEFAULT_CURVE).pixels.numpy(), left, top)
        for words, left in (("the model", lefts[0]), (f"homofact, {fit.nbytes / 1024:.1f} KiB", lefts[1])):
            page.text(words, left, below + 4, SIDE)
    chosen.out.parent.mkdir(parents=True, exist_ok=True)
    replace_file(chosen.out, page.save)
    return 0


if __name__ == "__main__":
    sys.exit(main())
