"""Compare the costs that `methods.effort` predicts for an evaluation and a solve with measured ones.

The constants stand fixed in `homofact/methods/effort.py`, since equal settings have to try the same on every machine.
This fits them anew to timings on one thread, weighted so that every timing counts alike whatever its length, and shows
how far the fixed ones, scaled to this machine by one factor, are off.

    python scripts/speed/cost_model.py [--repeats 5] [--out FILE.md]
"""

import sys
import time
from pathlib import Path
from statistics import median

import numba
import numpy as np
import torch
from scipy.optimize import nnls

from homofact.brdf.materials import material
from homofact.brdf.sampling import sample_model
from homofact.evaluation.machine import machine
from homofact.factor.objective import Objective
from homofact.factor.projection import Projection
from homofact.factor.textures import LogSamples
from homofact.geometry.rotation import Rotation
from homofact.linear.least_squares import solve_penalised
from homofact.linear.normal import warm_up
from homofact.linear.threads import one_thread
from homofact.methods import effort
from homofact.methods.cole import Cole
from homofact.methods.common import transform_of

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import figure, finish, markdown, parser_of

MATERIAL = "lafortune-blue-paint"
NAMES = ("a, fixed", "b, a sample and lookup", "c, a sample and pair of lookups", "d, texels²", "e, texels³")
# (samples, textures, texels along an axis) of the timings.
CASES = tuple(
    (count, textures, size) for count in (2000, 8000, 32_000) for textures in (1, 2, 3) for size in (8, 16, 24)
)


def parts(samples: int, lookups: int, texels: int) -> tuple[float, ...]:
    """What the five constants are multiplied by, for an evaluation; a solve has the last two alone."""
    return 1.0, samples * lookups, samples * lookups**2, texels**2, texels**3


@one_thread
def timed(count: int, textures: int, size: int, repeats: int) -> list[tuple[str, tuple[float, ...], float, float]]:
    """(name, parts, seconds, units by the model) of an evaluation with its gradient and of a solve: medians."""
    samples = sample_model(material(MATERIAL).model, count, "discs", 0)
    settings = Cole(epsilon=1e-5)
    data = LogSamples.of(samples, transform_of(samples, settings))
    generator = torch.Generator().manual_seed(0)
    projections = tuple(
        Projection.from_rotation("half-diff", Rotation.random(generator), True) for _ in range(textures)
    )
    objective = Objective(data, projections, ((size, size),) * textures, settings.smoothing)
    vector = objective.start()
    problem = objective.problem(vector)
    equations = problem.data
    lookups, texels = sum(each.lookups for each in projections), textures * size**2

    def solve() -> object:
        return solve_penalised(equations, problem.roughness, problem.smoothing, len(problem.lookups))

    both = parts(count, lookups, texels)
    works = (
        ("evaluation", lambda: objective.evaluate(vector), both, effort.cost_of_evaluation(count, lookups, texels)),
        ("solve", solve, (0.0, 0.0, 0.0, *both[3:]), effort.cost_of_solve(texels)),
    )
    found = []
    for name, work, own, units in works:
        seconds = []
        work()
        for _ in range(repeats):
            began = time.perf_counter()
            work()
            seconds.append(time.perf_counter() - began)
        found.append((name, own, median(seconds), units))
    return found


def main(arguments: list[str] | None = None) -> int:
    """Time, fit, print the tables, and write them where it is asked for."""
    parser = parser_of(__doc__, "out")
    parser.add_argument("--repeats", type=int, default=5, help="timings of a case (%(default)s)")
    options = parser.parse_args(arguments)
    cases, repeats = (CASES[:4], 1) if options.short else (CASES, options.repeats)
    warm_up()
    threads = numba.get_num_threads()
    numba.set_num_threads(1)
    try:
        found = [(case, *line) for case in cases for line in timed(*case, repeats)]
    finally:
        numba.set_num_threads(threads)
    seconds = np.array([line[3] for line in found])
    units = np.array([line[4] for line in found])
    fitted, _ = nnls(np.array([line[2] for line in found]) / seconds[:, None], np.ones(len(found)))
    unit = float(np.exp(np.median(np.log(seconds / units))))
    fixed = (effort._FIXED, effort._LOOKUP, effort._PAIR, effort._SQUARE, effort._CUBE)
    constants = [(name, figure(a), figure(b)) for name, a, b in zip(NAMES, fixed, fitted, strict=True)]
    rows = [
        (
            f"{name}, {case[0]} samples, {case[1]} × {case[2]}²", f"{1000 * took:.3g}", f"{1000 * unit * cost:.3g}",
            f"{unit * cost / took:.2f}",
        )
        for (case, name, _, took, cost) in found
    ]  # fmt: skip
    ratios = sorted(abs(np.log(unit * units / seconds)))
    text = (
        f"Seconds of one thread; a unit is {1000 * unit:.2g} ms here. {machine()}\n\n"
        f"{markdown(('constant', 'fixed', 'fitted here'), constants)}\n\n"
        f"{markdown(('work', 'ms', 'ms by the fixed model', 'ratio'), rows)}\n\n"
        f"The fixed model is off by a factor of {np.exp(median(ratios)):.2f} in the median, {np.exp(ratios[-1]):.2f} at"
        " worst.\n"
    )
    return finish(text, options)


if __name__ == "__main__":
    sys.exit(main())
