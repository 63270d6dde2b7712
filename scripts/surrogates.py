"""Neural surrogates of the MERL materials (Sztrajman et al. 2021) in one fixed mix of textures, all of them.

Never MERL itself: the networks are fits. Each is drawn at COUNT pairs uniform in the parabolic discs (r² < 0.98) and
measured on a second draw of as many. The mix is one (θh, θd) texture, its peak stretched, and one line p(θ) looked
up at θi and at θo: SIZE² + SIZE texels of float32 RGB. Cole error with ε = 1e-2, and MALE: mean |log(1 + f cosθi) −
log(1 + f̂ cosθi)|.

    python scripts/surrogates.py [--count 20000] [--short]
"""

import argparse
import time
from dataclasses import dataclass
from pathlib import Path

import torch
from conditions import data_folder, figure, markdown

from homofact.brdf.formats.nbrdf import load, material_names
from homofact.brdf.log_transform import LogTransform
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model
from homofact.brdf.source import MEASURED_EPSILON
from homofact.errors import Status
from homofact.evaluate.machine import machine
from homofact.evaluate.metrics import measure
from homofact.factor.factorization import Factorization
from homofact.factor.projection import Warp, fixed_projection
from homofact.factor.textures import LogSamples, solve_terms, texture_shape
from homofact.linear.threads import one_thread
from homofact.methods.effort import Account
from homofact.methods.folded import Folded
from homofact.methods.validation import partitions_of

WIDTHS = (0.1, 0.03, 0.01)
SIZES = (16, 32)


@dataclass(frozen=True)
class Result:
    """One material at one size: held-out Cole error and MALE, bytes, seconds of the fit, and how its solve ended."""

    name: str
    size: int
    error: float
    male: float
    nbytes: int
    seconds: float
    status: Status


@one_thread
def fit(samples: Samples, size: int) -> tuple[Factorization, Status]:
    """The fixed mix; its warp and λ found by cross-validation on 16² textures and carried over to larger ones."""
    transform = LogTransform.of(samples, MEASURED_EPSILON)
    logs = LogSamples.of(samples, transform)
    partitions = partitions_of(samples, 3, 0, rings=False)
    best = None
    for width in WIDTHS:
        projections = (fixed_projection("theta_h-theta_d", True, Warp(width)), fixed_projection("theta_i", True))
        shapes = tuple(texture_shape(projection, SIZES[0]) for projection in projections)
        few = torch.randperm(len(samples), generator=torch.Generator().manual_seed(0))[:6000]
        folded = Folded.of(logs.select(few), tuple(p.select(few) for p in partitions), projections, shapes)
        smoothing, error = folded.best_smoothing((1e-3, 1e-3), Account())
        if best is None or error < best[0]:
            best = (error, projections, smoothing)
    assert best is not None
    _, projections, smoothing = best
    shapes = tuple(texture_shape(projection, size) for projection in projections)
    solved = solve_terms(logs, projections, shapes, smoothing, "cholesky")
    return Factorization(solved.terms, transform, samples.channels), solved.status


def male(found: torch.Tensor, samples: Samples) -> float:
    """Mean absolute logarithmic error of f cosθi (Sztrajman et al. 2021), over samples and channels."""
    cosine = samples.wi[:, 2:]
    return float((torch.log1p(found * cosine) - torch.log1p(samples.values * cosine)).abs().mean())


def run(path: Path, names: list[str], count: int) -> tuple[list[Result], float]:
    """(a result for every material and size, seconds in all, drawing and measuring included)."""
    began = time.perf_counter()
    results = []
    for name in names:
        model = load(f"{path}#{name}")
        train, test = (sample_model(model, count=count, seed=seed) for seed in (0, 1))
        for size in SIZES:
            start = time.perf_counter()
            factorization, status = fit(train, size)
            seconds = time.perf_counter() - start
            error = measure(factorization, test, factorization.transform).log_mse
            distance = male(factorization.evaluate(test.wi, test.wo), test)
            results.append(Result(name, size, error, distance, factorization.nbytes, seconds, status))
    return results, time.perf_counter() - began


def main(arguments: list[str] | None = None) -> None:
    """Print the table, the worst materials, and the time."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=20_000, help="pairs drawn for the fit, and again for the test")
    parser.add_argument("--short", action="store_true", help="three materials, 2000 pairs")
    chosen = parser.parse_args(arguments)
    path = data_folder(None) / "nbrdf" / "merl_nbrdf_weights.npz"
    names = material_names(path)[: 3 if chosen.short else None]
    results, seconds = run(path, names, 2000 if chosen.short else chosen.count)
    print(machine())
    rows = []
    for size in SIZES:
        own = [result for result in results if result.size == size]
        errors, males = (torch.tensor([getattr(r, what) for r in own]) for what in ("error", "male"))
        quantiles = [float(values.quantile(q)) for values in (errors, males) for q in (0.5, 0.9, 1.0)]
        fitted = sum(result.seconds for result in own)
        rows.append((f"{size}² + {size}", f"{own[0].nbytes / 1024:.2f}", *map(figure, quantiles), figure(fitted)))
    header = ("texels", "KiB", "Cole median", "p90", "max", "MALE median", "p90", "max", "fitting, s")
    print(markdown(header, rows))
    print(f"\n{len(names)} materials at {len(SIZES)} sizes, drawing and measuring included: {seconds:.1f} s")
    worst = sorted((r for r in results if r.size == SIZES[0]), key=lambda r: -r.error)[:5]
    print("worst at 16²: " + ", ".join(f"{r.name} {figure(r.error)}" for r in worst))


if __name__ == "__main__":
    main()
