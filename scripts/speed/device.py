"""Compare a GPU with the CPU: evaluation, normal equations, solves, slopes and whole fits.

    python scripts/speed/device.py [--device cuda] [--cpu-threads N] [--rgl FILE] [--short] [--out FILE.md]

Every work is done on both in turn, in one run, on the same numbers, and the two answers are compared: the column
"apart" gives the largest difference over the largest value (of a fit: the difference of the two errors over the error).
A timing is the least of several after a first, and ends when the device has finished. On the CPU the works take
the path that they take in a fit (compiled where there is a compiled one). Without such a device the script says so and
ends with code 2.
"""

import itertools
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

import homofact
from homofact.brdf.materials import material
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model
from homofact.brdf.source import open_source
from homofact.errors import BadInput, HomofactError
from homofact.evaluation.machine import machine
from homofact.factor.projection import Projection
from homofact.factor.textures import LogSamples, inner_problem
from homofact.geometry.directions import draw_cosine_weighted
from homofact.geometry.rotation import Rotation
from homofact.linear.normal import accumulate, gradient, warm_up
from homofact.linear.solvers import solve_definite
from homofact.methods.cole import Cole
from homofact.methods.common import transform_of
from homofact.methods.mccool import McCool
from homofact.methods.method import Method
from homofact.methods.search import Search

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import figure, finish, markdown, parser_of

MATERIAL = "lafortune-blue-paint"
TEXTURES, LOOKUPS = 3, 6
REPEATS = 5


@dataclass(frozen=True)
class Work:
    """Something to do on a device: `prepare` moves what it needs there and returns the function to time."""

    name: str
    size: str
    prepare: Callable[[torch.device], Callable[[], Any]]
    repeats: int = REPEATS


def on(device: torch.device, given: Any) -> Any:
    """Samples, a tensor, or a dataclass that holds tensors, on a device."""
    if isinstance(given, Tensor | Samples):
        return given.to(device)
    moved = {
        each.name: getattr(given, each.name).to(device)
        for each in fields(given)
        if isinstance(getattr(given, each.name), Tensor)
    }
    return replace(given, **moved)


def finished(device: torch.device) -> float:
    """The clock, once the device has nothing left to do."""
    if device.type == "cuda":
        torch.cuda.synchronize(device)
    return time.perf_counter()


def timed(work: Work, device: torch.device) -> tuple[float, Any]:
    """(the least seconds, the last answer) of a work on a device."""
    function = work.prepare(device)
    answer = function()
    seconds = []
    for _ in range(work.repeats):
        began = finished(device)
        answer = function()
        seconds.append(finished(device) - began)
    return min(seconds), answer


def apart(one: Any, other: Any) -> float:
    """The largest difference of two answers over the largest value of the first."""
    one, other = (torch.as_tensor(each, dtype=torch.float64).detach().cpu() for each in (one, other))
    return float((one - other).abs().max() / one.abs().max())


def evaluations(short: bool) -> Iterator[Work]:
    """Values, and a step of training, by the module of a fit of three textures of 32², in float32."""
    fit = homofact.fit(f"material:{MATERIAL}", textures=TEXTURES, size=32, effort="quick")
    for count in (1_000, 10_000) if short else (1_000, 100_000, 10_000_000):
        generator = torch.Generator().manual_seed(0)
        wi, wo = (w.float() for w in draw_cosine_weighted(count, generator))

        def values(device: torch.device, wi: Tensor = wi, wo: Tensor = wo) -> Callable[[], Any]:
            module, a, b = fit.module(device, torch.float32), on(device, wi), on(device, wo)

            def evaluate() -> Tensor:
                with torch.no_grad():
                    return module(a, b)

            return evaluate

        def training(device: torch.device, wi: Tensor = wi, wo: Tensor = wo) -> Callable[[], Any]:
            module, a, b = fit.module(device, torch.float32), on(device, wi), on(device, wo)
            parameters = list(module.parameters())

            def step() -> Tensor:
                return torch.autograd.grad((module(a, b) + 0.1).log().square().mean(), parameters)[0]

            return step

        yield Work("values of a fit, float32", f"{count:,} pairs", values)
        if count <= 1_000_000:
            yield Work("values and slopes by every texel", f"{count:,} pairs", training)


