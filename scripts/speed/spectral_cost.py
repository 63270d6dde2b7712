"""Compare the cost of 31 spectral channels with that of three: the same evaluations in one process.

    python scripts/speed/spectral_cost.py [--data FOLDER] [--repeats 5] [--evaluations 60] [--out FILE.md] [--short]

A Cornell paint as RGB and as its own 31 wavelengths, the training samples of one split. A fit is here what a fit
by a budget is not: a stated number of evaluations of R with its gradient, at one list of random projections for
both, and the masked solve at the end. All channels share one matrix and one factorization of it, so only the right
sides, the texels and the residuals grow with the channels. Both kinds of fit take turns in every repeat; ratios are
medians of those within a repeat. torch has one thread, as in every fit.
"""

import statistics
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import torch

from homofact.brdf.log_transform import LogTransform
from homofact.brdf.samples import Samples
from homofact.brdf.source import MEASURED_EPSILON, open_source
from homofact.evaluation.machine import machine
from homofact.factor.objective import Objective
from homofact.factor.projection import Projection
from homofact.factor.textures import LogSamples, solve_terms, texture_shape
from homofact.geometry.rotation import Rotation
from homofact.linear.threads import one_thread

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import cornell_files, data_folder, figure, finish, markdown, parser_of

PAINT, SIZE, TEXTURES, LAMBDA, COPIES, TARGET = "garnet_red", 16, 2, 1e-3, 8, 3.0
# What a searched fit of a measurement has: isotropic coordinates on the samples alone, or copies for half-diff.
KINDS = ("isotropic-half-diff", "half-diff")


def training(file: Path, channels: str, kind: str) -> Samples:
    """Four fifths of the paint's samples, with azimuth copies where the coordinates know the azimuth."""
    train, _ = open_source(str(file), channels=channels).samples.split(0.2, 0)
    return train if kind.startswith("isotropic") else train.azimuth_copies(COPIES, 0)


def vector(kind: str, seed: int) -> torch.Tensor:
    """Random unit quaternions of `TEXTURES` projections, one after another, as `Objective` takes them."""
    generator = torch.Generator().manual_seed(seed)
    each = TEXTURES if kind.startswith("isotropic") else 2 * TEXTURES
    numbers = torch.randn(each, 4, dtype=torch.float64, generator=generator)
    return (numbers / numbers.norm(dim=1, keepdim=True)).reshape(-1)


def projections(kind: str) -> tuple[Projection, ...]:
    """The projections of `vector(kind, 0)`."""
    parts = vector(kind, 0).reshape(TEXTURES, -1)
    return tuple(Projection.from_rotation(kind, Rotation.of_numbers(part), True) for part in parts)


@one_thread
def fit(samples: Samples, kind: str, evaluations: int) -> tuple[float, float]:
    """(seconds, mean R) of `evaluations` evaluations with gradient, and one masked solve."""
    began = time.perf_counter()
    logs = LogSamples.of(samples, LogTransform.of(samples, MEASURED_EPSILON))
    start = projections(kind)
    shapes = tuple(texture_shape(projection, SIZE) for projection in start)
    objective = Objective(logs, start, shapes, LAMBDA)
    found = [objective.evaluate(vector(kind, seed)).value for seed in range(evaluations)]
    solve_terms(logs, start, shapes, LAMBDA, "cholesky")
    return time.perf_counter() - began, statistics.mean(found)


def measured(file: Path, repeats: int, evaluations: int) -> tuple[str, float]:
    """The table as Markdown, and the largest ratio in it."""
    rows, worst = [], 0.0
    for kind in KINDS:
        sets = {name: training(file, name, kind) for name in ("rgb", "spectral")}
        for samples in sets.values():
            fit(samples, kind, 2)  # what is compiled or loaded once
        turns = [{name: fit(samples, kind, evaluations) for name, samples in sets.items()} for _ in range(repeats)]
        ratio = statistics.median(turn["spectral"][0] / turn["rgb"][0] for turn in turns)
        worst = max(worst, ratio)
        for name, samples in sets.items():
            seconds = statistics.median(turn[name][0] for turn in turns)
            times = 1.0 if name == "rgb" else ratio
            cells = (len(samples), len(samples.channels), evaluations, seconds, 1000 * seconds / evaluations, times)
            rows.append((f"{kind}, {name}", *(figure(c) if isinstance(c, float) else c for c in cells)))
    header = ("fit", "samples", "channels", "evaluations", "median s", "ms an evaluation", "times RGB")
    return markdown(header, rows), worst


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table; 1 where the paint is not there."""
    parser = parser_of(__doc__, "data", "out")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--evaluations", type=int, default=60)
    options = parser.parse_args(arguments)
    files, missing = cornell_files(data_folder(options.data))
    chosen = [file for file in files if file.stem == PAINT]
    if not chosen:
        print("\n".join(line for line in missing if PAINT in line), file=sys.stderr)
        return 1
    repeats, evaluations = (1, 3) if options.short else (options.repeats, options.evaluations)
    table, worst = measured(chosen[0], repeats, evaluations)
    verdict = f"Most: {figure(worst)} times an RGB fit; expected at most {figure(TARGET)}."
    conditions = (
        f"{PAINT}, {TEXTURES} textures of {SIZE}², λ = {LAMBDA:g}, ε = {MEASURED_EPSILON:g}, {repeats} repeats,"
        f" one torch thread. {machine()}"
    )
    return finish([table, verdict, conditions], options)


if __name__ == "__main__":
    sys.exit(main())
