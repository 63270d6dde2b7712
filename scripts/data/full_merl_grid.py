"""Read and fit a full MERL grid, 90 × 90 × 180 bins: seconds and peak memory of each method.

    python scripts/data/full_merl_grid.py [--material NAME] [--textures 2] [--short]

The grid is written here from a named model, into a temporary folder; each method reads and fits it in a process of
its own, with the defaults (two textures, 16², ε of measured data), without --subset. Isotropic measurements are
copied to other azimuths for McCool and Cole, at most `brdf.samples.MOST_COPIES` samples in all.
"""

import argparse
import json
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

from homofact.evaluation.machine import machine

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import figure, markdown, parser_of

METHODS = ("search", "mccool", "cole")
SHORT = {"search": {"restarts": 1, "effort": 20.0}, "cole": {"restarts": 1, "search_size": 4, "search_samples": 300}}
TARGETS = "asked: read in under 2 s, fitted within 2 GB"


def cost(path: Path, method: str, textures: int, short: bool) -> dict[str, float]:
    """Read and fit in this process: seconds, errors and the peak of resident memory in MiB."""
    from homofact.brdf.source import open_source
    from homofact.evaluation.compare import fit_and_measure
    from homofact.methods.table import method_class, settings_of_class

    source = open_source(str(path))
    found = method_class(method)
    wanted = {"textures": textures, "restarts": 6} | (SHORT.get(method, {}) if short else {})
    settings = {name: value for name, value in wanted.items() if name in settings_of_class(found)}
    row = fit_and_measure(source, found(**settings))
    return {
        "samples": row.samples,
        "read": row.seconds_read,
        "fit": row.seconds_fit,
        "total": row.seconds_total,
        "train": row.train.log_mse,
        "held_out": row.held_out.log_mse,
        "peak": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }


def main(arguments: list[str] | None = None) -> int:
    """Write the grid, run every method, print the table."""
    parser = parser_of(__doc__)
    parser.add_argument("--material", default="cook-torrance-plastic")
    parser.add_argument("--textures", type=int, default=2)
    parser.add_argument("--job", nargs=2, metavar=("FILE", "METHOD"), help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    if options.job:
        print(json.dumps(cost(Path(options.job[0]), options.job[1], options.textures, options.short)))
        return 0

    from homofact.brdf.formats import merl
    from homofact.brdf.materials import material

    print(f"{options.material} on a MERL grid, {options.textures} textures; {machine()}")
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "grid.binary"
        merl.write(path, material(options.material).model, (12, 12, 24) if options.short else (90, 90, 180))
        rows = []
        for method in METHODS:
            command = [sys.executable, __file__, "--job", str(path), method, "--textures", str(options.textures)]
            ran = subprocess.run(command + ["--short"] * options.short, check=True, capture_output=True, text=True)
            found = json.loads(ran.stdout.splitlines()[-1])
            rows.append([method, *(figure(found[key]) for key in ("samples", "read", "fit", "total", "peak"))])
            rows[-1] += [figure(found[key]) for key in ("train", "held_out")]
    header = ["method", "samples", "read s", "fit s", "total s", "peak MiB", "log MSE training", "held out"]
    print(markdown(header, rows))
    print(TARGETS)
    return 0


if __name__ == "__main__":
    sys.exit(main())