def logs_of(count: int) -> tuple[Samples, LogSamples]:
    """(samples of the material, their logs), on the CPU."""
    samples = sample_model(material(MATERIAL).model, count, "discs", 0)
    return samples, LogSamples.of(samples, transform_of(samples, Cole(epsilon=1e-5)))


def inner_problems(short: bool) -> Iterator[Work]:
    """Normal equations and the slope by the projections, in float64, of three reciprocal textures."""
    generator = torch.Generator().manual_seed(0)
    projections = tuple(
        Projection.from_rotation("half-diff", Rotation.random(generator), True) for _ in range(TEXTURES)
    )
    cases = ((2_000, 8),) if short else ((10_000, 16), (100_000, 16), (1_000_000, 16), (100_000, 32), (1_000_000, 32))
    for count, size in cases:
        _, logs = logs_of(count)
        problem = inner_problem(logs, projections, ((size, size),) * TEXTURES, 0.1)
        texels = torch.randn(problem.unknowns, 3, dtype=torch.float64, generator=generator)

        def equations(device: torch.device, problem: Any = problem) -> Callable[[], Any]:
            given = [on(device, each) for each in (problem.coordinates, problem.targets, problem.weights)]
            lookups = tuple(on(device, each) for each in problem.lookups)
            return lambda: accumulate(given[0], lookups, given[1], given[2], problem.unknowns).matrix

        def slope(device: torch.device, problem: Any = problem, texels: Tensor = texels) -> Callable[[], Any]:
            given = [on(device, each) for each in (problem.coordinates, problem.targets, problem.weights, texels)]
            lookups = tuple(on(device, each) for each in problem.lookups)
            return lambda: gradient(given[0], lookups, given[1], given[2], given[3])[0]

        yield Work("normal equations", f"{count:,} samples, 3 × {size}²", equations)
        yield Work("slope by the projections", f"{count:,} samples, 3 × {size}²", slope)


def solves(short: bool) -> Iterator[Work]:
    """Cholesky of a positive definite system of as many unknowns, three channels, in float64."""
    generator = torch.Generator().manual_seed(0)
    for unknowns in (200,) if short else (768, 3072, 8192):
        root = torch.randn(unknowns, unknowns, dtype=torch.float64, generator=generator)
        matrix = root @ root.T / unknowns + torch.eye(unknowns, dtype=torch.float64)
        rhs = torch.randn(unknowns, 3, dtype=torch.float64, generator=generator)

        def system(device: torch.device, matrix: Tensor = matrix, rhs: Tensor = rhs) -> Callable[[], Any]:
            a, b = on(device, matrix), on(device, rhs)
            return lambda: solve_definite(a, b)[0]

        yield Work("Cholesky and back", f"{unknowns} unknowns", system)


def fits(short: bool, rgl: Path | None) -> Iterator[Work]:
    """Whole fits, whose answer is the error at their own samples."""
    cases: list[tuple[str, Method, int]] = [
        ("mccool", McCool(size=32), 200_000),
        ("mccool", McCool(size=32), 2_000_000),
    ]
    cases += [
        ("cole", Cole(textures=2, size=16), 20_000),
        ("search", Search(textures=2, size=16, effort="quick"), 20_000),
        ("search", Search(textures=2, size=16, effort="quick"), 200_000),
    ]
    if short:
        cases = [("mccool", McCool(size=8), 2_000)]
    given = [
        (f"{name}, {method.size}²", method, f"{count:,} samples", logs_of(count)[0]) for name, method, count in cases
    ]
    if rgl is not None:
        source = open_source(str(rgl))
        samples = source.samples
        given.append(
            ("search, 3 × 32²", Search(textures=3, size=32), f"{len(samples):,} samples of {rgl.stem}", samples)
        )
    for name, method, size, samples in given:

        def whole(device: torch.device, method: Method = method, samples: Samples = samples) -> Callable[[], Any]:
            moved, seeds = on(device, samples), itertools.count()
            # Another seed each time: a search of the same samples and seed is taken over from the last fit.
            return lambda: replace(method, seed=next(seeds)).fit(moved).report.residual

        yield Work(f"fit by {name}", size, whole, repeats=1)


