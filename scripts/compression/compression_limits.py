"""Repeat some fits of the comparison with more of one thing at a time, to see what more bytes can gain.

    python scripts/compression/compression_limits.py [--materials A,B] [--cache FOLDER] [--data FOLDER] [--short]

Fits of the proxy nbrdf, judged by it (`compression_protocol`). "highlight" is the root mean square difference of
logarithms where θh < 10°, "rest" where it is more. The rows are written to limits.csv in the cache folder, from which
`compression_table.py` makes its table.
"""

import math
import sys
from dataclasses import replace
from pathlib import Path

import torch

from homofact.brdf.sampling import sample_model
from homofact.brdf.source_names import DEFAULT_COUNT, DEFAULT_SCHEME
from homofact.linear.normal import warm_up
from homofact.methods.search import Search

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.compression.compression_fits import METHODS, READINGS
from scripts.compression.compression_protocol import kept, pairs, scores, shown, surroundings
from scripts.data.published_fits import published
from scripts.shared.harness import data_folder, figure, parser_of, progress, write_csv

FILE, OWN = "limits.csv", READINGS[0]
FORTY_EIGHT = METHODS["ours 48 KiB"]
assert isinstance(FORTY_EIGHT, Search)
# What is changed: (settings, how many times the samples).
VARIANTS: dict[str, tuple[Search, int]] = {
    "12 KiB": (replace(FORTY_EIGHT, bytes=12288), 1),
    "48 KiB": (FORTY_EIGHT, 1),
    "192 KiB": (replace(FORTY_EIGHT, bytes=196608), 1),
    "48 KiB, four times the samples": (FORTY_EIGHT, 4),
    "48 KiB, up to five textures": (replace(FORTY_EIGHT, textures=5), 1),
    "48 KiB, --effort thorough": (replace(FORTY_EIGHT, effort="thorough"), 1),
}
COLUMNS = ("material", "fit", "textures", "bytes", "MALE", "highlight", "rest", "PSNR")


def main(arguments: list[str] | None = None) -> int:
    """Fit, judge and write the rows."""
    parser = parser_of(__doc__, "data")
    parser.add_argument("--materials", default="alum-bronze,blue-acrylic")
    parser.add_argument("--cache", type=Path, default=Path("out/compression"), help="the folder to write")
    options = parser.parse_args(arguments)
    folder = data_folder(options.data)
    warm_up()
    variants = list(VARIANTS.items())[: 1 if options.short else None]
    wi, wo = pairs()
    near = torch.rad2deg(torch.acos(((wi + wo)[:, 2] / (wi + wo).norm(dim=1)).clamp(-1, 1))) < 10
    coverage = surroundings(folder)[0].coverage
    rows = []
    for material in options.materials.split(","):
        reading = published(OWN, material, folder)
        truth = kept(options.cache, material, OWN, lambda r=reading: shown(r, folder, math.nan))
        for words, (method, times) in variants:
            samples = sample_model(reading, times * DEFAULT_COUNT, DEFAULT_SCHEME, 0)
            fit = method.fit(samples).factorization
            found = shown(fit, folder, 0.0)
            score = scores(truth, found, coverage)
            off = (found.values.clamp_min(1e-6) / truth.values.clamp_min(1e-6)).log().square()
            parts = (float(off[part].mean().sqrt()) for part in (near, ~near))
            rows.append(
                (material, words, len(fit.terms), fit.nbytes, figure(score["MALE"]), *map(figure, parts),
                 f"{score['PSNR']:.1f}")
            )  # fmt: skip
            progress(rows[-1])
    print(write_csv(options.cache / FILE, COLUMNS, rows), end="")
    return 0


if __name__ == "__main__":
    sys.exit(main())
