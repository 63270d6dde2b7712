"""How noisy light is that the exported shaders draw: relative variance of f cosθi/p, by quadrature.

    python scripts/engines/sampling_noise.py [--data FOLDER] [--effort quick] [--short]

Materials are fitted by `Search`; f is the fit, as it is exported. One direction is drawn for a viewer at each angle
(azimuth 0.4 rad): by the cosine, from the table of the Mitsuba material (`rendering.lobe_sampling`), and from the
cosine and one, two or three lobes of the shaders (`shading.lobe_mixture`). `lost` is the share of two lobes' directions
that fall under the horizon. Operations are those of `homofact_sample` and of `homofact_density` on scalars, bytes what
the density needs as float32: the numbers in the shader, or the table.
"""

import sys
from collections.abc import Sequence
from pathlib import Path

from homofact.brdf.source import open_source
from homofact.brdf.symmetry import find_symmetry
from homofact.evaluation.machine import machine
from homofact.methods.search import Search
from homofact.rendering.lobe_sampling import lobe_sampling
from homofact.shading.cost import operations_of
from homofact.shading.functions import sampling_functions
from homofact.shading.mixture_fit import fitted_mixture
from homofact.shading.noise import ANGLES, cosine_density, noise_of, viewer_at

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import add_effort, data_folder, figure, finish, markdown, parser_of

NAMED = ("lafortune-blue-paint", "cook-torrance-plastic", "phong-30", "ward-brushed")
RGL = ("vch_golden_yellow", "aurora_white", "chm_light_blue", "irid_flake_paint1")
LOBES = (1, 2, 3)
WAYS = ("cosine", "table, as in Mitsuba", "1 lobe", "2 lobes", "3 lobes")


def rows_of(name: str, place: str, effort: str | float) -> list[tuple[str, ...]]:
    """The table's lines for one material."""
    source = open_source(place)
    fitted = (
        Search(textures=2, size=16, epsilon=source.default_epsilon, effort=effort).fit(source.samples).factorization
    )
    isotropic = find_symmetry(fitted).isotropic
    table = lobe_sampling(fitted, isotropic)
    mixtures = [fitted_mixture(fitted, count) for count in LOBES]
    densities = (cosine_density, table.density, *(each.density for each in mixtures))
    sizes = ["0", str(4 * (table.table.numel() + table.cosine.numel()))]
    counts = ["–", "–"]
    for mixture in mixtures:
        sizes.append(str(4 * sum(len(each) for each in (*mixture.alphas, *mixture.weights))))
        counts.append(
            " + ".join(str(operations_of(each.statements, each.result)[1]) for each in sampling_functions(mixture))
        )
    found = [[noise_of(fitted, density, viewer_at(angle)) for angle in ANGLES] for density in densities]
    rows = []
    for k, (way, each) in enumerate(zip(WAYS, found, strict=True)):
        lost = max(0.0, *(round(1 - whole, 6) for _, whole in each))
        variances = (figure(variance) for variance, _ in each)
        rows.append((name if k == 0 else "", way, *variances, figure(lost), counts[k], sizes[k]))
    return rows


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table."""
    parser = parser_of(__doc__, "data", "out")
    add_effort(parser, "quick")
    options = parser.parse_args(arguments)
    places = {name: f"material:{name}" for name in NAMED}
    for name in RGL:
        file = data_folder(options.data) / "rgl" / f"{name}_rgb.bsdf"
        if file.is_file():
            places[name] = str(file)
        else:
            print(f"skipped {name}: no {file} (--data FOLDER or HOMOFACT_DATA names it)", file=sys.stderr)
    if options.short:
        places = {NAMED[0]: places[NAMED[0]]}
    effort = 1.0 if options.short else options.effort
    rows = [row for name, place in places.items() for row in rows_of(name, place, effort)]
    header = ("material", "drawn from", *(f"{angle:.0f}°" for angle in ANGLES), "lost, at most", "operations", "bytes")
    text = "\n\n".join(
        [
            markdown(header, rows, 2),
            f"Fits of two textures of 16², searched with effort {effort}." + f" {machine()}",
        ]
    )
    return finish(text, options)


if __name__ == "__main__":
    sys.exit(main())
