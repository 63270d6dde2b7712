"""Time evaluations of every method of the comparison: the same directions, one run, one thread.

    python scripts/compression/compression_speed.py [--materials 3] [--cache FOLDER] [--data FOLDER] [--short]

Everything goes from unit ωi and ωo to f in three channels on the same cosine-weighted directions; a round times every
way once, each at its best batch size, and the best of the rounds counts. All are shading programs in vector
instructions by one compiler (`homofact.shading.compiled`), as `published_programs` has them. Only the Neural Processes'
decoder, a million numbers, is run by torch in float32. What is fitted is fitted to the networks' reading.

Rows are written to speeds.csv in the cache folder, from which `compression_table.py` makes its table and its chart.
"""

import csv
import os
import statistics
import sys
from pathlib import Path

import torch

from homofact.brdf.reflectance import Reflectance
from homofact.linear.normal import warm_up
from homofact.shading.compiled import Compiled, compiled_program

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.compression.compression_fits import DEFAULT_METHODS, METHODS, SharedSearch, fitted
from scripts.compression.published_programs import program_of_any
from scripts.data.published_fits import PUBLISHED, names, published
from scripts.shared.harness import data_folder, parser_of, write_csv
from scripts.speed.throughput import Way, of_compiled, of_torch, rates

FILE, COLUMNS = "speeds.csv", ("material", "method", "compiler", "bytes", "millions a second", "threads")
TORCH = "torch, float32"
# What has no program: a decoder of a million numbers is no statement a neuron.
BY_TORCH = ("nps",)


def compiled_fit(fit: Reflectance) -> Compiled:
    """A fit, published or made here, by our compiler."""
    return compiled_program(*program_of_any(fit))


def ways_of(material: str, labels: tuple[str, ...], folder: Path) -> list[Way]:
    """The ways of one material."""
    ways = []
    for kind in PUBLISHED:
        model = published(kind, material, folder)
        run = of_torch(model) if kind in BY_TORCH else of_compiled(compiled_fit(model))
        ways.append(Way(kind, run, None, model.nbytes))
    shared, reading = SharedSearch(), published("nbrdf", material, folder)
    for label in labels:
        fit, _ = fitted(reading, METHODS[label], shared)
        ways.append(Way(label, of_compiled(compiled_fit(fit)), None, fit.nbytes))
    return ways


def read(cache_folder: Path) -> list[dict[str, str]]:
    """The rows of an earlier run, none where there was none."""
    place = cache_folder / FILE
    return list(csv.DictReader(place.read_text().splitlines())) if place.is_file() else []


def median_of(rows: list[dict[str, str]], method: str) -> float | None:
    """Millions of evaluations a second of a method: the median over materials; None of one that was not timed."""
    found = [float(row["millions a second"]) for row in rows if row["method"] == method]
    return statistics.median(found) if found else None


def main(arguments: list[str] | None = None) -> int:
    """Time every way on some materials and write the rows."""
    parser = parser_of(__doc__, "data")
    parser.add_argument("--materials", type=int, default=3, help="how many, evenly among the 100")
    parser.add_argument("--cache", type=Path, default=Path("out/compression"), help="the folder to write")
    options = parser.parse_args(arguments)
    folder = data_folder(options.data)
    warm_up()
    torch.set_num_threads(1)
    # Numba has its threads from the environment, which is read when it is first loaded.
    threads = os.environ.get("NUMBA_NUM_THREADS", "all")
    every = names(folder)
    chosen = [every[(2 * k + 1) * len(every) // (2 * options.materials)] for k in range(options.materials)]
    labels, batches, rounds, least = DEFAULT_METHODS, (1 << 10, 1 << 13, 1 << 16), 15, 0.01
    if options.short:
        chosen, labels, batches, rounds, least = chosen[:1], ("GGX × 1",), (256,), 1, 1e-3
    rows = []
    for material in chosen:
        ways = ways_of(material, labels, folder)
        best = rates(ways, batches, rounds, least)
        for way in ways:
            by = TORCH if way.name in BY_TORCH else "ours"
            rows.append((material, way.name, by, way.nbytes, f"{best[way.name][0]:.4g}", threads))
            print(f"{material}, {way.name}: {best[way.name][0]:.4g} M/s at {best[way.name][1]}", file=sys.stderr)
    print(write_csv(options.cache / FILE, COLUMNS, rows), end="")
    return 0


if __name__ == "__main__":
    sys.exit(main())
