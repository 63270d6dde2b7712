"""Measure time and peak memory of one inner evaluation with each solver, and of whole fits.

    python scripts/speed/cost_of_evaluation.py [--repeats 5] [--short]

One evaluation is what the search pays at each step: the inner problem of two reciprocal half-diff textures
(16 weights a sample, 512 unknowns), solved, and its error. The thesis (4.2) gives about 30 s for it on an
800 MHz Athlon. Every figure comes from a fresh process, of which it is the only work: peak memory is the
process's largest resident size, and the rise that over what it held before (libraries, samples, compiled
kernels). This program itself imports no library, since a process may inherit the peak of its parent.
"""

import argparse
import json
import os
import resource
import statistics
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from homofact.evaluation.machine import machine

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import figure, finish, markdown, parser_of

SOLVERS = ("cholesky", "qr", "lsmr", "cg", "qmr")
FITS = (("mccool", ""), ("cole", "half-diff"), ("cole", "in-out"))
MATERIAL, EPSILON = "lafortune-blue-paint", 1e-5
MIB = 1024**2


def resident(peak: bool) -> int:
    """Bytes resident now, or at the peak since the process began (or `forget_peak`).

    getrusage's maximum is inherited through exec from the process that forked, so the kernel's own account
    is read where there is one; elsewhere there is only the maximum.
    """
    try:
        lines = Path("/proc/self/status").read_text().splitlines()
    except OSError:
        unit = 1 if sys.platform == "darwin" else 1024
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit
    name = "VmHWM:" if peak else "VmRSS:"
    return next(int(line.split()[1]) * 1024 for line in lines if line.startswith(name))


def forget_peak() -> None:
    """Begin the account of the peak anew, where the system allows it."""
    try:
        Path("/proc/self/clear_refs").write_text("5")
    except OSError:
        return


def load(channels: int, count: int, seed: int) -> Any:
    """`count` pairs of the blue paint: green alone, or R, G, B."""
    from homofact.brdf.materials import material
    from homofact.brdf.sampling import sample_model

    samples = sample_model(material(MATERIAL).model, count, "discs", seed)
    return samples.channel("G") if channels == 1 else samples


def evaluation(job: argparse.Namespace) -> dict[str, Any]:
    """Seconds of each repeat (at a new random projection), memory, and the errors' relative distance to Cholesky's."""
    import torch

    from homofact.factor.projection import Projection
    from homofact.factor.textures import LogSamples, inner_problem
    from homofact.geometry.rotation import Rotation
    from homofact.linear.solvers import solve
    from homofact.methods.cole import Cole
    from homofact.methods.common import transform_of

    settings = Cole(epsilon=EPSILON)

    def prepared(count: int) -> LogSamples:
        samples = load(job.channels, count, job.seed)
        return LogSamples.of(samples, transform_of(samples, settings))

    def once(data: LogSamples, projections: tuple[Projection, ...], size: int, solver: str) -> tuple[float, str]:
        problem = inner_problem(data, projections, ((size, size),) * 2, settings.smoothing)
        solution = solve(problem, solver)
        return problem.mean_error(solution.texels), solution.status.value

    generator = torch.Generator().manual_seed(job.seed)
    pairs = [
        tuple(Projection.from_rotation("half-diff", Rotation.random(generator), reciprocal=True) for _ in range(2))
        for _ in range(job.repeats)
    ]
    # Compile, and load what the solver loads, on a problem that holds no memory to speak of.
    once(prepared(200), pairs[0], 4, job.solver)
    data = prepared(job.samples)
    before = resident(peak=False)
    forget_peak()
    seconds, errors, statuses = [], [], []
    for projections in pairs:
        began = time.perf_counter()
        error, status = once(data, projections, job.size, job.solver)
        seconds.append(time.perf_counter() - began)
        errors.append(error)
        statuses.append(status)
    peak = resident(peak=True)
    expected = [once(data, projections, job.size, "cholesky")[0] for projections in pairs]
    apart = max(abs(a / b - 1) for a, b in zip(errors, expected, strict=True))
    status = sorted(set(statuses))
    return {"seconds": seconds, "peak": peak, "rise": peak - before, "apart": apart, "status": status}


def whole_fit(job: argparse.Namespace) -> dict[str, Any]:
    """Seconds, memory, evaluations and Cole error of one fit with the default settings."""
    from homofact.methods.table import method_class, settings_of_class

    method: Any = method_class(job.method)
    own = settings_of_class(method)
    more: dict[str, Any] = {"coordinates": job.coordinates} if job.coordinates else {}
    short: dict[str, Any] = {"restarts": 1, "search_size": 4, "search_samples": 300}
    few = {name: value for name, value in (short | {"textures": 1}).items() if name in own}
    if job.short:
        more |= {name: value for name, value in short.items() if name in own}
    settings = method(size=job.size, epsilon=EPSILON, seed=job.seed, **more)
    method(size=4, epsilon=EPSILON, **few).fit(load(job.channels, 200, job.seed))
    samples = load(job.channels, job.samples, job.seed)
    before = resident(peak=False)
    forget_peak()
    began = time.perf_counter()
    fitted = settings.fit(samples)
    seconds = time.perf_counter() - began
    peak = resident(peak=True)
    report = fitted.report
    return {
        "seconds": [seconds],
        "peak": peak,
        "rise": peak - before,
        "evaluations": report.evaluations,
        "error": report.residual,
        "status": [report.status.value],
    }


