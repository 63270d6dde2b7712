"""Measure the scatter of fits over seeds: worst over best held-out error, by number of textures.

The seed decides the folds and which samples the search sees; the split into training and held-out samples stays. The
error is the Cole error of 45,000 other pairs drawn in the discs, the RMS that of `evaluation.energy`.

    python scripts/accuracy/seeds.py [--seeds 20] [--textures 2 3 5] [--size 16] [--data FOLDER] [--out FILE.md]
"""

import sys
import time
from collections import Counter
from pathlib import Path
from statistics import median

from homofact.brdf.source import open_source
from homofact.evaluation.energy import energy_errors
from homofact.evaluation.machine import machine
from homofact.evaluation.metrics import measure
from homofact.linear.normal import warm_up
from homofact.methods.search import Search

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import data_folder, figure, finish, markdown, parser_of, progress

PAINT = "material:lafortune-blue-paint"


def sources(folder: Path) -> list[tuple[str, str]]:
    """(name, path): a model, a measured paint and a surrogate, as far as they are there."""
    paths = {
        "lafortune-blue-paint": PAINT,
        "vch_golden_yellow": str(folder / "rgl" / "vch_golden_yellow_rgb.bsdf"),
        "gold-metallic-paint": f"{folder / 'nbrdf' / 'merl_nbrdf_weights.npz'}#gold-metallic-paint",
    }
    return [(name, path) for name, path in paths.items() if path == PAINT or Path(path.split("#")[0]).is_file()]


def measured(path: str, textures: int, size: int, seeds: int, effort: str | float, count: int) -> tuple[str, ...]:
    """A line of the table but for its name."""
    source = open_source(path, count=count)
    train, _ = source.samples.split(0.2, 0)
    other = open_source(path, count=count, scheme="discs", seed=7).samples.rotated_at_random(0)
    errors, rms, mixes, seconds = [], [], Counter(), []
    for seed in range(seeds):
        began = time.perf_counter()
        method = Search(textures=textures, size=size, effort=effort, epsilon=source.default_epsilon, seed=seed)
        fit = method.fit(train)
        seconds.append(time.perf_counter() - began)
        errors.append(measure(fit.factorization, other, fit.factorization.transform).log_mse)
        rms.append(energy_errors(fit.factorization, source.reflectance, source.samples.isotropic).rms)
        mixes["+".join(sorted(fit.report.details["kinds"]))] += 1
    ratios = (max(errors) / min(errors), max(rms) / min(rms))
    return (
        str(textures), figure(min(errors)), figure(median(errors)), figure(max(errors)), f"{ratios[0]:.2f}",
        f"{ratios[1]:.2f}", str(len(mixes)), f"{median(seconds):.1f}",
    )  # fmt: skip


def main(arguments: list[str] | None = None) -> int:
    """Fit, print the table, and write it where it is asked for."""
    parser = parser_of(__doc__, "data", "effort", "out")
    parser.add_argument("--seeds", type=int, default=20, help="how many (%(default)s)")
    parser.add_argument("--textures", type=int, nargs="+", default=[2, 3, 5], help="numbers of textures")
    parser.add_argument("--size", type=int, default=16, help="texels per side (%(default)s)")
    options = parser.parse_args(arguments)
    seeds, count, size, effort, numbers = options.seeds, 45_000, options.size, options.effort, options.textures
    found = sources(data_folder(options.data))
    if options.short:
        seeds, count, size, effort, numbers, found = 2, 400, 4, 5.0, [1], found[:1]
    warm_up()
    lines = []
    for textures in numbers:
        for name, path in found:
            lines.append((name, *measured(path, textures, size, seeds, effort, count)))
            progress(*lines[-1])
    header = ("material", "textures", "best", "median", "worst", "worst/best", "RMS worst/best", "mixes", "median s")
    said = f"{seeds} seeds, {size}² texels, effort {effort}, {count} pairs, ε of the source. {machine()}"
    return finish(f"{said}\n\n{markdown(header, lines)}\n", options)


if __name__ == "__main__":
    sys.exit(main())
