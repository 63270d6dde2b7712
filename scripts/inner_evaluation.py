"""One inner evaluation, ours beside forming B, BᵀB and QMR a channel, in one process.

    python scripts/inner_evaluation.py [--repeats 15] [--short]

The inner problem of two reciprocal half-diff textures at random projections, all channels: set up from prepared
coordinates, solved, and its Cole error. The thesis (3.2.6, eq. 3.7) forms B as a sparse matrix, then BᵀB, and solves
each channel by QMR; the reference does that with scipy.sparse, once to the library's tolerance (as the solver "qmr"
does, at most 10 iterations an unknown) and once to scipy's own default of 1e-5. In every repeat all ways solve the
same new problem, the compiled ones ten times in a row and the others, which take a second, twice; the last one
counts, since in a search one evaluation follows another. The
ratios are medians of those within a repeat, by the wall and by processor time of all threads, which other work on the
machine touches less. torch has one thread, as in every fit; the compiled passes have their own.
"""

import os
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numba
import numpy as np
import scipy.sparse.linalg
import torch
from conditions import figure, markdown, parser_of, write

from homofact.brdf.materials import material
from homofact.brdf.sampling import sample_model
from homofact.evaluate.machine import machine
from homofact.factor.objective import Objective
from homofact.factor.projection import Projection
from homofact.factor.textures import LogSamples
from homofact.geometry.rotation import Rotation
from homofact.linear.least_squares import LeastSquares, solve_penalised
from homofact.linear.normal import accumulate_torch
from homofact.linear.solvers import TOLERANCE, solve, solve_definite
from homofact.linear.threads import one_thread
from homofact.methods.cole import Cole
from homofact.methods.fitting import transform_of

MATERIAL = "lafortune-blue-paint"
SETTINGS = Cole(epsilon=1e-5)
LOOSE = 1e-5
TARGET_RATIO, TARGET_MS = 20, 15

Way = Callable[[Objective, torch.Tensor], float]


def compiled(objective: Objective, vector: torch.Tensor) -> float:
    """Compiled accumulation and Cholesky; the error from the normal equations."""
    problem = objective.problem(vector)
    return problem.data.error(solve(problem).texels)


def compiled_with_gradient(objective: Objective, vector: torch.Tensor) -> float:
    """As `compiled`, and the pass over the samples for the gradient by every projection, which gives the error too."""
    return objective.evaluate(vector).error


def torch_path(objective: Objective, vector: torch.Tensor) -> float:
    """The accumulation written in torch, on the CPU, and Cholesky."""
    problem = objective.problem(vector)
    data = accumulate_torch(problem.coordinates, problem.lookups, problem.targets, problem.weights, problem.unknowns)
    return data.error(solve_penalised(data, problem.roughness, problem.smoothing, len(problem.lookups)))


def error_of_rows(
    problem: LeastSquares, rows: scipy.sparse.csr_matrix, targets: np.ndarray, texels: np.ndarray
) -> float:
    """The Cole error from B itself, of which the first N rows are √W B."""
    count = len(problem.weights)
    squares = ((rows @ texels - targets)[:count] ** 2).sum()
    return float(squares / (problem.weights.sum() * targets.shape[1]))


def sparse_qmr(tolerance: float) -> Way:
    """B and BᵀB by scipy.sparse, QMR a channel to `tolerance`."""

    def way(objective: Objective, vector: torch.Tensor) -> float:
        problem = objective.problem(vector)
        rows, targets = problem.rows()
        matrix, right = (rows.T @ rows).tocsr(), rows.T @ targets
        limit = 10 * problem.unknowns
        found = [scipy.sparse.linalg.qmr(matrix, column, rtol=tolerance, maxiter=limit)[0] for column in right.T]
        return error_of_rows(problem, rows, targets, np.stack(found, 1))

    return way


def sparse_cholesky(objective: Objective, vector: torch.Tensor) -> float:
    """B and BᵀB by scipy.sparse, then the dense Cholesky factorization of all channels."""
    problem = objective.problem(vector)
    rows, targets = problem.rows()
    matrix = torch.from_numpy((rows.T @ rows).toarray())
    texels, _ = solve_definite(matrix, torch.from_numpy(rows.T @ targets))
    return error_of_rows(problem, rows, targets, texels.numpy())


REFERENCE = f"scipy.sparse B, BᵀB, QMR a channel to {TOLERANCE:g}"
WAYS: dict[str, Way] = {
    "compiled accumulation, Cholesky": compiled,
    "the same with the gradient": compiled_with_gradient,
    "torch accumulation, Cholesky": torch_path,
    "scipy.sparse B, BᵀB, Cholesky": sparse_cholesky,
    f"scipy.sparse B, BᵀB, QMR a channel to {LOOSE:g}": sparse_qmr(LOOSE),
    REFERENCE: sparse_qmr(TOLERANCE),
}