def calls(short: bool) -> Iterator[Work]:
    """What the package's users call: a fit with its verdict, its values, and a fit made of its trained module."""
    samples, _ = logs_of(2_000 if short else 20_000)

    def fitted(device: torch.device) -> Callable[[], Any]:
        moved = on(device, samples)

        def error() -> float:
            report = homofact.fit(moved, textures=2, size=16, effort="quick", epsilon=1e-5).report
            assert report is not None
            return report.residual

        return error

    yield Work("homofact.fit and its verdict", f"{len(samples):,} samples", fitted, repeats=1)
    fit = homofact.fit(samples, textures=2, size=16, effort="quick", epsilon=1e-5)

    def values(device: torch.device) -> Callable[[], Any]:
        moved = on(device, samples)
        return lambda: fit.evaluate(moved.wi, moved.wo)

    yield Work("values by Fit.evaluate, float64", f"{len(samples):,} pairs", values)

    def trained(device: torch.device) -> Callable[[], Any]:
        moved = on(device, samples)

        def train() -> Any:
            module = fit.module(device)
            optimizer = torch.optim.Adam(module.parameters(), 1e-3)
            for _ in range(20):
                optimizer.zero_grad()
                ((module(moved.wi, moved.wo) - moved.values) ** 2).mean().backward()
                optimizer.step()
            return module.to_fit().evaluate(samples.wi, samples.wo)

        return train

    yield Work("20 steps of training and a fit of them", f"{len(samples):,} pairs", trained, repeats=2)


def main(arguments: list[str] | None = None) -> int:
    """Do every work on both, print the table, and write it where it is asked for."""
    parser = parser_of(__doc__, "out")
    parser.add_argument("--device", default="cuda", help="torch's name of the device (%(default)s)")
    parser.add_argument("--cpu-threads", type=int, help="threads of torch on the CPU; by default all cores")
    parser.add_argument("--rgl", type=Path, help="an RGL file, to fit it too")
    parser.add_argument("--only", help="works whose names contain this")
    options = parser.parse_args(arguments)
    try:
        device = torch.device(options.device)
        torch.zeros(1, device=device)
    except (RuntimeError, AssertionError) as error:
        reason = str(error).splitlines()[0]
        raise BadInput(where="--device", found=f"{options.device!r}, {reason}", expected="a device of torch") from None
    if options.cpu_threads:
        torch.set_num_threads(options.cpu_threads)
    warm_up()
    cpu, rows = torch.device("cpu"), []
    for group in (evaluations, calls, inner_problems, solves, lambda short: fits(short, options.rgl)):
        for work in group(options.short):
            if options.only and options.only not in work.name:
                continue
            row = [work.name, work.size]
            try:
                here, answer = timed(work, cpu)
                there, other = timed(work, device)
                row += [figure(1000 * here), figure(1000 * there), figure(here / there), f"{apart(answer, other):.1e}"]
            except HomofactError as error:
                row += [str(error), "", "", ""]
            except Exception:
                traceback.print_exc()
                row += ["failed", "", "", ""]
            print(*row, sep=" | ", flush=True)
            rows.append(row)
    name = torch.cuda.get_device_name(device) if device.type == "cuda" else str(device)
    header = ("work", "size", "CPU, ms", "device, ms", "times faster", "apart")
    text = f"{name} beside {torch.get_num_threads()} threads. {machine()}\n\n{markdown(header, rows, 2)}\n"
    return finish(text, options)


if __name__ == "__main__":
    try:
        sys.exit(main())
    except HomofactError as error:
        print(error, file=sys.stderr)
        sys.exit(2)
