"""Compare fits with and without held-out samples, of measurements that have few rows in a narrow highlight.

    python scripts/accuracy/few_rows.py                   # all of it: some twenty minutes of one processor
    python scripts/accuracy/few_rows.py --materials chm_light_blue --seeds 1 --out rows.md

Materials of the RGL database are "measured" as a goniometer does it: six angles of incidence, viewing angles 5° or 2.5°
apart, 14 differences of azimuth. Each table is fitted twice, without 20% of its rows and with all of them, and both
fits are judged against the material itself under the sky of the fixed pictures. The summary parts the fits at the
ratio of held-out to training error at which the verdict advises a fit of all rows. "Within" counts how often the
picture's error keeps to the limit that the verdict states; a limit that it withdraws counts as kept.
"""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median

import torch

from homofact.brdf.samples import Samples
from homofact.brdf.source import Source, open_source, source_of
from homofact.evaluation.appearance import appearance
from homofact.evaluation.compare import ComparisonRow, fit_split
from homofact.evaluation.split import Split
from homofact.evaluation.verdict.noting import LARGEST_GAP
from homofact.geometry.directions import from_spherical
from homofact.methods.search import Search
from scripts.shared.harness import data_folder, figure, markdown, write

_LIGHTS = (0.0, 15.0, 30.0, 45.0, 60.0, 75.0)
_AZIMUTHS = (0.0, 15.0, 30.0, 45.0, 60.0, 75.0, 90.0, 105.0, 120.0, 135.0, 150.0, 165.0, 172.5, 180.0)
STEPS, SIZES, HELD_OUT, CHANGE = (5.0, 2.5), ((2, 16), (3, 32)), 0.2, 1.1


@dataclass(frozen=True)
class Pair:
    """Two fits of one table: without the held-out rows, and of all rows."""

    about: str
    gap: float
    sky: tuple[float, float]
    limits: tuple[float | None, float | None]

    @property
    def within(self) -> tuple[bool, bool]:
        """Whether each fit's error keeps to the limit that its verdict states; a withdrawn one is kept."""
        without, every = (limit is None or error <= limit for error, limit in zip(self.sky, self.limits, strict=True))
        return without, every


def measured(material: Source, step: float) -> Source:
    """Return what a goniometer measures of a material, viewing angles `step` degrees apart up to 85°."""
    views = torch.arange(0, 85 + step / 2, step, dtype=torch.float64)
    lights, azimuths = (torch.tensor(each, dtype=torch.float64) for each in (_LIGHTS, _AZIMUTHS))
    light, view, azimuth = (torch.deg2rad(each.reshape(-1)) for each in torch.meshgrid(
        lights, views, azimuths, indexing="ij"))  # fmt: skip
    wi, wo = from_spherical(light, torch.zeros_like(light)), from_spherical(view, azimuth)
    return source_of(Samples(wi, wo, material.reflectance.evaluate(wi, wo), isotropic=True))


def fitted_pair(material: Source, rows: Source, about: str, size: tuple[int, int], seed: int) -> Pair:
    """Fit the rows twice, and compare both fits with the material."""
    method = Search(textures=size[0], size=size[1], seed=seed)
    fits = [fit_split(rows, Split.of(rows, held_out, seed), method) for held_out in (HELD_OUT, 0.0)]
    skies, limits = zip(*(_under_the_sky(material, row) for row in fits), strict=True)
    gap = fits[0].held_out.log_mse / fits[0].train.log_mse
    return Pair(f"{about}, {size[0]} × {size[1]}², seed {seed}", gap, skies, limits)


def _under_the_sky(material: Source, row: ComparisonRow) -> tuple[float, float | None]:
    """(the fit's error against the material, the limit that the verdict states)."""
    seen = appearance(row.factorization, material)
    assert seen is not None, "measurements of RGL can be evaluated everywhere"
    return seen.off_sky, row.verdict.bars.of("sky").error


def summary(pairs: Sequence[Pair]) -> list[list[str]]:
    """Return a row for the fits with a small ratio and one for those with a large one."""
    lines = []
    for words, some in (
        (f"at most {LARGEST_GAP:g}", [pair for pair in pairs if pair.gap <= LARGEST_GAP]),
        (f"above {LARGEST_GAP:g}", [pair for pair in pairs if pair.gap > LARGEST_GAP]),
    ):
        if not some:
            continue
        better = sum(pair.sky[0] > CHANGE * pair.sky[1] for pair in some)
        worse = sum(pair.sky[1] > CHANGE * pair.sky[0] for pair in some)
        within = [f"{sum(pair.within[place] for pair in some)} of {len(some)}" for place in range(2)]
        medians = [f"{median(pair.sky[place] for pair in some):.1%}" for place in range(2)]
        lines.append([words, str(len(some)), *medians, str(better), str(worse), *within])
    return lines


def tables(pairs: Sequence[Pair]) -> str:
    """Return the table of all fits and the summary."""
    each = [
        [pair.about, figure(pair.gap), *(f"{error:.1%}" for error in pair.sky),
         *("withdrawn" if limit is None else f"{limit:.0%}" for limit in pair.limits)]
        for pair in pairs
    ]  # fmt: skip
    heads = ["fit", "held out / training", "sky, without them", "sky, all rows", "stated", "stated, all rows"]
    short = ["held out / training", "fits", "sky, without them", "sky, all rows", f"better by {CHANGE - 1:.0%}",
             "worse", "within", "within, all rows"]  # fmt: skip
    return f"{markdown(heads, each)}\n\n{markdown(short, summary(pairs))}\n"


def main() -> None:
    """Fit all that is asked for and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--materials", nargs="+", help="names of RGL files without _rgb.bsdf (all that are there)")
    parser.add_argument("--seeds", type=int, default=2, help="fits of each table (%(default)s)")
    parser.add_argument("--data", type=Path, help="folder of the real measurements")
    parser.add_argument("--out", type=Path, help="file for the tables")
    asked = parser.parse_args()
    folder = data_folder(asked.data) / "rgl"
    names = asked.materials or sorted(file.name.removesuffix("_rgb.bsdf") for file in folder.glob("*_rgb.bsdf"))
    pairs = []
    for name in names:
        material = open_source(str(folder / f"{name}_rgb.bsdf"))
        for step in STEPS:
            rows = measured(material, step)
            for size in SIZES:
                for seed in range(asked.seeds):
                    pairs.append(fitted_pair(material, rows, f"{name}, {step:g}°", size, seed))
                    print(pairs[-1].about, figure(pairs[-1].gap), file=sys.stderr, flush=True)
    print(tables(pairs))
    if asked.out is not None:
        write(asked.out, tables(pairs))


if __name__ == "__main__":
    main()
