"""Measure how far default fits exceed their samples beyond the measured range, and what the limit costs.

For pairs of directions outside the measured range (`brdf.quality.extrapolation`), drawn evenly in both discs and by
lobes, a fit's value is held against the largest of the nearest NEIGHBOURS samples of the same channel: nearest by the
distance |ωi − ωi'|² + |ωo − ωo'|², the least over turns about the normal, mirror images and exchange of the two, which
is no distance that the fit knows of. What is kept of the highlight: the mean of the fit over the mean of the samples,
on the brightest hundredth of the samples (at least three).

    python scripts/accuracy/beyond_the_measurement.py [--count 3000] [--effort normal] [--data FOLDER] [--out FILE.md]
"""

import sys
from pathlib import Path

import torch
from torch import Tensor

from homofact.brdf.pair_density import draw_lobe
from homofact.brdf.quality.extrapolation import Extrapolation
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.samples import Samples
from homofact.brdf.source import open_source
from homofact.evaluation.machine import machine
from homofact.evaluation.metrics import measure
from homofact.factor.factorization import Factorization
from homofact.geometry.directions import draw_in_discs
from homofact.methods.search import Search

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import ROOT, cornell_files, data_folder, figure, finish, markdown, parser_of, progress

NEIGHBOURS = 16
SHAPES = ((2, 16), (3, 32))
SYNTHETIC = ROOT / "data_synthetic" / "synthetic_cornell.brdf"
_CHUNK = 200


def closeness(wi: Tensor, wo: Tensor, samples: Samples) -> Tensor:
    """ωi·Rωi' + ωo·Rωo' (N, M), the most over turns and mirror images R and exchange: 2 less half the distance."""
    plane = [torch.complex(w[:, 0], w[:, 1]) for w in (wi, wo, samples.wi, samples.wo)]
    height = [w[:, 2] for w in (wi, wo, samples.wi, samples.wo)]
    best = wi.new_full((len(wi), len(samples)), -torch.inf)
    for one, two in ((2, 3), (3, 2)):
        level = height[0][:, None] * height[one] + height[1][:, None] * height[two]
        for turned in (plane[one], plane[one].conj()):
            other = plane[two] if turned is plane[one] else plane[two].conj()
            flat = (plane[0].conj()[:, None] * turned + plane[1].conj()[:, None] * other).abs()
            best = torch.maximum(best, level + flat)
    return best


def largest_neighbours(wi: Tensor, wo: Tensor, samples: Samples) -> Tensor:
    """The largest value of each channel among the nearest samples (N, C)."""
    found = []
    for one, two in zip(wi.split(_CHUNK), wo.split(_CHUNK), strict=True):
        nearest = closeness(one, two, samples).topk(min(NEIGHBOURS, len(samples)), dim=1).indices
        found.append(samples.values[nearest].amax(1))
    return torch.cat(found)


def pairs_outside(samples: Samples, count: int) -> tuple[Tensor, Tensor]:
    """`count` pairs (N, 3) outside the measured range, or as many as there are among fifty times as many draws."""
    generator = torch.Generator().manual_seed(11)
    lobe = draw_lobe(25 * count, generator)
    discs = draw_in_discs(25 * count, generator)
    wi, wo = (torch.cat(both) for both in zip(lobe, discs, strict=True))
    outside = Extrapolation(samples).outside(wi, wo).nonzero()[:, 0]
    chosen = outside[torch.randperm(len(outside), generator=generator)[:count]]
    return wi[chosen], wo[chosen]


def kept(fit: Reflectance, samples: Samples) -> float:
    """Fit over samples on the brightest hundredth of the samples, by the mean of the channels."""
    brightness = samples.values.mean(1)
    brightest = brightness.topk(max(3, len(samples) // 100)).indices
    found = fit.evaluate(samples.wi[brightest], samples.wo[brightest])
    return float(found.mean() / samples.values[brightest].mean())


def line(name: str, samples: Samples, textures: int, size: int, effort: str | float, epsilon: float, count: int):
    """A row of the table: one fit to all samples."""
    fit = Search(textures=textures, size=size, effort=effort, epsilon=epsilon).fit(samples).factorization
    assert isinstance(fit, Factorization)
    wi, wo = pairs_outside(samples, count)
    values, neighbours = fit.evaluate(wi, wo), largest_neighbours(wi, wo, samples)
    # Under ε of the mean a measurement says nothing.
    ratio = (values / torch.maximum(neighbours, epsilon * samples.values.mean(0))).amax(1)
    quantiles = [float(ratio.quantile(q)) for q in (0.5, 0.99, 1.0)]
    over = float((ratio > 1.2).double().mean())
    whole = float((values / samples.values.amax(0)).max())
    cole = measure(fit, samples.rotated_at_random(0), fit.transform).log_mse
    row = (
        name, f"{textures} × {size}²", *(figure(q) for q in quantiles), f"{100 * over:.2g}%", figure(whole),
        f"{kept(fit, samples):.3f}", figure(cole),
    )  # fmt: skip
    progress(*row)
    return row


def main(arguments: list[str] | None = None) -> int:
    """Print (and with --out write) the table; returns the exit code."""
    parser = parser_of(__doc__, "data", "effort", "out")
    parser.add_argument("--count", type=int, default=3000, help="pairs outside the measured range (%(default)s)")
    chosen = parser.parse_args(arguments)
    folder = data_folder(chosen.data)
    files, missing = cornell_files(folder)
    tape = folder / "retro" / "retro-3M-jaune.dat"
    if tape.is_file():
        files.append(tape)
    else:
        missing.append(f"skipped {tape.stem}: no {tape} (--data FOLDER or HOMOFACT_DATA names the real measurements)")
    for message in missing:
        print(message, file=sys.stderr)
    files = [SYNTHETIC] if chosen.short else [SYNTHETIC, *files]
    shapes, effort, count = (((1, 4),), 5.0, 50) if chosen.short else (SHAPES, chosen.effort, chosen.count)
    rows = []
    for path in files:
        source = open_source(str(path))
        for textures, size in shapes:
            rows.append(line(path.stem, source.samples, textures, size, effort, source.default_epsilon, count))
    heads = ("over neighbours: median", "99%", "largest", "above 1.2", "over largest sample", "highlight", "Cole error")
    parts = [
        "# Beyond the measurement",
        "Made by `python scripts/accuracy/beyond_the_measurement.py`. Outside the measured range a fit's value over"
        " the largest"
        f" of the {NEIGHBOURS} nearest samples, the worst channel of each pair; the largest value there over the"
        " largest sample; fit over samples on the brightest hundredth of the samples; the Cole error on all samples,"
        " all of which were fitted.",
        f"Effort {effort}, ε of the source, seed 0, {count} pairs. {machine()}",
        markdown(("source", "textures", *heads), rows, 2),
    ]
    return finish(parts, chosen)


if __name__ == "__main__":
    sys.exit(main())
