"""Compare homofact's evaluation of RGL files with Mitsuba 3's `measured`, and measure their reciprocity.

Mitsuba computes in float32 and its `eval` contains cosθo. It runs in a process of its own for every file: in
version 3.9.1 an anisotropic file loaded before changes the values of an isotropic one in the same process, as
if its directions were turned or mirrored too. `--python` names another environment's interpreter.

Reciprocity error of a file: Σ|f(ωi,ωo) − f(ωo,ωi)| c / Σ ½(f(ωi,ωo) + f(ωo,ωi)) c with c = cosθi cosθo, over
the same directions, all channels; and the median of |f(ωi,ωo) − f(ωo,ωi)| over their mean.
"""

import argparse
import math
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from homofact.brdf.formats.rgl import load
from homofact.brdf.reflectance import Reflectance
from homofact.errors import BadInput, MissingDependency
from homofact.evaluation.machine import machine
from homofact.geometry.directions import draw_uniform

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import data_folder, markdown

COUNT = 100_000
SEED = 11
# Reads wi, wo (.npy) and writes f cosθo and the seconds: arguments folder, file, variant, wavelengths in nm.
_PROGRAM = """
import sys, time, numpy, mitsuba
folder, path, variant, *wavelengths = sys.argv[1:]
mitsuba.set_variant(variant)
bsdf = mitsuba.load_dict({"type": "measured", "filename": path})
context, interaction = mitsuba.BSDFContext(), mitsuba.SurfaceInteraction3f()
if wavelengths:
    interaction.wavelengths = [float(w) for w in wavelengths]
pairs = [numpy.load(f"{folder}/{name}.npy").tolist() for name in ("wi", "wo")]
begun, values = time.perf_counter(), []
for incident, outgoing in zip(*pairs):
    interaction.wi = incident
    values.append(list(bsdf.eval(context, interaction, mitsuba.Vector3f(outgoing))))
numpy.save(f"{folder}/values.npy", values)
print(time.perf_counter() - begun, mitsuba.__version__)
"""


@dataclass(frozen=True)
class Theirs:
    """Mitsuba's f cosθo (N, C) in float64, the seconds of its evaluations, and its version."""

    values: Tensor
    seconds: float
    version: str


def mitsuba_values(
    path: Path, wi: Tensor, wo: Tensor, python: str = sys.executable, wavelengths: Sequence[float] = ()
) -> Theirs:
    """Mitsuba's values for a file, RGB, or at four `wavelengths` in nm of a spectral file.

    Raises MissingDependency where `python` has no Mitsuba, BadInput where Mitsuba refuses the file.
    """
    variant = "scalar_spectral" if wavelengths else "scalar_rgb"
    with tempfile.TemporaryDirectory() as folder:
        for name, direction in (("wi", wi), ("wo", wo)):
            np.save(Path(folder) / f"{name}.npy", direction.numpy())
        command = [python, "-c", _PROGRAM, folder, str(path), variant, *map(str, wavelengths)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            if "No module named 'mitsuba'" in done.stderr:
                raise MissingDependency(f"{python}: no Mitsuba, expected the extra: pip install 'homofact[mitsuba]'")
            raise BadInput(f"{path}: Mitsuba failed: {' '.join(done.stderr.split())[-300:]}")
        seconds, version = done.stdout.split()
        return Theirs(torch.from_numpy(np.load(Path(folder) / "values.npy")).double(), float(seconds), version)


def relative_differences(ours: Tensor, theirs: Tensor) -> Tensor:
    """|ours − theirs|/|theirs| of all values (N, C) where either is not 0: infinite where theirs alone is."""
    seen = (ours != 0) | (theirs != 0)
    return (ours - theirs)[seen].abs() / theirs[seen].abs()


def reciprocity_error(reflectance: Reflectance, wi: Tensor, wo: Tensor) -> tuple[float, float]:
    """(cosine-weighted, median) reciprocity error of the module's head."""
    there, back = reflectance.evaluate(wi, wo), reflectance.evaluate(wo, wi)
    apart, mean = (there - back).abs(), (there + back) / 2
    cosines = wi[:, 2:] * wo[:, 2:]
    lit = mean > 0
    return float((apart * cosines).sum() / (mean * cosines).sum()), float((apart[lit] / mean[lit]).median())


def row(path: Path, count: int, python: str) -> tuple[list[str], str]:
    """(a file's row, Mitsuba's version)."""
    table = load(path)
    wi, wo = draw_uniform(count, torch.Generator().manual_seed(SEED))
    begun = time.perf_counter()
    signed = table.signed(wi, wo)
    seconds = time.perf_counter() - begun
    theirs = mitsuba_values(path, wi, wo, python)
    ours = signed * wo[:, 2:]
    relative = relative_differences(ours, theirs.values).sort().values
    quantiles = [float(relative[min(int(q * len(relative)), len(relative) - 1)]) for q in (0.5, 0.9, 0.99, 0.999, 1)]
    limit = math.cos(math.radians(80))
    inner = (wi[:, 2] > limit) & (wo[:, 2] > limit)
    errors = (*reciprocity_error(table, wi, wo), reciprocity_error(table, wi[inner], wo[inner])[0])
    return [
        path.stem.removesuffix("_rgb"),
        *(f"{value:.1e}" for value in quantiles),
        f"{float((signed < 0).double().mean()):.2%}",
        *(f"{value:.1%}" for value in errors),
        f"{1e6 * seconds / count:.2f}",
        f"{1e6 * theirs.seconds / count:.2f}",
    ], theirs.version


def main() -> int:
    """Print the table of all files; 2 where there is nothing to compare or the 99th percentile is above 1e-3."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="*", type=Path, help="RGB .bsdf files (those of the real data where none)")
    parser.add_argument("--data", type=Path, help="folder of real measurements")
    parser.add_argument("--count", type=int, default=COUNT, help="random pairs of directions (%(default)s)")
    parser.add_argument("--python", default=sys.executable, help="interpreter that has Mitsuba")
    arguments = parser.parse_args()
    files = arguments.files or sorted((data_folder(arguments.data) / "rgl").glob("*_rgb.bsdf"))
    if not files:
        print("no RGL files: name some, or --data FOLDER", file=sys.stderr)
        return 2
    try:
        rows, versions = zip(*(row(path, arguments.count, arguments.python) for path in files), strict=True)
    except BadInput as error:
        print(error, file=sys.stderr)
        return 2
    print(f"{arguments.count} pairs uniform on both hemispheres, seed {SEED}. Mitsuba {versions[0]}. {machine()}\n")
    header = ["file", "difference, median", "90%", "99%", "99.9%", "max", "negative values"]
    header += ["not reciprocal, weighted", "median", "weighted, below 80°", "µs, ours", "µs, theirs"]
    print(markdown(header, rows))
    return 0 if all(float(cells[3]) <= 1e-3 for cells in rows) else 2


if __name__ == "__main__":
    sys.exit(main())