# Evaluations before the one that counts, where it is not one.
BEFORE = {"compiled accumulation, Cholesky": 9, "the same with the gradient": 9}


@one_thread
def measured(count: int, size: int, repeats: int, seed: int) -> dict[str, tuple[list[float], list[float], list[float]]]:
    """(seconds, processor seconds, errors) a way at `repeats` random projections."""
    samples = sample_model(material(MATERIAL).model, count, "discs", seed)
    data = LogSamples.of(samples, transform_of(samples, SETTINGS))
    generator = torch.Generator().manual_seed(seed)
    found: dict[str, tuple[list[float], list[float], list[float]]] = {name: ([], [], []) for name in WAYS}
    for _ in range(repeats):
        pair = tuple(Projection.from_rotation("half-diff", Rotation.random(generator), True) for _ in range(2))
        objective = Objective(data, pair, ((size, size),) * 2, SETTINGS.smoothing)
        vector = objective.start()
        for name, way in WAYS.items():
            for _ in range(BEFORE.get(name, 1)):
                way(objective, vector)
            began, began_processor = time.perf_counter(), time.process_time()
            error = way(objective, vector)
            figures = time.perf_counter() - began, time.process_time() - began_processor, error
            for column, value in zip(found[name], figures, strict=True):
                column.append(value)
    return found


def main(arguments: list[str] | None = None) -> int:
    """Print (and with --out write) the table; returns the exit code."""
    parser = parser_of(__doc__)
    parser.add_argument("--samples", type=int, default=45_000)
    parser.add_argument("--size", type=int, default=16)
    parser.add_argument("--repeats", type=int, default=15)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, help="a Markdown file to write as well")
    chosen = parser.parse_args(arguments)
    if chosen.short:
        chosen.samples, chosen.size, chosen.repeats = 2000, 6, 2
    load = os.getloadavg()[0]
    found = measured(chosen.samples, chosen.size, chosen.repeats, chosen.seed)
    slow, slow_processor, _ = found[REFERENCE]
    first = next(iter(WAYS))
    exact = found[first][2]
    rows = []
    for name, (seconds, processor, own) in found.items():
        ratios = [
            figure(statistics.median(a / b for a, b in zip(theirs, mine, strict=True)))
            for theirs, mine in ((slow, seconds), (slow_processor, processor))
        ]
        apart = max(abs(a / b - 1) for a, b in zip(own, exact, strict=True))
        spread = f"{figure(1000 * min(seconds))} – {figure(1000 * max(seconds))}"
        times = [figure(1000 * statistics.median(clock)) for clock in (seconds, processor)]
        rows.append((name, times[0], spread, times[1], *ratios, figure(statistics.mean(own)), f"{apart:.1e}"))
    verdicts = [
        ("times faster than QMR, by the wall", f"at least {TARGET_RATIO}", rows[0][4]),
        ("times faster than QMR, by processor time", f"at least {TARGET_RATIO}", rows[0][5]),
        ("ms, median", f"at most {TARGET_MS}", rows[0][1]),
        ("ms, least", f"at most {TARGET_MS}", figure(1000 * min(found[first][0]))),
    ]
    text = "\n".join(
        [
            "# One inner evaluation",
            "",
            f"- {MATERIAL}, RGB, {chosen.samples} pairs uniform in the parabolic discs, seed {chosen.seed}; two"
            f" reciprocal half-diff textures of {chosen.size}², λ = {SETTINGS.smoothing:g},"
            f" ε = {SETTINGS.epsilon:g}; float64",
            f"- {chosen.repeats} random projections, all ways at each; one torch thread, {numba.get_num_threads()}"
            " in the compiled passes; compilation not counted",
            f"- {machine()}; load average {load:.1f} at the start, {os.getloadavg()[0]:.1f} at the end",
            *(["- a smoke test: the figures mean nothing"] if chosen.short else []),
            "",
            markdown(
                (
                    "evaluation",
                    "median ms",
                    "range ms",
                    "processor ms",
                    "times faster",
                    "processor",
                    "mean Cole error",
                    "error apart",
                ),
                rows,
            ),
            "",
            markdown(("compiled accumulation, Cholesky", "target", "found"), verdicts),
            "",
        ]
    )
    print(text)
    if chosen.out is not None:
        write(chosen.out, text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
