"""Fit some materials of the comparison with seeds 0, 1 and 2.

    python scripts/compression/compression_seeds.py [--materials 3] [--seeds 3] [--cache FOLDER] [--data FOLDER]

Both the samples that are drawn and the fit take the seed. Fitted to nbrdf, judged by it and by the others
(`compression_protocol`); the rows are written to seeds.csv in the cache folder, from which `compression_table.py` makes
its table.
"""

import math
import statistics
import sys
from pathlib import Path

from homofact.linear.normal import warm_up

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.compression.compression_fits import METHODS, READINGS, SharedSearch, fitted, name_of
from scripts.compression.compression_protocol import Shown, kept, scores, shown, surroundings
from scripts.data.published_fits import names, published
from scripts.shared.harness import data_folder, parser_of, progress, write_csv

FILE, OWN = "seeds.csv", READINGS[0]
COLUMNS = ("material", "method", "seed", "MALE", "energy", "PSNR", "MALE of others", "PSNR of others")


def main(arguments: list[str] | None = None) -> int:
    """Fit, score and write the rows."""
    parser = parser_of(__doc__, "data")
    parser.add_argument("--materials", type=int, default=3, help="how many, evenly among the 100")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--cache", type=Path, default=Path("out/compression"), help="the folder to write")
    options = parser.parse_args(arguments)
    folder = data_folder(options.data)
    warm_up()
    every = names(folder)
    chosen = [every[(2 * k + 1) * len(every) // (2 * options.materials)] for k in range(options.materials)]
    labels = [label for label in METHODS if label.startswith("ours")]
    if options.short:
        chosen, labels = chosen[:1], labels[:1]
    coverage = surroundings(folder)[0].coverage
    rows = []
    for material in chosen:
        sources = {kind: published(kind, material, folder) for kind in READINGS}
        truths = {
            kind: kept(options.cache, material, kind, lambda s=source: shown(s, folder, math.nan))
            for kind, source in sources.items()
        }
        for seed in range(options.seeds):
            shared = SharedSearch()
            for label in labels:
                # Seed 0 is the table's own.
                name = name_of(label, (OWN,)) + (f", seed {seed}" if seed else "")

                def make(label: str = label, seed: int = seed, shared: SharedSearch = shared) -> Shown:
                    fit, seconds = fitted(sources[OWN], METHODS[label], shared, seed)  # noqa: B023
                    return shown(fit, folder, seconds)

                found = kept(options.cache, material, name, make)
                own = scores(truths[OWN], found, coverage)
                others = [scores(truths[kind], found, coverage) for kind in READINGS if kind != OWN]
                mean = {key: statistics.fmean(each[key] for each in others) for key in ("MALE", "PSNR")}
                figures = (own["MALE"], own["energy"], own["PSNR"], mean["MALE"], mean["PSNR"])
                rows.append((material, label, seed, *(f"{x:.6g}" for x in figures)))
                progress(rows[-1])
    print(write_csv(options.cache / FILE, COLUMNS, rows), end="")
    return 0


if __name__ == "__main__":
    sys.exit(main())