def fresh(chosen: argparse.Namespace, job: str, **more: object) -> dict[str, Any]:
    """Run one job in a process of its own."""
    command = [sys.executable, __file__, "--job", job]
    shared = {"samples": chosen.samples, "size": chosen.size, "repeats": chosen.repeats, "seed": chosen.seed}
    for name, value in (shared | more).items():
        command += [f"--{name}", str(value)]
    if chosen.short:
        command.append("--short")
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command[1:])} ended with {done.returncode}: {done.stderr.strip()[-500:]}")
    return json.loads(done.stdout)


def evaluation_table(chosen: argparse.Namespace) -> str:
    """A row for each solver and number of channels."""
    rows = []
    for solver in chosen.solvers:
        for channels in chosen.channels:
            found = fresh(chosen, "evaluation", solver=solver, channels=channels)
            seconds = found["seconds"]
            rows.append(
                (
                    solver,
                    channels,
                    figure(1000 * statistics.median(seconds)),
                    f"{figure(1000 * min(seconds))} – {figure(1000 * max(seconds))}",
                    round(found["peak"] / MIB),
                    round(found["rise"] / MIB),
                    f"{found['apart']:.1e}",
                    ", ".join(found["status"]),
                )
            )
            print(f"{solver}, {channels} channels: {figure(statistics.median(seconds))} s", file=sys.stderr)
    heads = ("channels", "median ms", "range ms", "peak MiB", "rise MiB", "error apart from cholesky", "status")
    return markdown(("solver", *heads), rows)


def fit_table(chosen: argparse.Namespace) -> str:
    """A row for each method and number of channels; each run is a process of its own."""
    rows = []
    for name, coordinates in FITS:
        for channels in chosen.channels:
            more = {"coordinates": coordinates} if coordinates else {}
            runs = [fresh(chosen, "fit", method=name, channels=channels, **more) for _ in range(chosen.runs)]
            seconds = [run["seconds"][0] for run in runs]
            rows.append(
                (
                    f"{name}{f', {coordinates}' if coordinates else ''}, two textures",
                    channels,
                    figure(statistics.median(seconds)),
                    f"{figure(min(seconds))} – {figure(max(seconds))}",
                    round(statistics.median(run["peak"] for run in runs) / MIB),
                    round(statistics.median(run["rise"] for run in runs) / MIB),
                    runs[0]["evaluations"],
                    figure(runs[0]["error"]),
                )
            )
            print(f"{rows[-1][0]}, {channels} channels: {rows[-1][2]} s", file=sys.stderr)
    heads = ("channels", "median s", "range s", "peak MiB", "rise MiB", "evaluations", "Cole error")
    return markdown(("fit", *heads), rows)


def main(arguments: list[str] | None = None) -> int:
    """Print (and with --out write) the tables; returns the exit code."""
    parser = parser_of(__doc__, "out")
    parser.add_argument("--samples", type=int, default=45_000)
    parser.add_argument("--size", type=int, default=16)
    parser.add_argument("--repeats", type=int, default=5, help="evaluations, of which the median counts")
    parser.add_argument("--runs", type=int, default=3, help="runs of each whole fit, of which the median counts")
    parser.add_argument("--channels", type=int, nargs="+", choices=(1, 3), default=[1, 3])
    parser.add_argument("--solvers", nargs="+", choices=SOLVERS, default=list(SOLVERS))
    parser.add_argument("--seed", type=int, default=0)
    # What a fresh process is told.
    parser.add_argument("--job", choices=("evaluation", "fit"), help=argparse.SUPPRESS)
    for name in ("--solver", "--method", "--coordinates"):
        parser.add_argument(name, help=argparse.SUPPRESS)
    chosen = parser.parse_args(arguments)
    if chosen.job:
        chosen.channels = chosen.channels[0]
        print(json.dumps((evaluation if chosen.job == "evaluation" else whole_fit)(chosen)))
        return 0
    if chosen.short:
        chosen.samples, chosen.size, chosen.repeats, chosen.runs = 1500, 6, 2, 1
    text = "\n".join(
        [
            "# Cost of an inner evaluation and of a fit",
            "",
            f"- {MATERIAL}, {chosen.samples} pairs uniform in the parabolic discs, seed {chosen.seed}; {chosen.size}²,"
            f" ε = {EPSILON:g}; 1 channel is G, 3 are RGB; float64",
            f"- evaluation: two reciprocal half-diff textures at random projections, {chosen.repeats} of them; fits:"
            f" default settings, {chosen.runs} run(s), reading and first compilation not counted",
            f"- {machine()}; load average at the start {os.getloadavg()[0]:.1f}",
            "",
            evaluation_table(chosen),
            "",
            fit_table(chosen),
            "",
        ]
    )
    return finish(text, chosen)


if __name__ == "__main__":
    sys.exit(main())
