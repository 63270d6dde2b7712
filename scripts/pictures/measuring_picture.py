"""Draw the picture of docs/measuring.md: two rounds of measuring a real material, replayed.

    python scripts/pictures/measuring_picture.py [--data FOLDER] [--out docs/pictures/measuring.png]

The material is an RGL measurement that the prior has not seen. Each round asks for `EACH` directions, and is drawn with
the sphere that the prior and all samples so far make, its PSNR, and the least PSNR that was foretold for nine of ten.
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from homofact.brdf.reflectance import Reflectance
from homofact.brdf.source import open_source
from homofact.files.atomic import replace_file
from homofact.geometry.coordinates import rusinkiewicz_angles
from homofact.measuring.aims import measuring_aims
from homofact.measuring.completed import CompletedBrdf
from homofact.measuring.foretelling import aim_errors, foretold
from homofact.measuring.goniometer import Goniometer, directions_of
from homofact.measuring.posterior import before_samples
from homofact.measuring.prior import read_prior
from homofact.rendering.filtered import FilteredMaterial, Surroundings
from homofact.rendering.fixed_lights import sky_map
from homofact.rendering.sphere import SphereImage
from homofact.rendering.tonemap import DEFAULT_CURVE, automatic_exposure, tonemap

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.planning.measuring_prior import measured_rounds, values_at
from scripts.shared.harness import ROOT, data_folder, parser_of

MATERIAL, EACH, ROUNDS, SIDE = "vch_golden_yellow_rgb.bsdf", 10, 2, 200
_COLOURS = ("#1b6ca8", "#c8553d")


def _sphere(axis: Axes, image: SphereImage, exposure: float, title: str) -> None:
    axis.imshow(tonemap(image, exposure, background=1.0, curve=DEFAULT_CURVE).pixels.numpy())
    axis.set_title(title, fontsize=9)
    axis.axis("off")


def _places(axis: Axes, rounds: list[np.ndarray]) -> None:
    for number, (angles, colour) in enumerate(zip(rounds, _COLOURS, strict=False), 1):
        wi, wo = directions_of(angles)
        half, difference, _ = (each.rad2deg().numpy() for each in rusinkiewicz_angles(wi, wo))
        axis.plot(np.sqrt(half), difference, "o", color=colour, ms=7, label=f"round {number}", alpha=0.85)
    ticks = (0, 0.5, 2, 5, 10, 20, 40, 80)
    axis.set_xticks(np.sqrt(ticks), [f"{tick:g}°" for tick in ticks])
    axis.set_xlabel("half angle θh (0° is the mirror direction)", fontsize=9)
    axis.set_ylabel("difference angle θd (degrees)", fontsize=9)
    axis.set_title("directions of each round", fontsize=9)
    axis.grid(color="#e4e4e4", linewidth=0.8)
    axis.set_axisbelow(True)
    axis.legend(fontsize=8, frameon=False, loc="upper right")
    axis.tick_params(labelsize=8)


def main(arguments: list[str] | None = None) -> int:
    """Replay the rounds and draw them."""
    parser = parser_of(__doc__, "data")
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "pictures" / "measuring.png")
    chosen = parser.parse_args(arguments)
    source = open_source(str(data_folder(chosen.data) / "rgl" / MATERIAL), count=1000)
    prior = read_prior()
    aims = measuring_aims(prior.grid)
    side = 48 if chosen.short else SIDE
    sky = Surroundings.of(sky_map(), side)

    def sphere(reflectance: Reflectance) -> SphereImage:
        return FilteredMaterial.of(reflectance).under(sky)

    truth, values = sphere(source.reflectance), values_at(source.reflectance, aims.wi, aims.wo)
    exposure = automatic_exposure(truth)
    figure = Figure(figsize=(11, 6), layout="constrained")
    axes = figure.subplot_mosaic([["0", "1", "2", "truth"], ["places", "places", "error", "error"]])
    start = before_samples(prior, 3)
    steps = [
        (0, np.zeros((0, 3)), start),
        *measured_rounds(prior, source.reflectance, Goniometer(), EACH * ROUNDS, EACH),
    ]
    found, least = [], []
    for number, (count, _, posterior) in enumerate(steps):
        found.append(aim_errors(aims, values, posterior.values(aims.matrix)).psnr)
        least.append(foretold(prior, posterior, aims).psnr_least)
        title = "before measuring" if not count else f"after {count} directions"
        image = sphere(CompletedBrdf(prior.grid, posterior, ("R", "G", "B")))
        _sphere(axes[str(number)], image, exposure, f"{title}: {found[-1]:.1f} dB")
    _sphere(axes["truth"], truth, exposure, "the measurement")
    every = steps[-1][1]
    _places(axes["places"], [every[start : start + EACH] for start in range(0, len(every), EACH)])
    error, counts = axes["error"], [count for count, _, _ in steps]
    error.plot(counts, found, "o-", color="#12385f", label="PSNR against the measurement")
    error.plot(counts, least, "s--", color="#9a9a9a", label="predicted lower bound for nine of ten materials")
    error.set_xticks(counts)
    error.set_xlabel("directions measured", fontsize=9)
    error.set_ylabel("PSNR (dB)", fontsize=9)
    error.set_title("error after each round", fontsize=9)
    error.grid(axis="y", color="#e4e4e4", linewidth=0.8)
    error.legend(fontsize=8, frameon=False)
    error.tick_params(labelsize=8)
    chosen.out.parent.mkdir(parents=True, exist_ok=True)
    replace_file(chosen.out, lambda made: figure.savefig(made, dpi=100, format="png"))
    return 0


if __name__ == "__main__":
    sys.exit(main())
