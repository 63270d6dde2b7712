"""Measure whether a common basis of log textures pays, on the neural surrogates of MERL (never MERL itself).

COUNT materials spread over the names, each drawn at SAMPLES pairs, one set of projections for all, SIZE² texels a
texture (`sweeps.shared_basis`). Every material is left out of the basis once. Held-out log mse with ε = 1e-2, median
and worst.

    python scripts/sweeps/shared_basis.py [--count 20] [--samples 4000] [--size 16] [--directions 16] [--short]
"""

import argparse
import sys
import time
from pathlib import Path

from homofact.brdf.formats.nbrdf import load, material_names
from homofact.brdf.sampling import sample_model
from homofact.brdf.source import MEASURED_EPSILON
from homofact.evaluation.machine import machine
from homofact.methods.search import Search
from homofact.sweeps.shared_basis import SharedBasis, fit_basis

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import data_folder, figure, markdown


def spread(names: list[str], count: int) -> list[str]:
    """`count` of the names, evenly spread over all of them."""
    return [names[k * len(names) // count] for k in range(count)]


def tables(found: SharedBasis) -> str:
    """What a basis takes and how far it is off, and the same of textures of a material's own."""
    record = found.record()
    count = len(record["materials"])
    header = (
        "directions",
        "left out",
        "worst",
        "not left out",
        f"bytes among {count}",
        "own bytes, as good",
        "pays from",
    )
    rows = [
        (
            row["directions"],
            *(
                figure(row[part][what])
                for part, what in (("left_out", "median"), ("left_out", "worst"), ("inside", "median"))
            ),
            round(row["bytes"]),
            f"{'≤ ' * row['own_is_at_most']}{row['own_bytes_at_equal_error']:.0f}",
            "never" if row["pays_from"] is None else f"{'≥ ' * row['own_is_at_most']}{row['pays_from']}",
        )
        for row in record["rows"]
    ]
    own = [(round(row["bytes"]), figure(row["median"]), figure(row["worst"])) for row in record["own"]]
    return f"{markdown(header, rows, 0)}\n\n{markdown(('bytes of its own', 'median', 'worst'), own, 0)}"


def main(arguments: list[str] | None = None) -> None:
    """Print the machine, the projections, both tables and the time."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=20, help="materials")
    parser.add_argument("--samples", type=int, default=4000, help="pairs drawn for the fit, and again for the test")
    parser.add_argument("--size", type=int, default=16, help="texels along a side")
    parser.add_argument("--directions", type=int, default=16, help="of the largest basis")
    parser.add_argument("--short", action="store_true", help="four materials, 500 pairs, 6² texels")
    chosen = parser.parse_args(arguments)
    count, samples, size, directions = chosen.count, chosen.samples, chosen.size, chosen.directions
    effort: str | float = "quick"
    if chosen.short:
        count, samples, size, directions, effort = 4, 500, 6, 2, 2.0
    path = data_folder(None) / "nbrdf" / "merl_nbrdf_weights.npz"
    names = spread(material_names(path), count)
    began = time.process_time()
    models = [load(f"{path}#{name}") for name in names]
    trains, tests = ([sample_model(model, samples, seed=seed) for model in models] for seed in (0, 1))
    settings = Search(effort=effort, size=size, epsilon=MEASURED_EPSILON)
    found = fit_basis(names, trains, tests, settings, directions)
    print(machine())
    print(", ".join(found.materials[0].fit.provenance["kinds"]))
    print(tables(found))
    print(f"\n{count} materials, {samples} pairs each: {time.process_time() - began:.0f} s of a processor")


if __name__ == "__main__":
    main()
